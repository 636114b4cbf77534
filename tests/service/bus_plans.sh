#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# COMAN squats over each of its bus plans, controller and boards speaking another protocol on each;
# what goes over the buses is the same, byte for byte, when it is done again; with frames that take
# their time on the wire no bus is busier than `check` says. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"

run() { # RECORD RIG OPTION...
    local record=$1 rig=$2
    shift 2
    timeout -k 5 100 "$HIL_BINARY_DIR/coman-hil" run "$work/config/rigs/$rig.yaml" \
        --transport local --task squat --quiet --record "$work/$record" "$@" \
        >"$work/out" 2>"$work/err" </dev/null
}

# buses of the plan, and that none is to carry more than it can
check_budget() { # RIG BUSES
    local loads
    "$HIL_BINARY_DIR/coman-hil" check "$work/config/rigs/$1.yaml" >"$work/check-$1" 2>&1
    loads=$(sed -n 's/.* load .* = \([0-9.]*\) %.*/\1/p' "$work/check-$1" | tr '\n' ' ')
    python3 -c 'import sys
loads = [float(x) for x in sys.argv[2:]]
sys.exit(len(loads) != int(sys.argv[1]) or max(loads) > 100)' "$2" $loads
    result $? "$1: $2 buses, none over its capacity in the worst case" "$loads%"
}

squat() { # RIG
    run "free-$1" "$1" --clock free
    result $? "$1: the squat is done in free run" \
        "$(grep -hE 'task squat|failed' "$work/out" "$work/err" | tail -n 1)"
    python3 "$HIL_SOURCE_DIR/tests/service/squat_judge.py" "$work/free-$1" $((number + 1)) "$1"
    number=$((number + 5))
}

repeat() { # RIG
    run "first-$1" "$1" --clock lockstep --duration 3 &&
        run "second-$1" "$1" --clock lockstep --duration 3 &&
        cmp "$work/first-$1/candump.log" "$work/second-$1/candump.log" &&
        cmp "$work/first-$1/signals.csv" "$work/second-$1/signals.csv"
    result $? "$1: two runs in lockstep give the same frames and signals" \
        "$(wc -l <"$work/first-$1/candump.log") frames"
}

# exact frame lengths and arbitration against the worst case
wire() { # RIG
    run "wire-$1" "$1" --clock free --duration 3 --wire wire
    python3 - "$work/wire-$1/summary.json" "$work/check-$1" >"$work/judged" <<'END'
import json, re, sys
buses = json.load(open(sys.argv[1]))["buses"]
worst = [float(x) for x in re.findall(r" load .* = ([0-9.]+) %", open(sys.argv[2]).read())]
good = len(buses) == len(worst) > 0
for bus, limit in zip(buses, worst):
    wire = bus["wire"]
    lost = sum(wire[k] for k in wire if k.startswith("dropped") or k.endswith("_errors"))
    good = good and lost == 0
    good = good and 0.5 * limit < bus["load_percent"] <= wire["load_peak_percent"] < limit
    print(f"{bus['load_percent']:.1f} of {limit}", end=", ")
sys.exit(not good)
END
    result $? "$1: on the wire nothing is lost, and no bus is busier than in the worst case" \
        "$(cat "$work/judged")%"
}

# a frame of the plan's own kind, so often
talks() { # RIG WHAT PATTERN LEAST
    local count
    count=$(grep -cE "$3" "$work/free-$1/candump.log")
    [ "$count" -ge "$4" ]
    result $? "$1: $2" "$count frames"
}

# Three protocols on five buses, and boards that boot longer than the controller waits before it
# asks again.
make_mixed() {
    local full='full_scale_n: [2000, 2000, 2000], full_scale_nm: [40, 40, 40]'
    cat >"$work/config/rigs/mixed.yaml" <<END
extends: coman.yaml
name: mixed
motors: {boot_s: 0.7}
buses:
  - {name: torso, interface: can0, protocol: foc, boards: [
      {kind: motor, address: 1, axes: [WaistLat]}, {kind: motor, address: 2, axes: [WaistSag]},
      {kind: motor, address: 3, axes: [WaistYaw]},
      {kind: torque, address: 0x0c, joints: [WaistLat, WaistSag, WaistYaw], period_s: 0.01}]}
  - {name: left_leg, interface: can1, boards: [
      {kind: motor, address: 1, axes: [LHipSag, LHipLat]},
      {kind: motor, address: 2, axes: [LHipYaw, LKneeSag]},
      {kind: motor, address: 3, axes: [LAnkLat, LAnkSag]},
      {kind: ft, address: 0x0d, sensor: l_leg_ft, $full, period_s: 0.005}]}
  - {name: right_hip, interface: can2, protocol: compact, boards: [
      {kind: motor, address: 1, axes: [RHipSag, RHipLat]},
      {kind: motor, address: 2, axes: [RHipYaw, RKneeSag]}]}
  - {name: right_foot, interface: can3, protocol: compact, boards: [
      {kind: motor, address: 9, axes: [RAnkLat, RAnkSag]},
      {kind: ft, address: 31, sensor: r_leg_ft, $full}]}
  - {name: arms, interface: can4, protocol: compact, fd: true, data_bitrate: 5000000, boards: [
      {kind: motor, address: 1, axes: [LShSag, LShLat, LShYaw, LElbj]},
      {kind: motor, address: 2, axes: [RShSag, RShLat, RShYaw, RElbj]},
      {kind: ft, address: 3, sensor: l_arm_ft, $full},
      {kind: ft, address: 4, sensor: r_arm_ft, $full}]}
END
}

echo 1..57
cp -r "$HIL_SOURCE_DIR/config" "$work/config"
make_mixed
check_budget coman 5
check_budget coman-foc 10
check_budget coman-compact 9
check_budget coman-cia402 8
check_budget coman-fd 2
check_budget mixed 5
for rig in coman coman-foc coman-compact coman-cia402 coman-fd mixed; do
    squat "$rig"
    wire "$rig"
done
# 19 s at 1 kHz
talks coman-foc "set-points reach all nine buses with motors every millisecond" \
    ' 10F#[0-9A-F]{16}$' $((9 * 18990))
talks coman-compact "all axes of a bus get their set-points in one frame" \
    ' 040#([0-9A-F]{12}|[0-9A-F]{8})$' $((9 * 18990))
talks coman-cia402 "every bus has its SYNC every millisecond" ' 080#$' $((8 * 18990))
talks coman-fd "the set-points of a half are one CAN FD frame" \
    ' 040##1([0-9A-F]{64}|[0-9A-F]{40})$' $((2 * 18990))
for rig in coman-foc coman-compact coman-cia402 coman-fd mixed; do
    repeat "$rig"
done
