#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Builds the firmware, correct and with each of its seeded bugs; runs every scenario with the
# correct one, and with each bug the scenario that must catch it:
#
#   bugs.sh [-o DIR] [-j JOBS] [COMAN-HIL]
#                             DIR for what is built and for recordings, firmware-test by default;
#                             JOBS runs at a time, one a processor by default
#
# A line for each run. Exit status 0 when the correct firmware passes all and each bug is caught.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=firmware-test
jobs=$(nproc)
while getopts o:j: option; do
    case $option in
    o) out=$OPTARG ;;
    j) jobs=$OPTARG ;;
    *)
        sed -n 's/^#   //p' "$0" >&2
        exit 2
        ;;
    esac
done
shift $((OPTIND - 1))
program=${1:-coman-hil}

# each bug and the scenario that must catch it
bugs="byte_order:limits_the_current timeout:notices_a_silent_board race:reports_when_asked
    fifo:hears_on_a_crowded_bus bus_off:recovers_from_bus_off swapped:moves_the_leg
    position:moves_the_leg range:keeps_to_its_range integral:limits_the_current
    stranger:waits_for_every_board slow:notices_a_silent_board not_idle:notices_a_silent_board
    never_enabled:notices_a_silent_board stop:stays_stopped fault_bits:stays_safe_after_a_fault"

mkdir -p "$out"
sh "$here/build.sh" "$out"
for bug in $bugs; do
    sh "$here/build.sh" "$out" "${bug%:*}"
done

# run NAME FIRMWARE SCENARIO...: runs scenarios and keeps what is printed
run()
{
    name=$1 firmware=$2 files=""
    shift 2
    for scenario in "$@"; do
        files="$files $here/scenarios/firmware_$scenario.yaml"
    done
    # shellcheck disable=SC2086
    "$program" test --jobs "$jobs" --program "sh '$here/run.sh' '$firmware'" \
        --output "$out/$name" $files >"$out/$name.log" 2>&1 </dev/null || true
}

# judge NAME EXPECTED SCENARIO: prints the verdict, and once the log when it is not as expected
status=0
shown=""
judge()
{
    word=$(sed -n "s/^\([A-Za-z]*\) *firmware_$3\( .*\)*$/\1/p" "$out/$1.log")
    if [ "$word" = "$2" ]; then
        printf '%-14s %-30s %s\n' "$1" "$3" "$word"
    else
        printf '%-14s %-30s %s, expected %s\n' "$1" "$3" "${word:-nothing}" "$2"
        [ "$shown" = "$1" ] || sed 's/^/    /' "$out/$1.log"
        shown=$1 status=1
    fi
}

scenarios=$(cd "$here/scenarios" && echo firmware_*.yaml | sed 's/firmware_//g; s/\.yaml//g')
# shellcheck disable=SC2086
run correct "$out/firmware.elf" $scenarios
for scenario in $scenarios; do
    judge correct ok "$scenario"
done

running=0
for bug in $bugs; do
    run "${bug%:*}" "$out/firmware-${bug%:*}.elf" "${bug#*:}" &
    running=$((running + 1))
    [ $((running % jobs)) -ne 0 ] || wait
done
wait
# A busy machine may starve QEMU so that a run differs from its repeat: no verdict, so once more
for bug in $bugs; do
    grep -q ^FAIL "$out/${bug%:*}.log" ||
        run "${bug%:*}" "$out/firmware-${bug%:*}.elf" "${bug#*:}"
done
for bug in $bugs; do
    judge "${bug%:*}" FAIL "${bug#*:}"
done
exit $status
