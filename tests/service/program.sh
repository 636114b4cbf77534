#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A program under test as the host of a scenario, and the CAN sockets that examples/firmware gives
# it: it drives the run, hears and is heard in the same tick in every run, ends with the run; one
# that ends or hangs is told from one that fails. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
here=$HIL_SOURCE_DIR/tests/service
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$here/tap.sh"
tap_show="$work/out $work/results/*/program.log"

# scenario NAME [SECONDS]: a scenario of 60 ms in which another node asks at 30 ms
scenario()
{
    {
        printf 'name: %s\ndescription: A program is the host.\nrig: coman-foc-leg\n' "$1"
        printf 'clock: lockstep\nhost: program\nduration_s: 0.06\nwall_limit_s: %s\n' "${2:-60}"
        printf 'stimuli:\n  - {at_s: 0.03, frame: {bus: left_shank, id: 0x7f0}}\n'
        printf 'expectations:\n  - {name: it answers in the tick, within_s: 0.06,\n'
        printf '     frame: {bus: left_hip, id: 0x7f1, data: "1f000000"}}\n'
    } >"$work/$1.yaml"
}

# run STATUS COMMAND SCENARIO...
run()
{
    local expected=$1 command=$2
    shift 2
    timeout -k 5 100 "$program" test ${command:+--program "$command"} \
        --output "$work/results" "$@" >"$work/out" 2>&1 </dev/null
    [ $? -eq "$expected" ]
}

# gone PID: it has ended, whether its parent has noticed or not
gone()
{
    for _ in $(seq 100); do
        grep -qs '^State:[[:space:]]*[RSDTt]' "/proc/$1/status" || return 0
        sleep 0.05
    done
    return 1
}

says() { grep -q -e "$1" "$work/out"; }

if ! "${CC:-cc}" -O1 -Wall -Wextra -Werror -shared -fPIC -o "$work/socketcan.so" \
    "$HIL_SOURCE_DIR/examples/firmware/socketcan.c" -lpthread 2>"$work/out"; then
    result 1 "socketcan.so is built"
    echo "1..$number"
    exit 1
fi
host="LD_PRELOAD=$work/socketcan.so exec /usr/bin/python3 $here/program_host.py"

scenario answers
run 0 "$host" "$work/answers.yaml"
result $? "a program drives a run through CAN sockets"

# the tick in which a stimulus is heard is that of every run, however the threads are scheduled
cp "$work/answers.yaml" "$work/again.yaml"
values=$(seq -s ', ' 12)
sed -i "s/^name: .*/name: again\nparameters: {N: {values: [$values]}}/" "$work/again.yaml"
sed -i 's/^description: .*/&\nseed: ${N}/' "$work/again.yaml"
run 0 "$host" --jobs 4 "$work/again.yaml" && says "12 passed, 0 failed"
result $? "what another node sends is heard in the same tick in twelve runs"

scenario fails
sed -i 's/1f000000/1e000000/' "$work/fails.yaml"
run 1 "$host" "$work/fails.yaml" && says "FAIL *fails" &&
    grep -q stepping "$work/results/fails/program.log"
result $? "what a program printed in a run that failed is beside its recording"

run 1 "$host leave 10" "$work/answers.yaml" && says "ERROR *answers" &&
    says "the program ended before the run, with status 3"
result $? "a program that ends before the run is told from one that fails"

run 1 "kill -SEGV \$\$" "$work/answers.yaml" && says "the program died of: Segmentation fault"
result $? "so is one that crashes"

scenario hangs 3
run 1 "exec /usr/bin/python3 $here/program_host.py linger $work/pids" "$work/hangs.yaml" &&
    says "no STEP has come for 3 s" && gone "$(cat "$work/pids")"
result $? "one that hangs is ended with its run"

run 2 "" "$work/answers.yaml" && says "answers.yaml:1:1: found host: program"
result $? "without --program the scenario is refused"

scenario free
sed -i 's/^clock: .*/clock: free/' "$work/free.yaml"
run 2 "$host" "$work/free.yaml" && says "found host: program without clock: lockstep"
result $? "without lockstep too"

echo "1..$number"
exit $failed
