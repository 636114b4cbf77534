#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: replay.sh COMAN-HIL
# A recorded controller fed to the boards again: the same frames at the same ticks give the same
# state hash. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"

# hash ARGUMENT...: the state hash at the end of a run
hash()
{
    "$program" run "$@" --transport local --control none --quiet >"$work/out" 2>"$work/err" \
        </dev/null || return
    sed -n 's/^ *state hash //p' "$work/out"
}

# same NAME HASH HASH: they are the same, and there is one
same()
{
    test -n "$2" && test "$2" = "$3"
    result $? "$1" "$2 and $3"
}

# wrong STATUS NAME TEXT ARGUMENT...
wrong()
{
    local expected=$1 name=$2 text=$3
    shift 3
    "$program" "$@" >"$work/out" 2>"$work/err" </dev/null
    local status=$?
    test $status -eq "$expected" && grep -q -- "$text" "$work/err"
    result $? "$name" "status $status"
}

echo 1..14

for rig in coman coman-fd coman-foc coman-compact; do
    for wire in ideal wire; do
        [ $wire = ideal ] && [ $rig != coman ] && continue
        then=$(hash $rig --clock lockstep --task squat --duration 2.3 --wire $wire \
            --record "$work/$rig-$wire")
        again=$(hash $rig --clock lockstep --wire $wire --stimulus "$work/$rig-$wire")
        same "$rig in lockstep, $wire buses: the same hash" "$then" "$again"
    done
done

same "what was recorded in lockstep plays in free run" "$then" \
    "$(hash $rig --clock free --wire wire --stimulus "$work/$rig-wire/candump.log")"

then=$(hash coman --clock real --task squat --duration 1.2 --wire ideal --record "$work/real")
same "what was recorded in real time plays in free run, with the same hash" "$then" \
    "$(hash coman --clock free --wire ideal --stimulus "$work/real")"

# One axis gets another voltage for ten ticks: the controller's frames are what moves the robot
awk '/6F0#/ { n++ } n > 1500 && n <= 1510 { sub(/ can1 001#72..../, " can1 001#72E803") } 1' \
    "$work/coman-ideal/candump.log" >"$work/changed.log"
then=$(hash coman --clock lockstep --wire ideal --stimulus "$work/coman-ideal")
again=$(hash coman --clock lockstep --wire ideal --stimulus "$work/changed.log")
test -n "$again" && test "$then" != "$again" && ! cmp -s "$work/changed.log" \
    "$work/coman-ideal/candump.log"
result $? "other commands, another hash"

cmp -s <(hash coman --clock free --wire ideal --duration 0.5 --stimulus "$work/coman-ideal") \
    <(hash coman --clock free --wire ideal --duration 0.5 --task squat)
result $? "a part of it, too, is the run of then"

wrong 2 "a task beside it is refused" "expected one" run coman --clock free --transport local \
    --task squat --stimulus "$work/real"
wrong 2 "a log without STEP does not drive lockstep" "no STEP frame" run coman --clock lockstep \
    --transport local --stimulus "$work/real"
echo "(0.000000) can9 123#00" >"$work/other.log"
wrong 2 "a frame on an interface that the rig has not is refused" \
    "other.log:1: found a frame on can9" run coman --clock free --transport local \
    --stimulus "$work/other.log"
echo "(0.000000) can0 6FF#000000000000" >"$work/none.log"
wrong 2 "a log without a controller is refused" "no frame of a controller" run coman --clock free \
    --transport local --stimulus "$work/none.log"
wrong 2 "replay needs a page or an interface" "neither --http nor --onto" replay "$work/real"
