#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: start_instructions.sh COMAN-HIL
# Instructions of all that a run of COMAN's squat does besides its ticks, from the first of the
# process to its last, by callgrind: a figure that does not depend on how busy the machine is; and
# that it maps no library for robot files in XML, whose pages cost as much again. Prints TAP.
program=$1
budget=60000000 # 57.6 million when this was written: fields of both feet, 14 convex solids
echo 1..2
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
status=0

# instructions
instructions() {
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" "$program" run \
        "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --clock lockstep --transport local --task squat \
        --ticks 1 --control none --quiet >"$dir/log" 2>&1 || cat "$dir/log" >&2
    sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out"
}

name="a start takes at most $budget instructions"
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 - $name # SKIP no valgrind"
else
    start=$(instructions)
    echo "# ${start:=0} instructions"
    if [ "$start" -gt 0 ] && [ "$start" -le "$budget" ]; then
        echo "ok 1 - $name"
    else
        echo "not ok 1 - $name"
        status=1
    fi
fi

name="the program is not linked against libxml2"
if ldd "$program" >"$dir/libraries" && ! grep libxml2 "$dir/libraries"; then
    echo "ok 2 - $name"
else
    echo "not ok 2 - $name"
    status=1
fi
exit $status
