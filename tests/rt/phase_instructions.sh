#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: phase_instructions.sh COMAN-HIL
# Each phase of a tick of COMAN's squat against its budget, as coman-hil help rt prints it, in
# instructions by callgrind: a figure that does not depend on how busy the machine is. Prints TAP.
program=$1
ticks=2000
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
phases="receive boards plant sensors transmit publish"
echo 1..6
if ! command -v callgrind_annotate >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    for n in 1 2 3 4 5 6; do echo "ok $n # SKIP no valgrind"; done
    exit 0
fi

"$program" help rt >"$dir/topic"
valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=loop_run "$program" run \
    "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --wire wire --clock lockstep --transport local \
    --task squat --ticks $ticks --control none --quiet >/dev/null 2>"$dir/log" || cat "$dir/log" >&2
callgrind_annotate --inclusive=yes --threshold=100 "$dir/out" >"$dir/annotated" 2>/dev/null

# function FILE:NAME: instructions with all that it calls
function_total()
{
    sed -n "s|^ *\([0-9,]*\) .*/$1 \[.*|\1|p" "$dir/annotated" | head -n 1 | tr -d ,
}

number=0
failures=0
for phase in $phases; do
    case $phase in
    boards) name=[a-z_]*.c:machine_control ;;
    plant) name=[a-z_]*.c:machine_plant ;;
    sensors) name=[a-z_]*.c:machine_sample ;;
    *) name=loop.c:loop_$phase ;;
    esac
    total=$(function_total "$name")
    budget=$(sed -n "s/^  $phase  *\([0-9][0-9]*\)  *[0-9.]* %.*/\1/p" "$dir/topic")
    number=$((number + 1))
    each=$((${total:-0} / ticks))
    if [ $each -gt 0 ] && [ $each -le "${budget:-0}" ]; then
        echo "ok $number - $phase takes $each instructions of ${budget:-no budget}"
    else
        echo "not ok $number - $phase takes $each instructions of ${budget:-no budget}"
        failures=$((failures + 1))
    fi
done
exit $((failures > 0))
