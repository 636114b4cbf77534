#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: guard_vcan.sh GUARD COMAN-HIL
# The program under the guard on SocketCAN, on a kernel that has CAN (run it through
# tests/bus/uml/run.sh): which system calls the loop makes in which phase. Page faults are counted
# and not judged: what the guest's kernel does with pages is not what a machine's does. Prints
# TAP.
set -u
guard=$1
program=$2
faults=count
# shellcheck source=/dev/null
. "$(dirname "$0")/guard_lib.sh"

# a controller as a process of its own, when the simulator listens on all buses
task()
{
    until [ "$(cat /proc/net/can/rcvlist_* | grep -o '^ *can[0-4] ' | sort -u | wc -l)" = 5 ]; do
        sleep 0.05
    done
    exec "$program" task squat "$rigs/coman.yaml" "$@" --quiet >"$work/task" 2>&1 </dev/null
}

echo 1..4

task --clock lockstep &
guarded "$rigs/coman.yaml" --transport socketcan --clock lockstep --ticks 100 --wire ideal
kill $! 2>/dev/null
wait $!
verdict "lockstep on vcan: batches of frames, and the sleep for a STEP" only \
    ppoll recvmmsg sendmmsg getsockopt clock_gettime

task &
guarded "$rigs/coman.yaml" --transport socketcan --clock real --ticks 300 --wire ideal \
    --record "$work/record"
kill $! 2>/dev/null
wait $!
verdict "real time on vcan, recorded: batches of frames, and sleeps for frames and deadlines" only \
    clock_nanosleep ppoll recvmmsg sendmmsg getsockopt clock_gettime

task &
guarded "$rigs/coman.yaml" --transport socketcan --clock real --ticks 300 --wire wire
kill $! 2>/dev/null
wait $!
verdict "the same paced like a wire" only clock_nanosleep recvmmsg sendmmsg \
    getsockopt clock_gettime

rm -rf "$work/record"
# said WORDS: waits until the run has said so
said()
{
    until grep -q "$1" "$work/err" 2>/dev/null; do sleep 0.05; done
}
# one bus and long ticks, which leave a slow guest's only processor the time for what changes the
# interface
cp -r "$rigs/.." "$work/config"
printf '%s\n' 'extends: hyq-leg.yaml' 'name: slow' 'tick_s: 0.05' 'substep_s: 0.001' \
    'tasks: {servo: {command_period_s: 0.05}}' >"$work/config/rigs/slow.yaml"
{
    until [ -e "$work/record/signals.csv" ]; do sleep 0.05; done
    ip link set can0 down
    said 'can0 is down'
    ip link set can0 up
    said 'can0 is up'
    ip link del can0
    said 'can0 is gone'
    pkill -x -TERM coman-hil
} &
guarded "$work/config/rigs/slow.yaml" --transport socketcan --clock real --wire ideal \
    --record "$work/record" --record-period 50
kill $! 2>/dev/null
wait $!
ip link add dev can0 type vcan && ip link set can0 up
lost_and_found()
{
    grep -q 'can0 is down' "$work/err" && grep -q 'can0 is up' "$work/err" &&
        grep -q 'can0 is gone' "$work/err" &&
        only clock_nanosleep ppoll recvmmsg sendmmsg getsockopt clock_gettime
}
verdict "an interface goes down, comes up and vanishes" lost_and_found
exit $((failures > 0))
