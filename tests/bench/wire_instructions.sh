#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Instructions of the loop in lockstep with buses in wire mode against the same in ideal mode, by
# callgrind: a figure that does not depend on how busy the machine is.
program=$1
budget=25 # percent
echo 1..1
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 # SKIP no valgrind"
    exit 0
fi
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT

# instructions MODE
instructions() {
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=loop_run "$program" run \
        "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --wire "$1" --clock lockstep --transport local \
        --task squat --duration 0.5 --quiet >/dev/null 2>"$dir/log" || cat "$dir/log" >&2
    sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out"
}

ideal=$(instructions ideal)
wire=$(instructions wire)
ideal=${ideal:-0}
wire=${wire:-0}
if [ "$ideal" -gt 0 ] && [ $((100 * (wire - ideal))) -le $((budget * ideal)) ]; then
    echo "# ideal $ideal, wire $wire instructions: $((1000 * (wire - ideal) / ideal)) per mille more"
    echo "ok 1 - wire mode takes at most $budget % more instructions than ideal mode"
else
    echo "# ideal $ideal, wire $wire instructions"
    echo "not ok 1 - wire mode takes at most $budget % more instructions than ideal mode"
    exit 1
fi
