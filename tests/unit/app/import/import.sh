#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# From a URDF to frames on a bus by three commands and no edit, for each protocol; what cannot be
# imported is refused with a place and leaves nothing. Prints TAP.
set -u
program=$1
config=$(dirname "$0")/../../../../config
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

echo 1..49
for protocol in icub foc compact compact-fd moteus cia402 odrive mini-cheetah \
    "$config/protocols/odrive.yaml"; do
    file=$protocol
    protocol=$(basename "$file")
    out=$folder/$protocol
    "$program" import "$folder/arm.urdf" -o "$out" --protocol "$file" >"$folder/log" 2>&1 &&
        "$program" check "$out/rigs/arm.yaml" >"$folder/log" 2>&1
    result $? "an_arm_is_imported_for_$protocol"
    "$program" run "$out/rigs/arm.yaml" --task hold --clock free --transport local --quiet \
        >"$folder/log" 2>&1 && grep -q 'held for 10.0 s' "$folder/log"
    result $? "an_imported_arm_holds_its_pose_with_$protocol"
done


# Drives that send torques only when configured to send all frames are so configured
[ "$(grep -c 'transmit_at_start: true' "$folder/odrive/rigs/arm.yaml")" -eq 6 ] &&
    ! grep -q transmit_at_start "$folder/icub/rigs/arm.yaml" "$folder/mini-cheetah/rigs/arm.yaml" &&
    timeout 60 "$program" run "$folder/odrive/rigs/arm.yaml" --task hold --clock free \
        --transport local --duration 0.2 --record "$folder/record" >"$folder/log" 2>&1 &&
    grep -q ' can[0-9]* 03C#' "$folder/record/candump.log"
result $? imported_drives_send_the_torques_that_their_host_needs

# A protocol file of the user's is copied; addresses are given or counted
grep -q '^protocol: \.\./protocols/odrive\.yaml' "$folder/odrive.yaml/rigs/arm.yaml" &&
    cmp -s "$config/protocols/odrive.yaml" "$folder/odrive.yaml/protocols/odrive.yaml"
result $? a_protocol_file_is_copied_beside_the_rig
out=$folder/addresses
"$program" import "$folder/arm.urdf" -o "$out" --protocol cia402 --address joint2=1 \
    --address joint1=27 >"$folder/log" 2>&1 &&
    sed -n 's/.*address: \([0-9]*\), axes: \["joint\([0-9]\)"\].*/\2=\1/p' "$out/rigs/arm.yaml" \
        >"$folder/log" && grep -qx 1=27 "$folder/log" && grep -qx 2=1 "$folder/log" &&
    grep -qx 3=2 "$folder/log"
result $? addresses_are_given_or_counted
for wrong in joint9=1 joint1=0 joint1=128 joint1 "joint1=3 --address joint2=3"; do
    # shellcheck disable=SC2086
    "$program" import "$folder/arm.urdf" -o "$folder/wrong" --protocol cia402 --address $wrong \
        >"$folder/log" 2>&1
    [ $? -eq 2 ] && grep -q -- '--address: found' "$folder/log" && [ ! -e "$folder/wrong" ] || break
done
[ "$wrong" = "joint1=3 --address joint2=3" ] && [ ! -e "$folder/wrong" ]
result $? wrong_addresses_are_refused_and_leave_nothing
for wrong in none ./none.yaml described icub-fd; do
    "$program" import "$folder/arm.urdf" -o "$folder/wrong" --protocol $wrong >"$folder/log" 2>&1
    [ $? -eq 2 ] && grep -q -- '--protocol: found' "$folder/log" || break
done
[ "$wrong" = icub-fd ] && [ ! -e "$folder/wrong" ]
result $? unknown_protocols_are_refused

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
"$program" import "$folder/arm.urdf" -o "$out" --drive harmonic-fha25c-100 --force \
    >"$folder/log" 2>&1 &&
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

# Two arms of seven joints and a gripper of two fingers on a pedestal, the build of OpenArm, with
# its makers' motors over Damiao's protocol: each arm fills one CAN FD bus
{
    echo '<robot name="twoarms"><link name="world"/><link name="pedestal"><inertial>'
    echo '<origin xyz="0 0 0.3"/><mass value="10"/>'"$inertia"'</inertial></link>'
    echo '<joint name="floor" type="fixed"><parent link="world"/><child link="pedestal"/></joint>'
    for side in "left 1" "right -1"; do
        set -- $side
        parent=pedestal
        place="0 0.0$((5 + $2)) 0.7"
        for row in "1 0 0 1 -1.3 3.3 40 16 1.1" "2 1 0 0 -1.6 1.6 40 16 0.5" \
            "3 0 0 1 -1.5 1.5 27 5 0.9" "4 0 1 0 0 2.4 27 5 0.8" "5 0 0 1 -1.5 1.5 7 20 0.6" \
            "6 1 0 0 -0.7 0.7 7 20 0.4" "7 0 1 0 -1.5 1.5 7 20 0.3"; do
            side=$1
            # shellcheck disable=SC2086
            set -- "$1" "$2" $row
            echo "<link name=\"$1_link$3\"><inertial><origin xyz=\"0 0 -0.05\"/>"
            echo "<mass value=\"${11}\"/><inertia ixx=\"0.002\" iyy=\"0.002\" izz=\"0.001\""
            echo 'ixy="0" ixz="0" iyz="0"/></inertial></link>'
            echo "<joint name=\"$1_joint$3\" type=\"revolute\"><parent link=\"$parent\"/>"
            echo "<child link=\"$1_link$3\"/><origin xyz=\"$place\"/><axis xyz=\"$4 $5 $6\"/>"
            echo "<limit lower=\"$7\" upper=\"$8\" effort=\"$9\" velocity=\"${10}\"/></joint>"
            parent=$1_link$3
            place="0 0 -0.09"
            set -- "$side" "$2"
        done
        for finger in "1 1" "2 -1 <mimic joint=\"$1_finger_joint1\"/>"; do
            side=$1
            # shellcheck disable=SC2086
            set -- "$1" "$2" $finger
            echo "<link name=\"$1_finger$3\"><inertial><mass value=\"0.04\"/><inertia ixx=\"2e-5\""
            echo 'iyy="2e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            echo "<joint name=\"$1_finger_joint$3\" type=\"prismatic\"><parent link=\"$parent\"/>"
            echo "<child link=\"$1_finger$3\"/><origin xyz=\"0 0 -0.12\"/><axis xyz=\"0 $4 0\"/>"
            echo "<limit lower=\"0\" upper=\"0.04\" effort=\"300\" velocity=\"10\"/>${5-} ${6-}"
            echo '</joint>'
            set -- "$side" "$2"
        done
    done
    echo '</robot>'
} >"$folder/twoarms.urdf"
# two_arms PROTOCOL OUT OPTIONS: the import of the guide
two_arms() {
    protocol=$1
    out=$2
    shift 2
    "$program" import "$folder/twoarms.urdf" -o "$out" --protocol "$protocol" --mimic couple \
        --prismatic drive --drive '*=damiao-dm4310' --drive '*_joint[12]=damiao-dm8009' \
        --drive '*_joint[34]=damiao-dm4340' --drive '*_finger*=damiao-dm4310' "$@" \
        >"$folder/log" 2>&1
}
two_arms damiao-fd "$folder/fd" --bus-load 95 &&
    [ "$(grep -c 'data_bitrate: 5000000' "$out/rigs/twoarms.yaml")" -eq 2 ] &&
    sed -n 's/.*address: \([0-9]\), .*model: dm\([0-9]*\)}$/\1 \2/p' "$out/rigs/twoarms.yaml" |
    sort | uniq -c | tr -s ' \n' ' ' >"$folder/log" &&
    grep -qx ' 2 1 8009 2 2 8009 2 3 4340 2 4 4340 2 5 4310 2 6 4310 2 7 4310 2 8 4310 ' \
        "$folder/log" &&
    grep -q '^doubted: 0' "$out/twoarms-import.txt"
result $? an_arm_of_eight_motors_is_on_one_bus_of_can_fd
"$program" check "$out/rigs/twoarms.yaml" >"$folder/log" 2>&1 &&
    [ "$(grep -c 'load 45.4 % + 45.4 % = 90.9 %$' "$folder/log")" -eq 2 ] &&
    [ "$(grep -c 'carries *8 such axes at 1 kHz, 17 at 500 Hz' "$folder/log")" -eq 2 ]
result $? check_says_how_many_motors_a_bus_carries
tolerance() {
    printf 'extends: %s.yaml\nname: close\ntasks: {hold: {tolerance_rad: 0.01}}\n' "$1" \
        >"$out/rigs/close.yaml"
    "$program" run "$out/rigs/close.yaml" --task hold --clock free --transport local --quiet \
        >"$folder/log" 2>&1 && grep -q 'held for 10.0 s' "$folder/log"
}
tolerance twoarms
result $? two_arms_hold_their_pose_over_damiao_to_10_mrad
two_arms damiao "$folder/classic" &&
    [ "$(grep -c '^  - name: bus' "$out/rigs/twoarms.yaml")" -eq 8 ] &&
    "$program" check "$out/rigs/twoarms.yaml" >"$folder/log" 2>&1 &&
    [ "$(grep -c 'carries *3 such axes at 1 kHz, 7 at 500 Hz' "$folder/log")" -eq 8 ]
result $? classic_can_carries_fewer
! two_arms odrive-fd "$folder/none" &&
    grep -q 'found "odrive-fd", expected a protocol whose file has follow_fd: true' "$folder/log" &&
    [ ! -e "$folder/none" ]
result $? a_protocol_without_can_fd_is_refused_with_fd

# Hydraulic drives: a quadruped on twelve of them, hanging and on its feet
{
    echo '<robot name="quad"><link name="trunk"><inertial><mass value="50"/><inertia ixx="1"'
    echo 'iyy="5" izz="5.5" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    for leg in "lf 0.35 0.2 -1.2 0.9 0.3 2.4" "rf 0.35 -0.2 -1.2 0.9 0.3 2.4" \
        "lh -0.35 0.2 -0.9 1.2 -2.4 -0.3" "rh -0.35 -0.2 -0.9 1.2 -2.4 -0.3"; do
        set -- $leg
        parent=trunk
        place="$2 $3 0"
        for joint in "haa 2 1 0 -0.8 0.8 -0.08" "hfe 2.5 0 1 $4 $5 -0.35" \
            "knee 0.9 0 1 $6 $7 0"; do
            leg=$1
            set -- $leg $joint
            echo "<link name=\"$1_$2\"><inertial><origin xyz=\"0 0 -0.15\"/><mass value=\"$3\"/>"
            echo '<inertia ixx="0.03" iyy="0.03" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>'
            [ "$2" = knee ] && echo '<collision><origin xyz="0 0 -0.33"/><geometry>' \
                '<sphere radius="0.02"/></geometry></collision>'
            echo "</link><joint name=\"$1_$2\" type=\"revolute\"><parent link=\"$parent\"/>"
            echo "<child link=\"$1_$2\"/><origin xyz=\"$place\"/><axis xyz=\"$4 $5 0\"/>"
            echo "<limit lower=\"$6\" upper=\"$7\" effort=\"120\" velocity=\"10\"/></joint>"
            parent=$1_$2
            place="0 0 $8"
        done
    done
    echo '</robot>'
} >"$folder/quad.urdf"
{
    echo '<robot name="quad"><virtual_joint name="w" type="floating" parent_frame="world"'
    echo 'child_link="trunk"/><group name="all"/><group_state name="standing" group="all">'
    for leg in "lf -0.7 1.4" "rf -0.7 1.4" "lh 0.7 -1.4" "rh 0.7 -1.4"; do
        set -- $leg
        echo "<joint name=\"$1_hfe\" value=\"$2\"/><joint name=\"$1_knee\" value=\"$3\"/>"
    done
    echo '</group_state></robot>'
} >"$folder/quad.srdf"
out=$folder/quad
"$program" import "$folder/quad.urdf" --srdf "$folder/quad.srdf" -o "$out" --drive hyq \
    >"$folder/log" 2>&1 && "$program" check "$out/rigs/quad.yaml" >>"$folder/log" 2>&1 &&
    grep -q '12 drives' "$folder/log" &&
    [ "$(grep -c 'file: "hyq"' "$out/robots/quad.yaml")" -eq 12 ] &&
    grep -q '^protocol: servo-valve' "$out/rigs/quad.yaml" &&
    grep -q 'hydraulic supply: 160 bar' "$out/quad-import.txt"
result $? a_quadruped_with_cylinders_gets_valves_and_a_supply
tolerance quad
result $? a_quadruped_with_cylinders_holds_its_pose_to_10_mrad
tolerance quad-standing
result $? a_quadruped_with_cylinders_stands_to_10_mrad

# An arm with both kinds: motors and valves are on buses of their own
out=$folder/mixed
sed 's/lower="-2" upper="2"/lower="-1.2" upper="1.2"/' "$folder/arm.urdf" >"$folder/narrow.urdf"
"$program" import "$folder/narrow.urdf" -o "$out" --drive coman \
    --drive 'joint[123]=iso6020-25-g771' >"$folder/log" 2>&1 &&
    grep -q '^protocol: icub' "$out/rigs/arm.yaml" &&
    grep -q '^    protocol: servo-valve' "$out/rigs/arm.yaml" && tolerance arm
result $? an_arm_with_motors_and_cylinders_holds_its_pose_to_10_mrad
"$program" import "$folder/arm.urdf" -o "$folder/none" --drive hyq >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'arm.urdf:5: found joint "joint1", which turns by 4 rad' "$folder/log" &&
    [ ! -e "$folder/none" ]
result $? a_range_too_wide_for_a_cylinder_is_refused_with_its_place

# A drive of one's own comes along
sed 's/^name: coman$/name: mine/' "$config/drives/coman.yaml" >"$folder/mine.yaml"
out=$folder/own
"$program" import "$folder/arm.urdf" -o "$out" --drive "$folder/mine.yaml" >"$folder/log" 2>&1 &&
    cmp "$folder/mine.yaml" "$out/drives/mine.yaml" >>"$folder/log" 2>&1 &&
    [ "$(grep -c 'drive: "../drives/mine.yaml"' "$out/robots/arm.yaml")" -eq 6 ]
result $? a_drive_of_ones_own_is_copied_beside_the_robot

# What may have been edited is not written over
out=$folder/icub
echo '# mine' >>"$out/rigs/arm.yaml"
"$program" import "$folder/arm.urdf" -o "$out" >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'icub/rigs/arm.yaml: found it there already.*--force' "$folder/log" &&
    grep -q '^# mine$' "$out/rigs/arm.yaml"
result $? a_rig_that_is_there_is_kept
"$program" import "$folder/arm.urdf" -o "$out" --force >"$folder/log" 2>&1 &&
    ! grep -q '^# mine$' "$out/rigs/arm.yaml"
result $? force_writes_over_it

# Meshes outside the folder of the model
mkdir "$folder/urdf" "$folder/meshes"
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' \
    >"$folder/meshes/m.obj"
sed 's|<cylinder radius="0.05" length="0.3"/>|<mesh filename="../meshes/m.obj"/>|' \
    "$folder/arm.urdf" >"$folder/urdf/arm.urdf"
"$program" import "$folder/urdf/arm.urdf" -o "$folder/none" >"$folder/log" 2>&1
[ $? -eq 2 ] && grep -q 'arm.urdf:3: found mesh "../meshes/m.obj", which is outside.*--trust' \
    "$folder/log" && [ ! -e "$folder/none" ]
result $? a_mesh_outside_the_folder_is_refused_and_leaves_nothing
"$program" import "$folder/urdf/arm.urdf" -o "$folder/trusted" --trust >"$folder/log" 2>&1 &&
    grep -q '6 meshes' "$folder/log"
result $? a_mesh_outside_the_folder_is_read_with_trust

sed 's/^v \([01]\) \([01]\) \([01]\)/v \100 \200 \300/' "$folder/meshes/m.obj" \
    >"$folder/meshes/mm.obj"
sed 's|meshes/m.obj|meshes/mm.obj|' "$folder/urdf/arm.urdf" >"$folder/urdf/mm.urdf"
"$program" import "$folder/urdf/mm.urdf" -o "$folder/mm" --trust >"$folder/log" 2>&1 &&
    [ "$(grep -c 'm long, the largest distance .* is 0.2 m: a mesh in mm needs scale' \
        "$folder/log")" -eq 6 ] && grep -q '^doubted: 6$' "$folder/mm/arm-import.txt" &&
    grep -q '^doubted: 0$' "$folder/trusted/arm-import.txt"
result $? a_mesh_in_millimeters_is_doubted

# A hundred joints, more than a simulator carried once
{
    echo '<robot name="snake"><link name="l0"><inertial><mass value="1"/>'"$inertia"'</inertial>'
    echo '</link>'
    for i in $(seq 100); do
        echo "<link name=\"l$i\"><inertial><mass value=\"0.1\"/>$inertia</inertial></link>"
        echo "<joint name=\"j$i\" type=\"revolute\"><parent link=\"l$((i - 1))\"/>"
        echo "<child link=\"l$i\"/><origin xyz=\"0 0 0.02\"/>"
        echo "<axis xyz=\"$((i % 2)) $((1 - i % 2)) 0\"/>"
        echo '<limit lower="-2" upper="2" effort="100" velocity="3"/></joint>'
    done
    echo '</robot>'
} >"$folder/snake.urdf"
out=$folder/snake
"$program" import "$folder/snake.urdf" -o "$out" --base fixed --protocol compact-fd \
    >"$folder/log" 2>&1 && grep -q '100 joints, 100 drives' "$folder/log"
result $? a_hundred_joints_are_imported
"$program" run "$out/rigs/snake.yaml" --task hold --clock free --transport local --quiet \
    --duration 0.2 >"$folder/log" 2>&1
[ $? -le 1 ] && ! grep -q 'found 100 joints' "$folder/log"
result $? a_hundred_joints_run

# Fourteen wheels without mass, each of which changes the robot from its file
{
    sed '$d' "$folder/snake.urdf" | sed 's/snake/cart/'
    for i in $(seq 14); do
        echo "<link name=\"w$i\"/><joint name=\"spin$i\" type=\"continuous\"><parent link=\"l1\"/>"
        echo "<child link=\"w$i\"/></joint>"
    done
    echo '</robot>'
} >"$folder/cart.urdf"
"$program" import "$folder/cart.urdf" -o "$folder/cart" --base fixed --protocol compact-fd \
    >"$folder/log" 2>&1 && [ "$(grep -c 'nothing that it moves has mass' "$folder/log")" -eq 12 ] &&
    report=$(sed -n 's/^\.\.\. and [0-9]* more: \(.*\) has all$/\1/p' "$folder/log") &&
    [ "$(grep -c 'nothing that it moves has mass' "$report")" -eq 14 ]
result $? notes_that_are_left_out_are_in_the_report
exit $((failures > 0))
