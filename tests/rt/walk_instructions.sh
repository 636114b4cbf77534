#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: walk_instructions.sh COMAN-HIL
# What the walk's controller takes in a tick, with all CAN traffic, in instructions by callgrind: a
# figure that does not depend on how busy the machine is. The budget is 50 us at two instructions a
# nanosecond. A third of the ticks are steps. Prints TAP.
program=$1
ticks=3000
budget=100000
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
echo 1..1
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 # SKIP no valgrind"
    exit 0
fi

# the steps begin as soon as the robot balances
mkdir "$dir/rigs"
for file in "$HIL_SOURCE_DIR"/config/rigs/*.yaml; do
    sed 's/begin_s: [0-9.]*/begin_s: 0.0/' "$file" >"$dir/rigs/$(basename "$file")"
done
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$dir/"
valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=task_step "$program" \
    run "$dir/rigs/walk-flat.yaml" --clock lockstep --transport local --task walk --ticks $ticks \
    --control none --quiet >"$dir/ran" 2>"$dir/log" || cat "$dir/log"
total=$(sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out")
each=$((${total:-0} / ticks))
if [ $each -gt 0 ] && [ $each -le $budget ]; then
    echo "ok 1 - a tick of the walk's controller takes $each instructions of $budget"
else
    echo "not ok 1 - a tick of the walk's controller takes $each instructions of $budget"
    exit 1
fi
