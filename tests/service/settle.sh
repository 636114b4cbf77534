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
        --task squat --ticks 3500 --energy --quiet --record "$work/$name" --record-period 1 "$@" \
        >"$work/$name.out" 2>"$work/$name.err" </dev/null
    result $? "the run from the start $name ends with status 0"
}

echo 1..9
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
python3 "$HIL_SOURCE_DIR/tests/service/settle_judge.py" "$work/rig" "$work/settled" 5
