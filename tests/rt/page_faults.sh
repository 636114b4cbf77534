#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: page_faults.sh COMAN-HIL RIG CLOCK
# Not one page fault of the loop's thread, from the first tick on: over 100,000 ticks of full
# traffic on buses in wire mode with a recording, or over ten seconds of real time with memory
# locked and not locked. On a busy machine a controller in real time may be too late for its robot,
# which ends the run early: that is said, and faults are judged over the ticks that there were.
# Prints TAP.
set -u
program=$1
rig=$2
clock=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
number=0
failures=0

# rigs whose tasks go on for more than 100 s
mkdir -p "$work/config/rigs"
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work/config/"
for file in "$HIL_SOURCE_DIR"/config/rigs/*.yaml; do
    sed 's/cycles: [0-9]*/cycles: 30/; s/hold_s: [0-9.]*/hold_s: 110.0/' "$file" \
        >"$work/config/rigs/$(basename "$file")"
done
cd "$work/config/rigs" || exit 1
sed 's/lock_memory: true/lock_memory: false/' "$rig.yaml" >unlocked.yaml

# run NAME RIG ARGUMENT...
run()
{
    local name=$1 rig=$2
    shift 2
    "$program" run "$rig.yaml" --transport local --wire wire --record "$work/$name" --quiet \
        --control none "$@" >"$work/$name.out" 2>"$work/$name.err" </dev/null
    echo $? >"$work/$name.status"
}

# ended NAME: as it should, or in real time by the task's failure
ended()
{
    case $(cat "$work/$1.status") in
    0) ;;
    1) [ "$clock" = real ] && grep 'task squat failed' "$work/$1.err" | sed 's/^/# /' ;;
    *) return 1 ;;
    esac
}

# judge NAME TICKS TITLE
judge()
{
    local found ticks
    found=$(sed -n 's/.*"page_faults": \([0-9]*\).*/\1/p' "$work/$1/summary.json" 2>/dev/null)
    ticks=$(sed -n 's/^ *\([0-9]*\) ticks, .*/\1/p' "$work/$1.out")
    number=$((number + 1))
    if ended "$1" && [ "$found" = 0 ] && [ "${ticks:-0}" -ge "$2" ]; then
        echo "ok $number - $3: $ticks ticks, no page fault"
    else
        echo "not ok $number - $3: ${ticks:-no} ticks, ${found:-no number of} page faults"
        tail -n 5 "$work/$1.out" "$work/$1.err" | sed 's/^/# /'
        failures=$((failures + 1))
    fi
    rm -rf "${work:?}/$1"
}

if [ "$clock" = real ]; then
    echo 1..2
    HIL_BINARY_DIR=$(dirname "$program") /usr/bin/python3 \
        "$HIL_SOURCE_DIR/tests/service/page_watchers.py" "$work/locked.err" 3 >"$work/watched" &
    run locked "$rig" --clock real --task squat --duration 10 --http 0 &
    run unlocked unlocked --clock real --task squat --duration 10
    wait
    sed 's/^/# of three pages: /' "$work/watched"
    judge locked 1 "real time, memory locked, three pages open"
    judge unlocked 1 "real time, memory not locked"
else
    echo 1..1
    task=squat
    [ "$rig" = grasp ] && task=grasp
    run "$clock" "$rig" --clock "$clock" --task $task --ticks 100000
    judge "$clock" 100000 "$rig, $clock"
fi
exit $((failures > 0))
