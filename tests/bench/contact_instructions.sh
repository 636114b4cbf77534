#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# contact_instructions.sh CONTACT_COUNT CONTACT_WORK [POSES]
# Instructions of one evaluation of the native contact engine, by callgrind: figures that do not
# depend on how busy the machine is. The slowest of all random poses may take three times the
# median. As callgrind is too slow for a million poses, a build that counts basic blocks finds those
# with the most work; callgrind then counts the instructions of these and of some spread over all.
# What no pose can have exceeded is the most blocks times the most instructions that a block took on
# average. The budgets hold for the AVX2 variant, which is the best that valgrind can run on x86-64.
count=$1
work=$2
poses=${3:-5000}
each=16
echo 1..14
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ] ||
    ! grep -qw avx2 /proc/cpuinfo ||
    [ ! -x "$work" ]; then
    n=0
    while [ $n -lt 14 ]; do n=$((n + 1)); echo "ok $n # SKIP no valgrind, no AVX2, or not GCC"; done
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

# instructions INDEX ENGINE SEED...: a line each; a dump after every evaluation holds what it took
instructions() {
    rm -f "$dir"/out*
    valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=one_pose \
        --dump-after=one_pose "$count" "$@" 2>"$dir/log" || cat "$dir/log" >&2
    n=1
    while [ -f "$dir/out.$n" ]; do
        sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' "$dir/out.$n"
        n=$((n + 1))
    done | awk '$1 > 0'
}

# scene INDEX NAME BUDGET
scene() {
    "$work" "$1" "$poses" $each >"$dir/work" || echo "$2: no work counted"
    # shellcheck disable=SC2046
    instructions "$1" native $(cut -d' ' -f2 "$dir/work") >"$dir/counts"
    cut -d' ' -f1 "$dir/work" | paste - "$dir/counts" >"$dir/both"
    eval "$(awk -v each=$each '
        NR <= each { spread[NR] = $2 }
        { if ($2 > worst) worst = $2; if ($1 > most) most = $1
          if ($2 / $1 > dense) dense = $2 / $1; if (NR == 1 || $2 / $1 < thin) thin = $2 / $1 }
        END {
            if (NR == 2 * each)
                printf "median=%d worst=%d bound=%.0f most=%d thin=%.1f dense=%.1f",
                    spread[each / 2], worst, dense * most + 0.5, most, thin, dense
            else
                print "median=0 worst=0 bound=0 most=0 thin=0 dense=0"
        }' "$dir/both")"
    # shellcheck disable=SC2154
    echo "# $2: $poses poses, instructions: median $median, worst counted $worst," \
        "none above $bound ($most blocks of $thin to $dense)"
    check "$2: the median is within $3 instructions" $((median > 0 && median <= $3))
    check "$2: the worst is within three times the median" $((bound > 0 && bound <= 3 * median))
}

scene 0 "foot on half-space" 12000
scene 1 "box on half-space" 12000
scene 2 "box on table" 24000
scene 3 "sphere on box" 6000
scene 4 "five bodies" 45000
scene 5 "foot on terrain of 108" 240000
scene 8 "foot on terrain of 99,372" 220000
exit $status
