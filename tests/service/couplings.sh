#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Grippers whose second finger follows the first, imported and held over the bus: no drive, no
# address and no loop for the follower, both fingers carried by the one drive. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
program=$HIL_BINARY_DIR/coman-hil
tap_show="$work/out $work/err"

run() {
    timeout -k 5 100 "$program" run "$@" --transport local --clock free --control none --quiet \
        >"$work/out" 2>"$work/err" </dev/null
}

# a palm on a wrist, and two fingers that open against each other
finger() {
    printf '<link name="%s"><inertial><origin xyz="0 0 0.04"/><mass value="0.05"/>' "$1"
    printf '<inertia ixx="4e-5" iyy="4e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>'
    printf '<collision><origin xyz="0 0 0.04"/><geometry><cylinder radius="0.01" '
    printf 'length="0.08"/></geometry></collision></link>\n'
    printf '<joint name="%s_finger" type="revolute"><parent link="palm"/><child link="%s"/>' \
        "$1" "$1"
    printf '<origin xyz="0 %s 0.02"/><axis xyz="1 0 0"/>' "$2"
    printf '<limit lower="%s" upper="%s" effort="0.4" velocity="3"/>%s</joint>\n' "$3" "$4" "$5"
}
{
    printf '<robot name="gripper"><link name="world"/><link name="palm"><inertial>'
    printf '<origin xyz="0 0 0.02"/><mass value="0.8"/><inertia ixx="0.002" iyy="0.002" '
    printf 'izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>\n'
    printf '<joint name="wrist" type="revolute"><parent link="world"/><child link="palm"/>'
    printf '<origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>'
    printf '<limit lower="-1.5" upper="1.5" effort="4" velocity="3"/></joint>\n'
    finger left 0.03 -0.8 0.2 ''
    finger right -0.03 -0.2 0.8 '<mimic joint="left_finger" multiplier="-1"/>'
    printf '</robot>\n'
} >"$work/gripper.urdf"

echo 1..12

"$program" import "$work/gripper.urdf" -o "$work/refused" >"$work/out" 2>"$work/err"
[ $? -eq 2 ] && grep -q 'gripper.urdf:6: .*give --mimic couple to have it follow' "$work/err" &&
    [ ! -e "$work/refused" ]
result $? "a joint that follows is refused until --mimic says what becomes of it"

"$program" import "$work/gripper.urdf" --mimic couple -o "$work/made" >"$work/out" 2>"$work/err" &&
    grep -q '3 joints, 2 drives' "$work/out" &&
    grep -q '1 of the joints follows another' "$work/out" &&
    grep -q 'gripper.urdf:6: joint "right_finger" follows "left_finger", -1 times its position, ' \
        "$work/made/gripper-import.txt"
result $? "with --mimic couple it has no drive of its own, and the report says so"

rigs=$work/made/rigs
"$program" check "$rigs/gripper.yaml" >"$work/out" 2>"$work/err" &&
    grep -q '1 of the joints follows another' "$work/out" &&
    ! grep -q right_finger "$rigs/gripper.yaml"
result $? "the rig has no address and no loop for it"

{
    printf 'extends: gripper.yaml\nname: tilted\n'
    printf 'initial: {joints_rad: {wrist: 0.6, left_finger: -0.5}}\n'
    printf 'tasks: {hold: {duration_s: 58.0, tolerance_rad: 0.02}}\n'
} >"$rigs/tilted.yaml"
run "$rigs/tilted.yaml" --task hold --duration 65 --record "$work/held" &&
    grep -q 'held for 58.0 s' "$work/out"
result $? "a gripper is held for a minute"

# Each finger weighs m g l sin(q), by what the wrist leaves of it, and turns about axes that look
# the same way: the follower is bent from where its leader wants it by no more than its weight does
python3 - "$work/held/signals.csv" "$work/made/robots/gripper.yaml" >"$work/out" 2>&1 <<'END'
import csv, math, re, sys
rows = [{k: float(v) for k, v in r.items()} for r in csv.DictReader(open(sys.argv[1]))]
stiffness = float(re.search(r"stiffness_nm_rad: (\S+),", open(sys.argv[2]).read()).group(1))
assert len(rows) >= 6000, len(rows)
worst, off = 0.0, []
for r in rows:
    left, right = r["q_left_finger_rad"], r["q_right_finger_rad"]
    weight = 0.05 * 9.81 * 0.04 * math.sin(right) * math.cos(r["q_wrist_rad"])
    assert abs(left + 0.5) < 0.02 and abs(r["q_wrist_rad"] - 0.6) < 0.02, r
    assert abs(left + right) < 3e-4, r
    # at rest but for what the ticks of the encoders let the loop do
    if r["time_s"] > 2.0:
        worst = max(worst, abs(left + right - weight / stiffness))
        off.append((r["torque_right_finger_nm"] + weight, r["torque_left_finger_nm"] - 2 * weight))
follower, leader = (sum(column) / len(off) for column in zip(*off))
print("asymmetry beyond the follower's weight %.1e rad; torques off by %.1e and %.1e of %.1e N m" %
      (worst, follower, leader, weight))
assert worst < 1e-5 and abs(follower) < 2e-5 and abs(leader) < 4e-5
END
result $? "its fingers stay symmetric within 0.3 mrad, and the one drive carries both" \
    "$(tail -n 1 "$work/out")"

run "$rigs/tilted.yaml" --task hold --duration 5
first=$(grep 'state hash' "$work/out")
run "$rigs/tilted.yaml" --task hold --duration 5
[ -n "$first" ] && [ "$first" = "$(grep 'state hash' "$work/out")" ]
result $? "two runs have the same bits"

"$program" plot "$work/held" --signal 'q_*finger_rad' -o "$work/held.svg" \
    >"$work/out" 2>"$work/err" && grep -q q_right_finger_rad "$work/held.svg"
result $? "its recording is plotted"

# two moving bodies on either side of a third: friction on both fingers carries 5 g
{
    printf 'extends: gripper.yaml\nname: pinch\nscene:\n  engine: native\n  friction: sticking\n'
    printf '  materials: {soft: {young_pa: 1.0e4, thickness_m: 1.0e-3, dissipation_s_per_m: 10.0,\n'
    printf '    static_friction: 1.1, dynamic_friction: 1.0, viscous_s_per_m: 0.0}}\n'
    printf '  bodies: [{name: box, mass_kg: 0.005, box_m: [0.03, 0.0404, 0.03],\n'
    printf '    xyz_m: [0.0, 0.0, 0.565]}]\n'
    printf '  surfaces: [{name: box, body: box, shape: box, material: soft,\n'
    printf '    half_extents_m: [0.015, 0.0202, 0.015]}]\n'
    printf '  robot_surfaces: {material: soft, self_collision: false}\n'
    printf 'tasks: {hold: {duration_s: 8.0, tolerance_rad: 0.02}}\n'
} >"$rigs/pinch.yaml"
run "$rigs/pinch.yaml" --task hold --duration 15 --record "$work/pinch" &&
    grep -q 'held for 8.0 s' "$work/out" &&
    python3 - "$work/pinch/signals.csv" >"$work/out" 2>&1 <<'END'
import csv, sys
rows = [{k: float(v) for k, v in r.items()} for r in csv.DictReader(open(sys.argv[1]))]
first, last = rows[100], rows[-1]
print(first["box_z_m"], last["box_z_m"], last["fz_box_n"], last["q_left_finger_rad"])
assert abs(last["fz_box_n"] - 0.005 * 9.81) < 1e-4
assert abs(last["box_z_m"] - 0.565) < 1e-3 and abs(last["box_z_m"] - first["box_z_m"]) < 2e-4
assert abs(last["q_left_finger_rad"] + last["q_right_finger_rad"]) < 1e-4
END
result $? "what the fingers pinch does not slip" "$(tail -n 1 "$work/out")"

printf 'extends: gripper.yaml\nname: bent\ninitial: {joints_rad: {right_finger: 0.4}}\n' \
    >"$rigs/bent.yaml"
"$program" check "$rigs/bent.yaml" >"$work/out" 2>"$work/err"
[ $? -eq 2 ] && grep -q 'bent.yaml:3:.*"right_finger", which follows "left_finger", expected that' \
    "$work/err"
result $? "a rig cannot put a follower where its leader does not lead it"

sed 's/axes: \["wrist"/axes: ["right_finger"/' "$rigs/gripper.yaml" >"$rigs/driven.yaml"
"$program" check "$rigs/driven.yaml" >"$work/out" 2>"$work/err"
[ $? -eq 2 ] && grep -q 'found joint "right_finger", which has no drive' "$work/err"
result $? "no board drives a follower"

# MuJoCo's way: the equality, and the actuator on the joint that the equality names first
{
    printf '<mujoco model="pinch"><worldbody><body name="palm" pos="0 0 0.5">\n'
    printf '<inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>\n'
    for side in left right; do
        printf '<body name="%s" pos="0 0.03 0"><inertial mass="0.1" pos="0 0 -0.05" ' $side
        printf 'diaginertia="1e-4 1e-4 1e-5"/><joint name="%s" axis="1 0 0" ' $side
        printf 'range="-60 60" limited="true"/></body>\n'
    done
    printf '</body></worldbody>\n<actuator><motor joint="right" ctrlrange="-1 1"/></actuator>\n'
    printf '<equality><joint joint1="right" joint2="left" polycoef="0.2 -0.5 0 0 0"/></equality>'
    printf '</mujoco>\n'
} >"$work/pinch.xml"
"$program" import "$work/pinch.xml" --mimic couple -o "$work/mjcf" >"$work/out" 2>"$work/err" &&
    grep -q 'joint "left" follows "right", -2 times its position + 0.4, ' \
        "$work/mjcf/pinch-import.txt"
result $? "the joint that has the actuator leads"
run "$work/mjcf/rigs/pinch.yaml" --task hold --duration 20 && grep -q 'held for 10.0 s' "$work/out"
result $? "and holds both"

exit $failed
