#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A rig whose periodic traffic cannot fit on its buses: what check and run say, and whether what
# they advise helps. Usage: wire_budget.sh COMAN-HIL. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/rigs"
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work"
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"

# rig BITRATE: COMAN's buses at another bit rate
rig() {
    sed "/^buses:/,/^[a-z]*:/s/^  - name: .*/&\n    bitrate: $1/" \
        "$HIL_SOURCE_DIR/config/rigs/coman.yaml" >"$work/rigs/rig.yaml"
}

# says STATUS COMMAND...: runs it and compares its exit status
says() {
    local status=$1 found
    shift
    "$program" "$@" >"$work/out" 2>"$work/err" </dev/null
    found=$?
    [ $found = "$status" ] || echo "exit status $found, expected $status" >>"$work/err"
    [ $found = "$status" ]
}

run=(run "$work/rigs/rig.yaml" --clock free --ticks 3 --transport local --quiet)
over='bus left_leg would be loaded to 1[0-9][0-9]\.[0-9] % at the worst'

echo 1..4
rig 500000
says 0 check "$work/rigs/rig.yaml" && grep -q "coman-hil check: warning: $over" "$work/err"
result $? "check warns of buses that cannot carry their traffic"

! grep -q "bus torso would" "$work/err" && ! grep -q "bus left_arm.*left_leg" "$work/err"
result $? "and not of those that can"

advice=$(sed -n 's/.*bus left_leg would.*or run it at \([0-9]*\) kbit.*/\1/p' "$work/err")
rig "${advice}000"
says 0 check "$work/rigs/rig.yaml" && ! grep -q "bus left_leg would" "$work/err"
result $? "at the bit rate that it advises the traffic fits"

rig 500000
says 0 "${run[@]}" && grep -q "coman-hil run: warning: $over" "$work/err"
result $? "run warns of them as well, and runs"
