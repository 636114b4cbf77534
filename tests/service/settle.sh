#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A settled start over the buses: the feet carry the weight from the first tick, and still do when the
# controller takes over; the force-torque boards say on the bus what the contacts exert. Beside it the
# start as it stands in the rig, with its transient. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml

# start NAME OPTION...: 3.5 s of the squat task from that start
start()
{
    local name=$1
    shift
    timeout -k 5 100 "$HIL_BINARY_DIR/coman-hil" run "$rig" --transport local --clock free \
        --task squat --ticks 3500 --energy --quiet --record "$work/$name" --record-period 1 "$@" \
        >"$work/$name.out" 2>"$work/$name.err" </dev/null
}

echo 1..9
number=0
for run in "rig" "settled --settle"; do
    number=$((number + 1))
    # shellcheck disable=SC2086 # the name and its options
    if start $run; then
        echo "ok $number - the run from the start ${run%% *} ends with status 0"
    else
        echo "not ok $number - the run from the start ${run%% *} ends with status 0"
        tail -n 3 "$work/${run%% *}.err" | sed 's/^/# /'
    fi
done
if grep -q "^settled: .* base 0\.[0-9]* mm lower" "$work/settled.err" &&
    ! grep -q "^settled" "$work/rig.err"; then
    echo "ok 3 - the program says where it has settled"
else
    echo "not ok 3 - the program says where it has settled"
fi
cp -r "$HIL_SOURCE_DIR/config" "$work/config"
asking=$work/config/rigs/coman.yaml
sed -i "s|settle: false|settle: true|" "$asking"
if "$HIL_BINARY_DIR/coman-hil" check "$asking" | grep -q "^start .*settled$" &&
    ! "$HIL_BINARY_DIR/coman-hil" check "$rig" | grep -q "settled"; then
    echo "ok 4 - a rig can ask for it"
else
    echo "not ok 4 - a rig can ask for it"
fi
python3 "$HIL_SOURCE_DIR/tests/service/settle_judge.py" "$work/rig" "$work/settled" 5
