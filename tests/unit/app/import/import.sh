#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# From a URDF to frames on a bus by three commands and no edit, for each personality; what cannot be
# imported is refused with a place and leaves nothing. Prints TAP.
set -u
program=$1
folder=$(mktemp -d /tmp/hil-import-XXXXXX)
trap 'rm -rf "$folder"' EXIT
number=0
failures=0

result() {
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $number - $2"
    else
        failures=$((failures + 1))
        echo "not ok $number - $2"
        sed 's/^/# /' "$folder/log"
    fi
}

# An arm of six joints, its base in the world, a tool on a fixed joint
inertia='<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
{
    echo '<robot name="arm"><link name="world"/>'
    parent=world
    for i in 1 2 3 4 5 6; do
        echo "<link name=\"link$i\"><inertial><origin xyz=\"0 0 0.1\"/><mass value=\"$((8 - i))\"/>"
        echo "$inertia</inertial><collision><geometry><cylinder radius=\"0.05\" length=\"0.3\"/>"
        echo "</geometry></collision></link>"
        echo "<joint name=\"joint$i\" type=\"revolute\"><parent link=\"$parent\"/>"
        echo "<child link=\"link$i\"/><origin xyz=\"0 0 0.2\" rpy=\"0.3 0 0\"/>"
        echo "<axis xyz=\"$((i % 2)) $((1 - i % 2)) 0\"/>"
        echo "<limit lower=\"-2\" upper=\"2\" effort=\"$((200 - 30 * i))\" velocity=\"3\"/></joint>"
        parent=link$i
    done
    echo '<link name="tool"><inertial><mass value="0.5"/>'"$inertia"'</inertial></link>'
    echo '<joint name="flange" type="fixed"><parent link="link6"/><child link="tool"/></joint>'
    echo '</robot>'
} >"$folder/arm.urdf"

echo 1..15
for personality in icub foc compact compact-fd; do
    out=$folder/$personality
    "$program" import "$folder/arm.urdf" -o "$out" --personality $personality >"$folder/log" 2>&1 &&
        "$program" check "$out/rigs/arm.yaml" >"$folder/log" 2>&1
    result $? "an_arm_is_imported_for_$personality"
    "$program" run "$out/rigs/arm.yaml" --task hold --clock free --transport local --quiet \
        >"$folder/log" 2>&1 && grep -q 'held for 10.0 s' "$folder/log"
    result $? "an_imported_arm_holds_its_pose_with_$personality"
done

{
    echo "extends: arm.yaml"
    echo "name: strict"
    echo "tasks: {hold: {tolerance_rad: 1.0e-6}}"
} >"$folder/icub/rigs/strict.yaml"
"$program" run "$folder/icub/rigs/strict.yaml" --task hold --clock free --transport local --quiet \
    >"$folder/log" 2>&1
[ $? -eq 1 ] && grep -q 'failed: joint joint[1-6] is .* allowed are 1e-06 rad' "$folder/log"
result $? a_joint_beyond_the_tolerance_fails_the_hold

sed 's/revolute/planar/' "$folder/arm.urdf" >"$folder/planar.urdf"
"$program" import "$folder/planar.urdf" -o "$folder/none" >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'planar.urdf:5: found planar joint "joint1"' "$folder/log" &&
    [ ! -e "$folder/none" ]
result $? what_is_refused_has_a_place_and_leaves_nothing
# Drives of the catalogue: for all joints, then others for some, by the last that matches
out=$folder/drives
"$program" import "$folder/arm.urdf" -o "$out" --drive harmonic-fha25c-100 \
    --drive 'joint[56]=cubemars-ak80-6' >"$folder/log" 2>&1 &&
    [ "$(grep -c 'drive: "harmonic-fha25c-100"' "$out/robots/arm.yaml")" -eq 4 ] &&
    [ "$(grep -c 'drive: "cubemars-ak80-6"' "$out/robots/arm.yaml")" -eq 2 ] &&
    ! grep -q 'Ks_nm_rad' "$out/robots/arm.yaml"
result $? drives_of_the_catalogue_are_taken_by_name_and_by_joint
grep -q 'drive of joint "joint5": cubemars-ak80-6 of the catalogue' "$out/arm-import.txt" &&
    grep -q 'joint "joint5" has a drive for 24 V' "$out/arm-import.txt" &&
    grep -q '^supply_v: 141' "$out/rigs/arm.yaml"
result $? the_report_says_which_joint_got_which_drive
"$program" import "$folder/arm.urdf" -o "$out" --drive harmonic-fha25c-100 >"$folder/log" 2>&1 &&
    "$program" run "$out/rigs/arm.yaml" --task hold --clock free --transport local --quiet \
        >"$folder/log" 2>&1 && grep -q 'held for 10.0 s' "$folder/log"
result $? an_arm_with_drives_of_the_catalogue_holds_its_pose
"$program" import "$folder/arm.urdf" -o "$folder/none" --drive cubemars-ak80-9 >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'cubemars-ak80-9.*cubemars-ak80-6' "$folder/log" && [ ! -e "$folder/none" ]
result $? a_drive_that_is_not_there_is_refused_with_the_nearest
"$program" import "$folder/arm.urdf" -o "$folder/none" --drive joint7=cheetah-3 >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'found "joint7=cheetah-3", expected a joint that turns.*nearest is "joint' \
    "$folder/log" && [ ! -e "$folder/none" ]
result $? a_pattern_of_no_joint_is_refused_with_the_nearest
exit $((failures > 0))
