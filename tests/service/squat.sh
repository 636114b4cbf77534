#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The main job: COMAN squats four times, driven over its five CAN buses in lockstep, and stays up.
# Judged from the recording; what the controller reports must be the same. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show=$work/err

echo 1..7
timeout -k 5 280 "$HIL_BINARY_DIR/coman-hil" run "$HIL_SOURCE_DIR/config/rigs/coman.yaml" \
    --transport local --clock lockstep --task squat --quiet --record "$work/squat" \
    >"$work/out" 2>"$work/err" </dev/null
result $? "the run ends with status 0, the task done"
python3 "$HIL_SOURCE_DIR/tests/service/squat_judge.py" "$work/squat" 2
judged=$?
number=6
grep -Eq '^task squat: 4 cycles done, (9[7-9]|10[0-3])\.[0-9] mm deep, ' "$work/out"
result $? "the controller reports four cycles and their depth" "$(head -n 1 "$work/out")"
exit $((judged || failed))
