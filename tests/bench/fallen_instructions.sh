#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: fallen_instructions.sh COMAN-HIL
# A tick of a COMAN that has fallen without power and lies on the floor, against a tick of its
# squat, in instructions by callgrind: a figure that does not depend on how busy the machine is.
# Prints TAP.
program=$1
# hundredths of a tick of the squat; 447 since friction follows the normal force of each stage, 299
# before
most=460
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
echo 1..1
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 # SKIP no valgrind"
    exit 0
fi

# the shipped rig, limp, leaning forward and aside
mkdir "$dir/rigs"
cp "$HIL_SOURCE_DIR"/config/rigs/*.yaml "$dir/rigs"
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$dir/"
cat >"$dir/rigs/fallen.yaml" <<'RIG'
extends: coman.yaml
name: fallen
initial: {hold: none, base_rpy_rad: [0.3, 0.9, 0.0]}
RIG

# count TICKS OPTION...: the instructions of a run's loop
count()
{
    ticks=$1
    shift
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=loop_run "$program" \
        run "$@" --wire wire --transport local --ticks "$ticks" --control none --quiet \
        >"$dir/ran" 2>"$dir/log" </dev/null || cat "$dir/log" >&2
    sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out"
}

squat=$(($(count 1000 "$dir/rigs/coman.yaml" --clock lockstep --task squat) / 1000))
falling=$(count 2500 "$dir/rigs/fallen.yaml" --clock free)
lying=$((($(count 3000 "$dir/rigs/fallen.yaml" --clock free) - falling) / 500))
text="a tick of a COMAN that lies takes $lying instructions, of its squat $squat"
if [ "$squat" -gt 0 ] && [ "$lying" -gt 0 ] && [ "$lying" -le $((most * squat / 100)) ]; then
    echo "ok 1 - $text"
else
    echo "not ok 1 - $text"
    exit 1
fi
