#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# How late the loop wakes up beside cyclictest (rt-tests), in real time: half of the time both at
# once, each on a processor of its own, which they change with every run; half of the time in turns
# on the same processor. Same priority, interval, locked memory and idle states. COMAN squats all
# the while, its controller on the other side of local buses. What is asserted is arithmetic: every
# wake-up is in the histograms. The latencies are measured, and the last line sums them up.
#
# Usage: realtime.sh SOAK_REALTIME [SECONDS [DIRECTORY]]; 12 s, with SOAK=full 600. Prints TAP.
set -u
program=$1
seconds=${2:-12}
[ "${SOAK:-}" = full ] && seconds=${2:-600}
directory=${3:-}
if [ -z "$directory" ]; then
    directory=$(mktemp -d)
    trap 'rm -rf "$directory"' EXIT
fi
mkdir -p "$directory" || exit 3
rm -f "$directory"/*.ours "$directory"/*.cyclictest
echo 1..2
if ! command -v cyclictest >/dev/null; then
    echo "ok 1 - histograms # SKIP no cyclictest: install rt-tests"
    echo "ok 2 - comparison # SKIP no cyclictest: install rt-tests"
    exit 0
fi

# the scheduling class that both can have
priority=80
policy=fifo
if ! chrt -f $priority true 2>/dev/null; then
    priority=0
    policy=other
fi
read -r -a processors <<<"$(taskset -cp $$ | sed 's/.*: //; s/,/ /g' | awk '{
    for (i = 1; i <= NF; i++) {
        n = split($i, r, "-")
        for (c = r[1]; c <= r[n]; c++) printf "%d ", c
    } }')"
first=${processors[0]}
second=${processors[1]:-$first}

ours() { # NAME CPU SECONDS
    timeout $(($3 + 30)) "$program" "$3" $priority "$2" "$directory/$1.ours"
}

theirs() { # NAME CPU SECONDS
    timeout $(($3 + 30)) cyclictest --quiet --mlockall --policy=$policy --priority=$priority \
        --interval=1000 \
        --affinity="$2" --histogram=200000 --duration="$3" >"$directory/$1.cyclictest" 2>/dev/null
}

slice=$((seconds / 12))
[ $slice -lt 1 ] && slice=1
[ $slice -gt 30 ] && slice=30
together=$((seconds / 2 / slice))
alternating=$((seconds / 4 / slice))
[ $together -lt 2 ] && together=2
[ $alternating -lt 2 ] && alternating=2
status=0

for ((i = 0; i < together; i++)); do
    theirs together-$i "$second" $slice &
    ours together-$i "$first" $slice || status=1
    wait $! || status=1
    swap=$first first=$second second=$swap
done
for ((i = 0; i < alternating; i++)); do
    theirs alternating-$i "$first" $slice || status=1
    ours alternating-$i "$first" $slice || status=1
    swap=$first first=$second second=$swap
done
if [ $status = 0 ]; then
    runs=$((together + alternating))
    echo "ok 1 - every tick and every wake-up of $runs runs is in the histograms"
else
    echo "not ok 1 - a run failed, or its histograms disagree with its counts"
fi
if /usr/bin/python3 "$(dirname "$0")/realtime.py" "$directory" >"$directory/comparison.txt" &&
    [ -s "$directory/histogram.csv" ]; then
    echo "ok 2 - the comparison holds all of them"
else
    echo "not ok 2 - the comparison holds all of them"
    status=1
fi
echo "# $policy, priority $priority, load $(cut -d' ' -f1-3 /proc/loadavg)"
sed 's/^/# /' "$directory/comparison.txt"
[ -n "${3:-}" ] &&
    echo "# in $directory: comparison.txt, histogram.csv"
exit $status
