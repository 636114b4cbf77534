#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Instructions of the loop in lockstep with buses in wire mode against the same in ideal mode, by
# callgrind: a figure that does not depend on how busy the machine is. The budget is what a tick of
# the squat may take more, with its 24 frames on five buses; as a part of the tick it grows with
# everything that makes the rest of the tick shorter. Nobody steers: the copy of the start would
# count.
program=$1
ticks=500
budget=26000 # instructions a tick
echo 1..1
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 # SKIP no valgrind"
    exit 0
fi
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT

# instructions MODE
instructions() {
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=loop_run \
        "$program" run "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --wire "$1" --clock lockstep \
        --transport local --task squat --duration 0.5 --control none --quiet \
        >/dev/null 2>"$dir/log" ||
        cat "$dir/log" >&2
    sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out"
}

ideal=$(instructions ideal)
wire=$(instructions wire)
ideal=${ideal:-0}
wire=${wire:-0}
name="wire mode takes at most $budget instructions a tick more than ideal mode"
if [ "$ideal" -gt 0 ] && [ $(((wire - ideal) / ticks)) -le $budget ]; then
    echo "# a tick: ideal $((ideal / ticks)), wire $((wire / ticks)) instructions," \
        "$((100 * (wire - ideal) / ideal)) % more"
    echo "ok 1 - $name"
else
    echo "# ideal $ideal, wire $wire instructions"
    echo "not ok 1 - $name"
    exit 1
fi
