#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The DBC files of each protocol: written for every bus, the same each time, and a recorded squat
# decoded through them by another program is what the plant did. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
hil=$HIL_BINARY_DIR/coman-hil
. "$(dirname "$0")/tap.sh"

export_rig() { # RIG BUSES
    local files
    mkdir "$work/$1" && "$hil" dbc "$HIL_SOURCE_DIR/config/rigs/$1.yaml" -o "$work/$1" \
        >"$work/out" 2>&1
    files=$(ls "$work/$1" | grep -c '\.dbc$')
    [ "$files" -eq "$2" ]
    result $? "$1: a file for each of $2 buses" "$(head -n 1 "$work/out")"
}

judge() { # RIG LEAST TESTS [LAG PERIOD]
    timeout -k 5 100 "$hil" run "$HIL_SOURCE_DIR/config/rigs/$1.yaml" --transport local \
        --clock free --task squat \
        --duration 0.5 --record-period "${5:-1}" --quiet --record "$work/record-$1" \
        >"$work/out" 2>&1 </dev/null
    /usr/bin/python3 "$HIL_SOURCE_DIR/tests/service/dbc_judge.py" "$1" "$work/$1" \
        "$work/record-$1" $((number + 1)) "$2" "${4:-0}" \
        2>"$work/err" || { failed=1 && tail -n 1 "$work/err" | sed 's/^/# /'; }
    number=$((number + $3))
}

if ! /usr/bin/python3 -c 'import canmatrix.formats' 2>/dev/null; then
    echo "1..0 # SKIP python3-canmatrix is not installed"
    exit 0
fi
echo 1..32
export_rig coman 5
export_rig coman-foc 10
export_rig coman-compact 9
export_rig coman-fd 2
export_rig coman-cia402 8
export_rig coman-robstride 10
for channel in '986 fx "l_leg_ft"' '986 fy "l_leg_ft"' '986 fz "l_leg_ft"' '987 mx "l_leg_ft"' \
    '987 my "l_leg_ft"' '987 mz "l_leg_ft"' '970 LHipSag_torque "LHipSag"' \
    '971 LAnkSag_torque "LAnkSag"'; do
    grep -qxF "CM_ SG_ $channel;" "$work/coman/coman-left_leg.dbc" || echo "no $channel"
done >"$work/out"
[ ! -s "$work/out" ]
result $? "channels of force-torque and torque boards are named" "$(cat "$work/out")"
"$hil" dbc "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --bus left_leg |
    cmp - "$work/coman/coman-left_leg.dbc"
result $? "one bus to standard output is the same file"
"$hil" dbc "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --bus leg >"$work/out" 2>"$work/err"
[ $? -eq 2 ] && grep -q 'found "leg", expected a bus of .*: torso, left_leg' "$work/err"
result $? "a bus that the rig has not is refused" "$(cat "$work/err")"
"$hil" dbc "$HIL_SOURCE_DIR/config/rigs/coman.yaml" -o /dev/null/nowhere >"$work/out" 2>"$work/err"
[ $? -eq 3 ]
result $? "a folder that cannot be made is the system's error" "$(cat "$work/err")"
# Names over the limit of the format: short ones by address, and the whole names beside them
cat >"$work/names.py" <<'END'
import sys
import canmatrix.formats
matrix = canmatrix.formats.loadp_flat(sys.argv[1])
print(*sorted(node.name for node in matrix.ecus))
print(*sorted({frame.name for frame in matrix.frames} & set(sys.argv[2:])))
print(*sorted({signal.name for frame in matrix.frames for signal in frame.signals} &
              set(sys.argv[2:])))
END
joint=right_shoulder_flexion_extension_motor
{
    echo '<robot name="arm"><link name="base"/>'
    parent=base
    for name in a b; do
        echo "<link name='$name'><inertial><mass value='1'/><inertia ixx='0.01' iyy='0.01'"
        echo " izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial></link>"
        echo "<joint name='${joint}_$name' type='revolute'><parent link='$parent'/>"
        echo "<child link='$name'/><origin xyz='0 0 0.2'/><axis xyz='0 1 0'/>"
        echo "<limit lower='-1' upper='1' effort='20' velocity='5'/></joint>"
        parent=$name
    done
    echo '</robot>'
} >"$work/arm.urdf"
"$hil" import "$work/arm.urdf" -o "$work/arm" >"$work/out" 2>&1 &&
    "$hil" dbc "$work/arm/rigs/arm.yaml" -o "$work/arm" >"$work/out" 2>&1
names=$(/usr/bin/python3 "$work/names.py" "$work"/arm/arm-*.dbc \
    ${joint}_a_position ${joint}_b_current | tail -n 1)
[ "$names" = "${joint}_a_position ${joint}_b_current" ] &&
    ! grep "^ SG_" "$work"/arm/arm-*.dbc | awk 'length($2) > 32 { exit 1 }' | grep .
result $? "names of joints over 32 letters are whole in SystemSignalLongSymbol" "$names"
names=$(/usr/bin/python3 "$work/names.py" "$work/coman-foc/coman-foc-right_shank.dbc" \
    right_shank_0x01_ADDITIONAL_STATUS right_shank_0x0b_FORCE | head -n 2)
[ "$names" = "host right_shank_0x01 right_shank_0x02 right_shank_0x03 right_shank_0x0b simulator
right_shank_0x01_ADDITIONAL_STATUS right_shank_0x0b_FORCE" ]
result $? "names of boards are whole, and those of their messages" "$names"
judge coman 9000 5
judge coman-foc 10000 3
judge coman-compact 20000 3
judge coman-fd 20000 3
judge coman-cia402 20000 3
judge coman-robstride 8000 3 0.002 2
exit $failed
