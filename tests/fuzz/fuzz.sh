#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs fuzz targets of a build of the preset "fuzz", one a processor, and prints a line on each.
# usage: fuzz.sh BUILD [TARGET|all [SECONDS]]
# What is learned and found stays in BUILD/fuzz/TARGET: corpus/, log, and crash-*, timeout-*, oom-*.
set -u
build=${1:?usage: fuzz.sh BUILD [TARGET|all [SECONDS]]}
target=${2:-all}
seconds=${3:-60}
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$build" && pwd)

number() { # of the statistics at the end of a log
    sed -n "s/^stat::$1: *//p" log
}

if [ "${4:-}" != line ]; then
    printf '%-16s %10s %8s %8s %8s %8s  %s\n' target executions exec/s edges features cpu/s findings
fi
if [ "$target" = all ]; then
    cd "$build/tests" || exit 3
    find . -maxdepth 1 -name 'fuzz_*' -type f -perm -u+x | sed 's|./fuzz_||' | sort |
        xargs -P "$(nproc)" -I TARGET sh "$here/fuzz.sh" "$build" TARGET "$seconds" line
    exit
fi

program=$build/tests/fuzz_$target
if [ ! -x "$program" ]; then
    echo "fuzz.sh: found no target \"$target\" in $build/tests" >&2
    exit 2
fi
folder=$build/fuzz/$target
mkdir -p "$folder/corpus"
cd "$folder" || exit 3
dictionary=$here/dictionary/$target.dict
times >cpu # of the programs until now, then with this one
set -- corpus
[ ! -d "$here/corpus/$target" ] || set -- "$@" "$here/corpus/$target"
[ ! -f "$dictionary" ] || set -- "-dict=$dictionary" "$@"
"$program" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=1024 -malloc_limit_mb=512 \
    -print_final_stats=1 "$@" >log 2>&1
status=$?
times >>cpu
cpu=$(awk '
    { for (i = 1; i <= 2; i++) { split($i, part, /[ms]/); t[NR] += 60 * part[1] + part[2] } }
    END { printf "%.0f", t[4] - t[2] }' cpu)
last=$(grep -a 'cov: ' log | tail -n 1)
findings=$(find . -maxdepth 1 -type f \( -name 'crash-*' -o -name 'timeout-*' -o -name 'oom-*' \
    -o -name 'leak-*' \) | tr '\n' ' ')
if [ $status -ne 0 ] || [ -n "$findings" ]; then
    status=1
    findings="${findings:-none kept}(see $folder/log)"
fi
printf '%-16s %10s %8s %8s %8s %8s  %s\n' "$target" "$(number number_of_executed_units)" \
    "$(number average_exec_per_sec)" "$(echo "$last" | sed 's/.*cov: \([0-9]*\).*/\1/')" \
    "$(echo "$last" | sed 's/.*ft: \([0-9]*\).*/\1/')" "$cpu" "${findings:-none}"
exit $status
