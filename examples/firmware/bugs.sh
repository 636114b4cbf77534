#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Builds the firmware, correct and with each of its seeded bugs, and runs every scenario with every
# one of them:
#
#   bugs.sh [-o DIR] [COMAN-HIL]      DIR for what is built and for recordings; firmware-test
#
# A line for each firmware, a column for each scenario. Exit status 0 when the correct one passes
# all and each bug is caught by its own scenario alone.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=firmware-test
if [ "${1:-}" = -o ]; then
    out=$2
    shift 2
fi
program=${1:-coman-hil}
bugs="byte_order timeout race fifo bus_off"

# what each bug must be caught by, in the order of the bugs; then what only the correct one runs
catchers="limits_the_current notices_a_silent_board reports_when_asked hears_on_a_crowded_bus
    recovers_from_bus_off"
scenarios="moves_the_leg $catchers"
slow=starts_again

mkdir -p "$out"
sh "$here/build.sh" "$out"
# shellcheck disable=SC2086
sh "$here/build.sh" "$out" $bugs

# judge NAME FIRMWARE CAUGHT-BY SCENARIO...: runs them and prints the firmware's line
status=0
judge()
{
    name=$1 firmware=$2 expected=$3 files="" line="" verdict=""
    shift 3
    for scenario in "$@"; do
        files="$files $here/scenarios/firmware_$scenario.yaml"
    done
    # shellcheck disable=SC2086
    "$program" test --program "sh '$here/run.sh' '$firmware'" --output "$out/$name" $files \
        >"$out/$name.log" 2>&1 || true
    for scenario in "$@"; do
        word=$(sed -n "s/^\([A-Za-z]*\) *firmware_$scenario\( .*\)*$/\1/p" "$out/$name.log")
        line="$line $(printf '%-9s' "${word:-none}")"
        case $word-$scenario in
        ok-"$expected" | ERROR-* | -*) verdict=bad ;;
        FAIL-"$expected" | ok-*) ;;
        *) verdict=bad ;;
        esac
    done
    printf '%-11s%s%s\n' "$name" "$line" "$verdict"
    if [ -n "$verdict" ]; then
        status=1
        grep -v '^ok ' "$out/$name.log" | sed 's/^/    /'
    fi
}

printf '%-12s%-10s%-10s%-10s%-10s%-10s%-10s%s\n' '' 'moves' 'limits' 'notices' 'reports' \
    'hears on' 'recovers' 'starts' firmware 'the leg' 'current' 'silence' 'when told' 'crowd' \
    'bus-off' 'again'
# shellcheck disable=SC2086
judge correct "$out/firmware.elf" none $scenarios $slow
# shellcheck disable=SC2086
for bug in $bugs; do
    set -- $catchers
    catchers="$* $1"
    catchers=${catchers#* }
    judge "$bug" "$out/firmware-$bug.elf" "$1" $scenarios
done
exit $status
