#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: guard_bites.sh GUARD VICTIM LAZY-VICTIM
# The guard catches each thing that a real-time loop may not do, names it, the phase and the tick,
# and leaves alone what may be done. Prints TAP.
set -u
guard=$1
victim=$2
lazy=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
number=0
failures=0
cd "$work" || exit 1
ulimit -c 0

# verdict GOOD NAME
verdict() {
    number=$((number + 1))
    if [ "$1" = 1 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        sed 's/^/# /' log
        failures=$((failures + 1))
    fi
}

# run PROGRAM WAY: status, and the guard's words in log
run() {
    rm -f log
    {
        (LD_PRELOAD=$guard RT_GUARD_LOG=$work/log RT_GUARD_FAULTS=forbid exec "$1" "$2")
        status=$?
    } >out 2>err
    touch log
}

# caught WAY TEXT FUNCTION: aborts with these words, and FUNCTION in the backtrace
caught() {
    run "$victim" "$1"
    good=0
    [ $status = 134 ] && grep -q "VIOLATION in phase plant of tick 7: $2" log &&
        grep -q "^  $3+" log && good=1
    verdict $good "catches_$1"
}

echo 1..11
run "$victim" nothing
good=0
[ $status = 0 ] && grep -q 'clock free, ticks 20, probes 182' log && good=1
verdict $good a_loop_that_does_nothing_wrong_runs_to_its_end

caught malloc 'calls malloc' victim_plant
caught free 'calls free' victim_plant
caught digits 'calls malloc' victim_plant
caught mutex 'calls pthread_mutex_lock' victim_plant
caught open 'calls open' victim_plant
caught write 'system call write (1), first argument 1' victim_plant
caught instruction 'system call getppid' victim_plant
caught fault '1 page faults' loop_run

run "$victim" bystander
good=0
[ $status = 0 ] && grep -q 'ticks 20' log && good=1
verdict $good what_other_threads_do_is_their_affair

run "$lazy" nothing
good=0
[ $status = 134 ] && grep -q 'functions are looked up at their first call' log && good=1
verdict $good catches_a_program_that_looks_functions_up_in_the_tick
exit $((failures > 0))
