#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Instructions that a case of a sweep takes besides its ticks, when it runs in a range, by
# callgrind: a figure that does not depend on how busy the machine is; and the memory it takes.
# Prints TAP.
program=$1
# 10 million with a store of parsed files, which saved 2 % of a case and was dropped
budget=22000000
memory=40000    # kB
echo 1..2
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
cp "$HIL_SOURCE_DIR"/examples/sweep/*.yaml "$dir" && cd "$dir" || exit 1
sed -i 's/^samples: .*/samples: 3/' sweep.yaml
sed -i 's/^duration_s: .*/duration_s: 0.02/; s/\[-0.4, 0.4\]/[-0.4, 0.4], within_s: 0.01/' \
    squat.yaml
"$program" test --plan sweep.yaml --output a.plan >/dev/null || exit 1
status=0

# instructions FUNCTION: of the three cases, inside of it
instructions() {
    rm -rf a.plan.results out.*
    valgrind --tool=callgrind --callgrind-out-file=out.%p --toggle-collect="$1" \
        "$program" test --case 1-3 --jobs 1 a.plan >log 2>&1 || cat log >&2
    cat out.* | sed -n 's/^totals: \([0-9][0-9]*\).*/\1/p' |
        awk '{ n += $1 > 0; sum += $1 } END { print n == 3 ? sum : 0 }'
}

name="a case of a range takes at most $budget instructions besides its ticks"
if ! command -v valgrind >/dev/null || [ "$(uname -m)" != x86_64 ]; then
    echo "ok 1 - $name # SKIP no valgrind"
else
    all=$(instructions scenario_run)
    ticks=$(instructions loop_run)
    start=$(((all - ticks) / 3))
    echo "# $start instructions"
    if [ "$ticks" -gt 0 ] && [ "$start" -gt 0 ] && [ "$start" -le "$budget" ]; then
        echo "ok 1 - $name"
    else
        echo "not ok 1 - $name"
        status=1
    fi
fi

name="a case takes at most $memory kB"
rm -rf a.plan.results
used=$(/usr/bin/python3 -c 'import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)' "$program" test --case 1 a.plan)
echo "# ${used:=0} kB"
if [ "$used" -gt 0 ] && [ "$used" -le "$memory" ]; then
    echo "ok 2 - $name"
else
    echo "not ok 2 - $name"
    status=1
fi
exit $status
