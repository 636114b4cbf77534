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
echo 1..30
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
judge coman 9000 5
judge coman-foc 10000 3
judge coman-compact 20000 3
judge coman-fd 20000 3
judge coman-cia402 20000 3
judge coman-robstride 8000 3 0.002 2
exit $failed
