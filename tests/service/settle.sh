#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A settled start over the buses: the feet carry the weight from the first tick, and still do when
# the controller takes over; the force-torque boards send on the bus what the contacts exert. Beside
# it the rig's own start, with its transient. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml

# start NAME OPTION...: 3.5 s of the squat task from that start
start()
{
    local name=$1
    shift
    tap_show=$work/$name.err
    timeout -k 5 100 "$HIL_BINARY_DIR/coman-hil" run "$rig" --transport local --clock free \
        --task squat --ticks 3500 --energy --record "$work/$name" --record-period 1 "$@" \
        >"$work/$name.out" 2>"$work/$name.err" </dev/null
    result $? "the run from the start $name ends with status 0"
}

echo 1..11
start rig
start settled --settle

grep -q "^settled: .* base 0\.[0-9]* mm lower" "$work/settled.err" &&
    ! grep -q "^settled" "$work/rig.err"
result $? "the program says where it has settled"

cp -r "$HIL_SOURCE_DIR/config" "$work/config"
asking=$work/config/rigs/coman.yaml
sed -i "s|settle: false|settle: true|" "$asking"
"$HIL_BINARY_DIR/coman-hil" check "$asking" | grep -q "^start .*settled$" &&
    ! "$HIL_BINARY_DIR/coman-hil" check "$rig" | grep -q "settled"
result $? "a rig can ask for it"

# A box on a ramp of 0.35 rad beside the robot; with 1.1 and 0.2, whose harmonic mean counts,
# friction holds it up to 0.326 rad
python3 - "$work/config/rigs" <<'END'
import sys
def change(text, old, new):
    assert text.count(old) == 1, old
    return text.replace(old, new)
rig = open(sys.argv[1] + "/grasp.yaml").read()
rig = change(rig, "xyz_m: [0.20, 0.0, 0.55]}", "xyz_m: [1.0, 0.0, 0.0798], rpy_rad: [0, 0.35, 0]}")
rig = change(rig, "xyz_m: [0.20, 0.0, 0.475]}", "xyz_m: [1.0, 0.0, 0.0], rpy_rad: [0, 0.35, 0]}")
rig = change(rig, """shape: box, half_extents_m: [0.10, 0.12, 0.025], cells: 1,
       xyz_m: [0.0, 0.0, -0.025], material: table}""", "shape: half_space, material: table}")
head, tail = rig.split("    table:\n")
open(sys.argv[1] + "/slide.yaml", "w").write(
    head + "    table:\n" + tail.replace("static_friction: 1.1", "static_friction: 0.2", 1)
    .replace("dynamic_friction: 0.9", "dynamic_friction: 0.2", 1))
END
"$HIL_BINARY_DIR/coman-hil" run "$work/config/rigs/slide.yaml" --transport local --clock free \
    --ticks 1 --settle >"$work/slide.err" 2>&1
[ $? -eq 2 ] && grep -q "box would slide: it stands on a slope of 0.35 rad, where 5.37 N push it \
sideways, and friction holds it up to 0.326 rad" "$work/slide.err"
tap_show=$work/slide.err result $? "of a robot that stands and a box that slides the box is named"

# Steps too long for rk4: the verdict names the cause, beside a test of what cannot be wrong
sed -e "s|^integrator: implicit.*|integrator: rk4|" "$rig" >"$work/config/rigs/diverges.yaml"
cat >"$work/config/scenarios/diverges.yaml" <<'END'
name: diverges
description: COMAN, limp, with steps that are too long for its integrator
rig: ../rigs/diverges.yaml
hold: none
duration_s: DURATION
expectations:
  - {name: the knee has an angle, signal: LKneeSag.q, between: [-100, 100]}
END
judge()
{
    sed -i "s|DURATION|$1|" "$work/config/scenarios/diverges.yaml"
    "$HIL_BINARY_DIR/coman-hil" test "$work/config/scenarios/diverges.yaml" \
        >"$work/diverges.out" 2>&1
    [ $? -eq 1 ] && grep -q "$2" "$work/diverges.out" &&
        sed -i "s|^duration_s: .*|duration_s: DURATION|" "$work/config/scenarios/diverges.yaml"
}
judge 0.07 "energy appeared from nowhere" && judge 0.2 "the integrator diverges: "
tap_show=$work/diverges.out result $? "a test whose integrator diverges does not pass"
python3 "$HIL_SOURCE_DIR/tests/service/settle_judge.py" "$work/rig" "$work/settled" 5
