#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The simulator and a controller as two processes on vcan, on a kernel that has CAN (run it through
# tests/bus/uml/run.sh): lockstep gives the very bytes that one process gives, either side may start
# again, interfaces may go while it runs. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/*.out $work/*.err"

json()
{
    python3 -c 'import json, sys
value = json.load(open(sys.argv[1]))
for key in sys.argv[2].split("."):
    value = value[int(key)] if isinstance(value, list) else value[key]
print(value)' "$1/summary.json" "$2"
}

# simulate NAME ARGUMENT...: starts the simulator in the background and waits until its loop runs
simulate()
{
    local name=$1
    shift
    "$program" run "$rig" --transport socketcan --record "$work/$name" --quiet \
        --control "$work/$name.socket" --ready "$work/$name.ready" "$@" \
        >"$work/$name.out" 2>"$work/$name.err" </dev/null &
    simulator=$!
    # the guest is slow at starting processes: no program asks, and few sleeps
    for _ in $(seq 600); do
        [ -e "$work/$name.ready" ] && break
        sleep 0.2
    done
}

# reached TICK NAME: waits until the simulator of the name has run so far
reached() { timeout 60 "$program" ctl --socket "$work/$2.socket" wait tick="$1" >/dev/null 2>&1; }

# at NAME: the tick that the simulator of the name is at
at()
{
    "$program" ctl --socket "$work/$1.socket" --json status |
        python3 -c 'import json, sys; print(json.load(sys.stdin)["tick"])'
}

# said TEXT FILE: waits until the file has it
said()
{
    for _ in $(seq 300); do
        grep -q "$1" "$2" && return
        sleep 0.2
    done
}

task()
{
    "$program" task squat "$rig" --clock lockstep --quiet "$@" >"$work/task.out" \
        2>"$work/task.err" </dev/null &
    controller=$!
}

echo 1..10

name="two processes in lockstep record the very bytes of one process"
"$program" run "$rig" --transport local --clock lockstep --task squat --ticks 150 \
    --record "$work/one" --quiet >"$work/one.out" 2>"$work/one.err" </dev/null
simulate two --clock lockstep --ticks 150
task
wait "$simulator"
simulated=$?
wait "$controller"
if [ $simulated = 0 ] && cmp "$work/one/candump.log" "$work/two/candump.log" &&
    [ "$(json "$work/one" state_hash)" = "$(json "$work/two" state_hash)" ] &&
    [ -s "$work/two/candump.log" ]
then ok "$name"; else not_ok "$name"; fi

name="the controller hears that the simulator stops"
if grep -q "simulator is stopping" "$work/task.err"
then ok "$name"; else not_ok "$name"; fi

name="a controller may start again while the simulator waits"
simulate host --clock lockstep
task
reached 1 host
kill -TERM "$controller"
wait "$controller"
stopped=$?
before=$(at host)
task
# The first one, stopped in the midst of a tick, may have had that message as well
reached $((before + 1)) host
kill -TERM "$simulator"
wait "$simulator"
simulated=$?
wait "$controller"
if [ $stopped = 0 ] && [ $simulated = 0 ] && [ "$(json "$work/host" ticks)" -gt "$before" ] &&
    grep -q "expects tick 0" "$work/host.err"
then ok "$name"; else not_ok "$name"; fi

name="the simulator may start again under a controller"
simulate first --clock lockstep
task --reconnect
reached 1 first
kill -KILL "$simulator"
wait "$simulator" 2>/dev/null
simulate second --clock lockstep --ticks 50
wait "$simulator"
simulated=$?
kill -TERM "$controller" 2>/dev/null
wait "$controller"
if [ $simulated = 0 ] && [ "$(json "$work/second" ticks)" = 50 ]
then ok "$name"; else not_ok "$name"; fi

name="a partner that does not come is reported, and waited for until SIGTERM"
simulate silent --clock lockstep
said "no STEP frame on can0" "$work/silent.err"
kill -TERM "$simulator"
wait "$simulator"
simulated=$?
if grep -q "no STEP frame on can0" "$work/silent.err" &&
    [ "$(json "$work/silent" end)" = stopped ] &&
    [ "$(json "$work/silent" ticks)" = 0 ]
then ok "$name"; else not_ok "$name"; fi

# one bus and long ticks: the loop of a slow guest leaves its only processor to others, and no
# recording is full of overruns
name="an interface goes down, comes up and vanishes while the loop goes on"
whole=$rig
cp -r "$HIL_SOURCE_DIR/config" "$work/config"
rig=$work/config/rigs/slow.yaml
printf '%s\n' 'extends: hyq-leg.yaml' 'name: slow' 'tick_s: 0.05' 'substep_s: 0.001' \
    'tasks: {servo: {command_period_s: 0.05}}' >"$rig"
simulate fragile --clock real --record-period 50
ip link set can0 down
said "bus can0 is down" "$work/fragile.err"
ip link set can0 up
said "bus can0 is up" "$work/fragile.err"
ip link del can0
said "bus can0 is gone" "$work/fragile.err"
kill -TERM "$simulator"
wait "$simulator"
simulated=$?
ip link add dev can0 type vcan && ip link set can0 up
rig=$whole
if [ $simulated = 0 ] && [ "$(json "$work/fragile" end)" = stopped ] &&
    grep -q "bus can0 is down" "$work/fragile.err" &&
    grep -q "bus can0 is up" "$work/fragile.err" &&
    grep -q "bus can0 is gone" "$work/fragile.err"
then ok "$name"; else not_ok "$name"; fi

# refused STATUS NAME MESSAGE ARGUMENT...
refused()
{
    local status=$1 title=$2 message=$3 found
    shift 3
    "$program" run "$rig" --clock free --ticks 1 --record "$work/refused" "$@" \
        >"$work/refused.out" \
        2>"$work/refused.err" </dev/null
    found=$?
    if [ $found = "$status" ] && grep -q "$message" "$work/refused.err" && [ ! -e "$work/refused" ]
    then ok "$title"; else not_ok "$title"; fi
}

refused 2 "an interface that is not there is refused and named" "no interface can9" --bus torso=can9
refused 2 "one that is no CAN interface as well" "not a CAN interface" --bus torso=lo
ip link set can4 down
refused 3 "one that is down has its own message" "can4 is down"
ip link set can4 up

# A guest that its host lets wait may miss an echo in time: that is counted as lost
name="latency: every command and every echo is answered, or lost, and counted"
rig=$HIL_SOURCE_DIR/config/rigs/coman-foc-leg.yaml
simulate leg --clock real
timeout 120 "$HIL_BINARY_DIR/coman-hil-bench" latency "$rig" --joint LKneeSag --count 6 \
    --priority 0 --out "$work/latency" >"$work/latency.out" 2>"$work/latency.err" </dev/null
measured=$?
kill -TERM "$simulator"
wait "$simulator"
simulated=$?
counts=$(awk -F, 'NR > 1 { w += $2; e += $3; b += $4 } END { print w, e, b }' \
    "$work/latency/latency.csv")
told=$(awk '$1 ~ /^(wake-up|echo|boards)$/ && NF == 8 { print $2; if ($2 + $8 == 6 && $2 > 0) n++ }
    END { print n }' "$work/latency.out")
if [ $measured = 0 ] && [ $simulated = 0 ] && [ "$(echo $counts 3)" = "$(echo $told)" ] &&
    grep -q "switches the motor of LKneeSag" "$work/latency.out"
then ok "$name"; else not_ok "$name"; fi
