#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# coman-hil run and task as a user meets them, on local buses: runs and their ends, what is wrong on
# the command line, recordings, determinism, signals. Virtual time and counts are asserted, wall
# time never. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"

# run STATUS NAME ARGUMENT...: runs coman-hil and expects the exit status
run()
{
    local expected=$1 name=$2 status
    shift 2
    timeout -k 5 100 "$program" "$@" >"$work/out" 2>"$work/err" </dev/null
    status=$?
    if [ $status -eq "$expected" ]; then
        return 0
    fi
    echo "# $name: status $status, expected $expected" >>"$work/err"
    return 1
}

# wrong STATUS NAME MESSAGE ARGUMENT...: refused, with the message, and without a recording
wrong()
{
    local expected=$1 name=$2 message=$3
    shift 3
    rm -rf "$work/none"
    if run "$expected" "$name" "$@" && grep -q -- "$message" "$work/err" && [ ! -s "$work/out" ] &&
        [ ! -e "$work/none" ]; then
        ok "$name"
    else
        not_ok "$name"
    fi
}

json()
{
    python3 -c 'import json, sys
value = json.load(open(sys.argv[1]))
for key in sys.argv[2].split("."):
    value = value[int(key)] if isinstance(value, list) else value[key]
print(value)' "$1/summary.json" "$2"
}

without_can()
{
    ! python3 -c 'import socket; socket.socket(socket.AF_CAN, socket.SOCK_RAW, 1)' 2>/dev/null
}

echo 1..36

# ---- runs and their length ----
name="a free run without a controller ends at its length and lets the robot fall"
if run 0 "$name" run "$rig" --transport local --clock free --hold none --duration 2 \
    --record "$work/limp" &&
    [ "$(json "$work/limp" ticks)" = 2000 ] && [ "$(json "$work/limp" end)" = "ran its length" ] &&
    [ "$(wc -l <"$work/limp/signals.csv")" = 201 ] && [ ! -s "$work/limp/candump.log" ] &&
    python3 -c 'import csv, sys
rows = list(csv.DictReader(open(sys.argv[1])))
sys.exit(not float(rows[-1]["base_z_m"]) < 0.6 * float(rows[0]["base_z_m"]))' \
        "$work/limp/signals.csv"
then ok "$name"; else not_ok "$name"; fi

name="the length in ticks is exact"
if run 0 "$name" run "$rig" --transport local --clock free --ticks 7 --record "$work/seven" &&
    [ "$(json "$work/seven" ticks)" = 7 ] && [ "$(json "$work/seven" virtual_s)" = 0.007 ]
then ok "$name"; else not_ok "$name"; fi

name="a real-time run counts its ticks by virtual time and shows it on a terminal"
script -qec "$program run $rig --transport local --clock real --duration 1.5 \
    --record $work/real" /dev/null </dev/null >"$work/terminal"
if [ "$(json "$work/real" ticks)" = 1500 ] &&
    tr '\r' '\n' <"$work/terminal" | grep -qE ' [01]\.[0-9]{3} s  x[0-9.]+  overruns [0-9]+  '
then ok "$name"; else not_ok "$name"; fi

name="overruns are charged to some phase each"
if python3 -c 'import json, sys
o = json.load(open(sys.argv[1] + "/summary.json"))["overruns"]
total = o.pop("total")
sys.exit(sum(o.values()) != total)' "$work/real"
then ok "$name"; else not_ok "$name"; fi

name="the policy stop ends with status 1 when deadlines cannot be held"
mkdir -p "$work/config/rigs"
sed 's/^substep_s:.*/substep_s: 0.00000625/' "$rig" >"$work/config/rigs/slow.yaml"
cp -r "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work/config/"
if run 1 "$name" run "$work/config/rigs/slow.yaml" --transport local --clock real --hold none \
    --overrun stop \
    --duration 60 && grep -q "stopped by overruns" "$work/err" && grep -q "by plant" "$work/out"
then ok "$name"; else not_ok "$name"; fi

# ---- determinism ----
for i in 1 2; do
    run 0 lockstep run "$rig" --transport local --clock lockstep --task squat --duration 0.5 \
        --record "$work/lockstep$i" --quiet
done
run 0 free run "$rig" --transport local --clock free --task squat --duration 0.5 \
    --record "$work/free" --quiet

name="a lockstep run that ends before its first tick has a summary without shares of nothing"
"$program" run "$rig" --transport local --gateway 0 --clock lockstep --quiet --ready "$work/ready" \
    >"$work/out" 2>"$work/err" </dev/null &
pid=$!
for ((turn = 0; turn < 600; turn++)); do
    [ -e "$work/ready" ] || ! kill -0 $pid 2>/dev/null && break
    sleep 0.1
done
kill -TERM $pid 2>/dev/null
wait $pid && grep -q '^  0 ticks' "$work/out" && grep -q 'contact: 1 evaluations' "$work/out" &&
    ! grep -qE '(inf|nan) %' "$work/out"
result $? "$name"

name="two lockstep runs give byte-identical candump logs and signals"
if [ -s "$work/lockstep1/candump.log" ] &&
    cmp "$work/lockstep1/candump.log" "$work/lockstep2/candump.log" &&
    cmp "$work/lockstep1/signals.csv" "$work/lockstep2/signals.csv"
then ok "$name"; else not_ok "$name"; fi

name="a free run gives the same log but for the STEP and DONE frames"
if grep -vE ' (6F0|6FF)#' "$work/lockstep1/candump.log" | cmp - "$work/free/candump.log"
then ok "$name"; else not_ok "$name"; fi

name="the state hashes of all three are equal"
if [ "$(json "$work/lockstep1" state_hash)" = "$(json "$work/lockstep2" state_hash)" ] &&
    [ "$(json "$work/lockstep1" state_hash)" = "$(json "$work/free" state_hash)" ]
then ok "$name"; else not_ok "$name"; fi

name="every tick has one STEP and one DONE on each of five buses, and one DONE that says stopping"
if [ "$(grep -c ' 6F0#' "$work/lockstep1/candump.log")" = 500 ] &&
    [ "$(grep -c ' 6FF#' "$work/lockstep1/candump.log")" = 2505 ] &&
    [ "$(grep -c ' 6FF#F40100000800$' "$work/lockstep1/candump.log")" = 5 ]
then ok "$name"; else not_ok "$name"; fi

name="nothing was lost, unknown or malformed on the way"
if [ "$(json "$work/free" boards.unknown)" = 0 ] &&
    [ "$(json "$work/free" boards.malformed)" = 0 ] &&
    [ "$(json "$work/free" boards.foreign)" = 0 ] &&
    [ "$(json "$work/free" buses.1.rx_dropped)" = 0 ] &&
    [ "$(json "$work/free" recorder.frames_dropped)" = 0 ]
then ok "$name"; else not_ok "$name"; fi

# ---- wrong command lines ----
none=(--record "$work/none")
wrong 2 "a host by a name is refused before anything starts" \
    '--http: found host "labpc", expected' \
    run "$rig" --transport local --http labpc:8080 --duration 1
wrong 2 "a bus of --slcan that is not there is refused with those that are" \
    'slcan: found no bus "leg", expected one of torso, left_leg, right_leg, left_arm, right_arm' \
    run "$rig" --transport local --slcan leg="$work/leg" --duration 1
wrong 2 "an unknown option is refused" "expected" run "$rig" --durations 1
wrong 2 "a length that is not a number is refused" "expected a number" run "$rig" --duration nan
wrong 2 "a negative length is refused" "expected a number" run "$rig" --duration -1
wrong 2 "no length at all is refused" "seconds more than 0" run "$rig" --duration 0 "${none[@]}"
wrong 2 "two lengths are refused" "both --duration and --ticks" run "$rig" --duration 1 --ticks 5 \
    "${none[@]}"
wrong 2 "an unknown clock is refused" "expected" run "$rig" --clock fast
wrong 2 "an unknown task is refused with the nearest" "squat" run "$rig" --task sqat "${none[@]}"
wrong 2 "the task command refuses it as well" "squat" task sqat "$rig"
wrong 2 "an unknown bus is refused with the nearest" 'did you mean "left_leg"' \
    run "$rig" --bus lef_leg=can1 "${none[@]}"
wrong 2 "two buses on one interface are refused" "both on interface" run "$rig" --bus torso=can1 \
    "${none[@]}"
sed 's/^tick_s:.*/tick_s: 0.002/' "$rig" >"$work/config/rigs/two.yaml"
wrong 2 "a row period that is no multiple of the tick is refused" "multiple of the tick" \
    run "$work/config/rigs/two.yaml" --transport local --record-period 5 "${none[@]}"
wrong 2 "a rig that is not there is refused" "No such file" run "$work/no-such.yaml" "${none[@]}"
wrong 4 "lockstep on local buses without a task is refused" "nobody can send" \
    run "$rig" --transport local --clock lockstep "${none[@]}"
if without_can; then
    wrong 4 "a kernel without CAN is told apart" "no CAN.*run --transport local" \
        run "$rig" --transport socketcan "${none[@]}"
else
    wrong 2 "an interface that is not there is told apart" "no-such-if" \
        run "$rig" --bus torso=no-such-if "${none[@]}"
fi

# ---- recordings ----
name="a directory that holds a recording is not overwritten"
if run 2 "$name" run "$rig" --transport local --clock free --ticks 3 --record "$work/seven" &&
    grep -q "not empty" "$work/err" && [ "$(json "$work/seven" ticks)" = 7 ] &&
    run 0 "$name" run "$rig" --transport local --clock free --ticks 3 --record "$work/seven" \
    --force &&
    [ "$(json "$work/seven" ticks)" = 3 ]
then ok "$name"; else not_ok "$name"; fi

name="a summary that is a link is not followed"
mkdir "$work/linked" && echo kept >"$work/kept"
ln -s "$work/kept" "$work/linked/summary.json"
if run 0 "$name" run "$rig" --transport local --clock free --ticks 3 --record "$work/linked" \
    --force && [ "$(cat "$work/kept")" = kept ] && [ "$(json "$work/linked" ticks)" = 3 ]
then ok "$name"; else not_ok "$name"; fi

name="a gateway that others reach is warned of"
if run 0 "$name" run "$rig" --transport local --clock free --ticks 3 --gateway 0.0.0.0:0 &&
    grep -q "warning: .*no password.*0.0.0.0" "$work/err" &&
    run 0 "$name" run "$rig" --transport local --clock free --ticks 3 --gateway 127.0.0.5:0 &&
    ! grep -q warning "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="a full disk is reported, the run goes on to its end, the status tells"
mkdir "$work/full" && ln -s /dev/full "$work/full/candump.log"
if run 3 "$name" run "$rig" --transport local --clock free --task squat --duration 0.5 \
    --record "$work/full" --force && grep -q "No space left" "$work/err" &&
    [ "$(json "$work/full" ticks)" = 500 ] &&
    [ "$(json "$work/full" recorder.frames_unwritten)" -gt 0 ]
then ok "$name"; else not_ok "$name"; fi

# ---- signals ----
# runs DIRECTORY: waits until its recording has a row, so that the loop runs
runs()
{
    for _ in $(seq 600); do
        [ "$(cat "$1/signals.csv" 2>/dev/null | wc -l)" -ge 2 ] && break
        sleep 0.05
    done
}

# interrupted SIGNAL CLOCK: status and summary of a run that the signal ends
interrupted()
{
    "$program" run "$rig" --transport local --clock "$2" --record "$work/$1-$2" \
        >"$work/out" 2>"$work/err" </dev/null &
    local process=$!
    runs "$work/$1-$2"
    # Twice, as timeout does: once to the process, once to its group
    kill -"$1" "$process"
    kill -"$1" "$process" 2>/dev/null
    wait "$process"
}

for signal in INT TERM; do
    name="SIG$signal ends a run with motors off and a summary"
    # a shell's background process ignores SIGINT unless told otherwise
    if [ $signal = INT ]; then
        program_saved=$program
        cat >"$work/with-sigint" <<END
#!/usr/bin/python3
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv("$program", ["coman-hil"] + sys.argv[1:])
END
        chmod +x "$work/with-sigint"
        program=$work/with-sigint
    fi
    if interrupted $signal real && [ "$(json "$work/$signal-real" end)" = stopped ] &&
        grep -q "state hash" "$work/out"
    then ok "$name"; else not_ok "$name"; fi
    program=${program_saved:-$program}
done

# ends OPTION...: starts a run, ends it once it is ready; $said: how often it has said that it has
# no end
ends()
{
    "$program" run "$@" --transport local --control "$work/it's" --ready "$work/ready" \
        >"$work/out" 2>"$work/err" </dev/null &
    for _ in $(seq 600); do
        [ -e "$work/ready" ] && break
        sleep 0.05
    done
    (. "$work/ready" && [ "$pid" = $! ] && [ "$control" = "$work/it's" ] && [ -S "$control" ] &&
        timeout 5 bash -c "exec 3<>/dev/tcp/$gateway_host/$gateway_port") &&
        [ "$(stat -c %a "$work/ready")" = 600 ]
    found=$?
    kill -INT $!
    wait $!
    said=$(grep -c "^the run goes on until it is stopped .*--duration S ends it" "$work/err")
    [ $found = 0 ] && [ ! -e "$work/ready" ]
}
rigs=$HIL_SOURCE_DIR/config/rigs
name="--ready says where a run is found, from when it can be until it ends"
if ends "$rig" --clock lockstep --gateway 0; then ok "$name"; else not_ok "$name"; fi
name="a run that only its user ends says so at the start, others do not"
if ends "$rigs/walk-flat.yaml" --clock free --task walk --gateway 0 && [ "$said" = 1 ] &&
    ends "$rig" --clock real --gateway 0 && [ "$said" = 1 ] &&
    ends "$rig" --clock real --gateway 0 --duration 1000 && [ "$said" = 0 ] &&
    ends "$rig" --clock real --gateway 0 --task squat && [ "$said" = 0 ]
then ok "$name"; else not_ok "$name"; fi

name="a stopped and continued process takes up the grid and does not run after it"
"$program" run "$rig" --transport local --clock real --duration 3 --record "$work/paused" \
    >"$work/out" 2>"$work/err" </dev/null &
process=$!
runs "$work/paused"
kill -STOP $process
sleep 1.5
kill -CONT $process
wait $process
if [ "$(json "$work/paused" ticks)" = 3000 ] && [ "$(json "$work/paused" pauses)" -ge 1 ]
then ok "$name"; else not_ok "$name"; fi
