#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Faults and real sensors as a user meets them: a squat with each kind of fault behaves differently
# from the sound one, which stands; armed faults that do not begin change nothing; the log, check
# and the refusals. Virtual time and counts only. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml
real=$HIL_SOURCE_DIR/config/rigs/coman-sensors.yaml
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"

# go DIR RIG ARGUMENT...: a free run with the squat, recorded into DIR. That the task gives up
# (status 1) is an answer to a fault, not a failure of the run.
go()
{
    local to=$1 file=$2 status
    shift 2
    timeout -k 5 100 "$program" run "$file" --transport local --clock free --task squat \
        --record "$work/$to" "$@" >"$work/out" 2>"$work/err" </dev/null
    status=$?
    [ $status -le 1 ] || return $status
}

json()
{
    python3 -c 'import json, sys
value = json.load(open(sys.argv[1]))
for key in sys.argv[2].split("."):
    value = value[int(key)] if isinstance(value, list) else value[key]
print(value)' "$work/$1/summary.json" "$2"
}

# rows DIR EXPRESSION: whether a Python expression of the recorded rows (list of dict of floats)
# holds
rows()
{
    python3 -c 'import csv, sys
rows = [{k: float(v) for k, v in r.items() if v} for r in csv.DictReader(open(sys.argv[1]))]
sys.exit(not eval(sys.argv[2]))' "$work/$1/signals.csv" "$2"
}

frames()
{
    grep -c " $2#" "$work/$1/candump.log"
}

echo 1..26

go sound "$rig" --duration 3
sound=$(json sound state_hash)

name="faults that are armed and never begin change no frame and no state"
if go armed "$rig" --duration 3 --fault "motor LKneeSag jam manual" \
    --fault "board left_leg/1 off 10.." \
    --fault "bus left_leg loss 0.5 manual" --fault "sensor LKneeSag.motor_encoder stuck 20..30" \
    --fault "supply sag 30 manual" --seed 5 && [ "$(json armed state_hash)" = "$sound" ] &&
    cmp -s "$work/sound/candump.log" "$work/armed/candump.log" && ! grep -q fault "$work/err"
then ok "$name"; else not_ok "$name"; fi

# ---- each kind shows ----
# shows NAME LINE: a run of 3 s with the fault differs from the sound one, repeats, and is in the
# log
shows()
{
    local first
    rm -rf "$work/one" "$work/two"
    go one "$rig" --duration 2.5 --seed 3 --fault "$2" && first=$(json one state_hash) &&
        cp "$work/err" "$work/log" &&
        go two "$rig" --duration 2.5 --seed 3 --fault "$2" &&
        [ "$first" = "$(json two state_hash)" ] &&
        cmp -s "$work/one/candump.log" "$work/two/candump.log" &&
        ! cmp -s "$work/one/candump.log" <(head -n "$(wc -l <"$work/one/candump.log")" \
        "$work/sound/candump.log") &&
        grep -q "fault 1 begins: $2" "$work/log"
}

for line in "sensor LKneeSag.motor_encoder stuck 2..2.4" "sensor l_leg_ft.fz off 2.." \
    "sensor RHipSag.torque wrong gain=2 offset=1 2.." "board left_leg/1 stuck 2..2.2" \
    "board right_arm/2 garbage 2.." "board left_arm/1 hung watchdog=0.2 2.." \
    "board torso/1 slow 5 2.." "bus right_leg corruption 0.05 2.." \
    "bus left_leg duplicate 0.2 2.." "bus left_leg late 0.004 2.."; do
    name="shows in frames or state, repeats bit for bit, stands in the log: $line"
    if shows "$name" "$line"; then ok "$name"; else not_ok "$name"; fi
done

name="a jammed motor stands still while its window lasts and moves again after it"
if go jam "$rig" --duration 2.5 --fault "motor LKneeSag jam 2..2.15" && rows jam \
    '(len({r["qm_LKneeSag_rad"] for r in rows if 2.005 < r["time_s"] < 2.15}) == 1 and
      len({r["qm_LKneeSag_rad"] for r in rows if 2.15 < r["time_s"]}) > 20)' &&
    grep -q "2.000000 s: fault 1 begins" "$work/err" &&
    grep -q "2.150000 s: fault 1 ends" "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="an open phase carries no current, a short generates it, a broken spring no torque"
if go drives "$rig" --duration 2.5 --fault "motor LElbj open_phase 2.." \
    --fault "motor RElbj spring_break 2.." \
    --fault "motor LShSag short 2.." && rows drives \
    '(all(r["current_LElbj_a"] == 0 and r["torque_RElbj_nm"] == 0 and r["voltage_LShSag_v"] == 0
          for r in rows if r["time_s"] > 2.005) and
      any(r["current_LElbj_a"] != 0 and r["torque_RElbj_nm"] != 0
          for r in rows if r["time_s"] < 2))'
then ok "$name"; else not_ok "$name"; fi

# an iCub board has lost its policy with its power: it speaks again when a host asks it to
name="a board without power is silent and limp, and boots afterwards"
if go off "$rig" --duration 2.5 --fault "board left_leg/1 off 2..2.1" &&
    python3 -c 'import sys
times = [float(l.split()[0][1:-1]) for l in open(sys.argv[1]) if " can1 111#" in l]
sys.exit(not 1.99 < max(times) <= 2.0)' "$work/off/candump.log" &&
    rows off 'all(r["current_LHipSag_a"] == 0 for r in rows if r["time_s"] > 2.005)' &&
    grep -q "2.100000 s: left_leg/0x01 .*bootloader" "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="a sagging supply trips the boards into under-voltage"
if go sag "$rig" --duration 2.5 --fault "supply sag 30 2..2.05" &&
    grep -q "under-voltage" "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="a bus that is off carries nothing meanwhile"
if go busoff "$rig" --duration 2.5 --fault "bus left_arm bus_off 2..2.1" &&
    grep -qi "bus.off" "$work/err" &&
    [ "$(frames busoff 111)" -gt 0 ]
then ok "$name"; else not_ok "$name"; fi

name="a lost bus shows as frames that the controller did not get: the run goes on"
if go loss "$rig" --duration 2.5 --fault "bus left_leg loss 0.1 2.." &&
    [ "$(json loss ticks)" = 2500 ] &&
    [ "$(json loss state_hash)" != "$sound" ]
then ok "$name"; else not_ok "$name"; fi

# ---- real sensors ----
name="the squat stands on real sensors, all four cycles"
if timeout -k 5 100 "$program" run "$real" --transport local --clock free --task squat \
    --record "$work/real" >"$work/out" 2>"$work/err" </dev/null &&
    rows real 'min(r["base_z_m"] for r in rows) > 0.3 and rows[-1]["time_s"] > 17'
then ok "$name"; else not_ok "$name"; fi

name="its noise depends on the seed and on nothing else"
if go s1 "$real" --duration 1 --seed 1 && go s1again "$real" --duration 1 --seed 1 &&
    go s2 "$real" --duration 1 --seed 2 &&
    cmp -s "$work/s1/candump.log" "$work/s1again/candump.log" &&
    ! cmp -s "$work/s1/candump.log" "$work/s2/candump.log"
then ok "$name"; else not_ok "$name"; fi

# ---- refusals and help ----
name="a wrong line is refused with the nearest name"
if go none "$rig" --duration 1 --fault "motor LKneeSga jam"; then not_ok "$name"
elif [ $? -eq 2 ] && grep -q 'expected a joint "LKneeSag"' "$work/err" && [ ! -e "$work/none" ]
then ok "$name"; else not_ok "$name"; fi

name="what needs a wire is refused on an ideal bus"
go none "$rig" --duration 1 --fault "bus left_leg id_collision"
if [ $? -eq 4 ] && grep -q "is not in wire mode" "$work/err"
then ok "$name"; else not_ok "$name"; fi

mkdir -p "$work/config/rigs"
cp "$HIL_SOURCE_DIR"/config/rigs/*.yaml "$work/config/rigs/"
cp -r "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work/config/"
cat "$rig" - >"$work/config/rigs/faulty.yaml" <<'END'
faults:
  - "knee: motor LKneeSag jam 1..2"
  - "bus torso loss 0.1 manual"
END
printf 'extends: coman.yaml\nname: coman-wire\nwire: {mode: wire}\n' >"$work/config/rigs/wire.yaml"
name="on a wire a burst of errors is seen by the CRC: frames are repeated, none is lost"
if go burst "$work/config/rigs/wire.yaml" --duration 2.5 \
    --fault "bus left_leg error_burst 0.1 2.." &&
    grep -A 9 "^  wire " "$work/out" | awk '
        $1 == "left_leg" {burst = $11 > 50 && $10 == 0}
        $1 == "right_leg" {sound = $11 == 0}
        END {exit !(burst && sound)}'
then ok "$name"; else not_ok "$name"; fi

name="on a wire two nodes with one id drive each other off the bus"
if go collide "$work/config/rigs/wire.yaml" --duration 2.5 \
    --fault "bus left_leg id_collision id=0x111 2.." &&
    grep -A 9 "^  wire " "$work/out" | awk '$1 == "left_leg" {off = $12} END {exit !(off > 0)}'
then ok "$name"; else not_ok "$name"; fi

name="check lists the faults that a rig arms"
if "$program" check "$work/config/rigs/faulty.yaml" >"$work/out" 2>"$work/err" &&
    grep -q "faults      2 armed" "$work/out" && grep -q "knee: motor LKneeSag jam 1..2" "$work/out"
then ok "$name"; else not_ok "$name"; fi

sed -i 's/jam 1..2/jmm 1..2/' "$work/config/rigs/faulty.yaml"
name="a wrong fault in a rig is refused with its place"
"$program" check "$work/config/rigs/faulty.yaml" >"$work/out" 2>"$work/err"
if [ $? -eq 2 ] && grep -Eq 'faulty.yaml:[0-9]+:[0-9]+.*jam' "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="the manual of run lists the kinds"
if "$program" run --help >"$work/out" && grep -q "spring_break" "$work/out" &&
    grep -q "error_burst" "$work/out"
then ok "$name"; else not_ok "$name"; fi

[ "$number" -eq 26 ]
