#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Instructions of one evaluation of the native contact engine at random poses, by callgrind: figures
# that do not depend on how busy the machine is. The slowest pose may take three times the median. The
# budgets hold for the AVX2 variant, which is the best that valgrind can run on x86-64.
program=$1
poses=500
echo 1..6
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ] || ! grep -qw avx2 /proc/cpuinfo; then
    for n in 1 2 3 4 5 6; do echo "ok $n # SKIP no valgrind, or no AVX2"; done
    exit 0
fi
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
number=0
status=0

# check WHAT CONDITION
check() {
    number=$((number + 1))
    if [ "$2" -eq 1 ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        status=1
    fi
}

# each SCENE BUDGET: a dump after every evaluation holds what it took
each() {
    rm -f "$dir"/out*
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=one_pose \
        --dump-after=one_pose "$program" "$1" "$poses" 2>"$dir/log" || cat "$dir/log"
    cat "$dir"/out.* 2>/dev/null | sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' | sort -n |
        awk '$1 > 0' >"$dir/counts"
    count=$(wc -l <"$dir/counts")
    median=$(sed -n "$(((count + 1) / 2))p" "$dir/counts")
    worst=$(tail -n 1 "$dir/counts")
    echo "# $1: $count poses, median ${median:-0}, worst ${worst:-0} instructions"
    check "$1: the median of $poses poses is within $2 instructions" \
        $((count == poses && median <= $2))
    check "$1: the worst is within three times the median" \
        $((count == poses && worst <= 3 * median))
}

each foot 15000
each box 15000
each sphere 6000
exit $status
