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

echo 1..24

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

# A log of the wall clock begins with the run; its times in awk keep their microseconds
shift_log()
{
    awk -v by="$1" '{ split(substr($1, 2), t, "[.)]"); sub(/^[^ ]*/, ""); \
        printf "(%d.%s)%s\n", t[1] + by, t[2], $0 }' "$work/real/candump.log"
}
then=$(hash coman --clock free --wire ideal --stimulus "$work/real")
grep -q "^recording: ended in the same state" "$work/out"
result $? "a recording that was played ends with a comparison"
{ echo "(1700000000.000000) can0 6FF#000000000000" && shift_log 1700000000; } >"$work/wall.log"
again=$(hash coman --clock free --wire ideal --duration 1.2 --stimulus "$work/wall.log")
same "a log of the wall clock is played from its first frame on" "$then" "$again"
"$program" run coman --clock free --duration 0.01 --transport local --control none \
    --stimulus "$work/wall.log" >"$work/out" 2>"$work/err" </dev/null
grep -q "the run starts at that of its first frame, 1700000000.000" "$work/err"
result $? "and says so"
shift_log 1700000000 | cat "$work/real/candump.log" - >"$work/jump.log"
wrong 2 "a log that jumps to the wall clock is refused" \
    "jump.log:[0-9]*: found a time 1700000000 s after the start" run coman --clock free \
    --transport local --stimulus "$work/jump.log"
tac "$work/real/candump.log" >"$work/back.log"
wrong 2 "a log whose times run backwards is refused" "back.log:[0-9]*: found a frame .* earlier" \
    run coman --clock free --transport local --stimulus "$work/back.log"

# A foreign log is played to its last frame, often the one that switches off, whatever the log is
# written with: comments, lost frames, nine digits, candump -x -ta
printf '%s\n' "# mine" "(1790000000.000000001) can0 001#490D020000" "" \
    "DROPCOUNT: dropped 2 CAN frames on 'can0' socket (total drops 2)" \
    " (1790000000.020000)  can0  RX - -  001   [2]  09 50" >"$work/foreign.log"
hash coman --clock free --stimulus "$work/foreign.log" >/dev/null
grep -q "^boards: 2 frames for them" "$work/out" && grep -q "  21 ticks" "$work/out" &&
    grep -q "3 lines without a frame skipped, the first is line 1; 2 frames were lost" "$work/err"
result $? "the last frame of a foreign log is received, and lines without a frame are counted"

# A master that guards a CANopen node with remote frames and falls silent: EMCY 0x8130
{ echo "(0.010000) torso 601#2B0C100064000000" && echo "(0.020000) torso 601#2F0D100002000000"
  echo "(0.030000) torso 000#0101" && echo "(0.050000) torso 701#R1"
  echo "(0.100000) torso 701#R1" && echo "(4.000000) torso 000#0101"; } >"$work/guard.log"
hash coman-cia402 --clock free --stimulus "$work/guard.log" --record "$work/guard" >/dev/null
grep -q "^(0000000000.3[0-9]*) can0 081#3081" "$work/guard/candump.log"
result $? "remote frames of a controller are played"
grep -q "no frame for 3.9[0-9]* s before line 6; the run simulates this time" "$work/err"
result $? "a long time without a frame is named before it is simulated"

(ulimit -s 400 && "$program" run coman >"$work/out" 2>"$work/err")
test $? -eq 3 && grep -q "found a stack limit of 400 KiB" "$work/err"
result $? "a stack that is too small is refused as other limits are"

# What a client of the control socket has done is in no frame
timeout 60 "$program" run coman-compact --clock real --task hold --duration 3 --transport local \
    --control "$work/socket" --ready "$work/ready" --record "$work/asked" --quiet \
    >"$work/out" 2>"$work/err" </dev/null &
run=$!
while kill -0 $run 2>/dev/null && [ ! -e "$work/ready" ]; do
    sleep 0.05
done
timeout 20 "$program" ctl --socket "$work/socket" push LFoot force_n=0,5,0 >"$work/ctl" 2>&1
wait $run
then=$(sed -n 's/^ *state hash //p' "$work/out")
again=$(hash coman-compact --clock free --stimulus "$work/asked")
test "$then" != "$again" &&
    grep -q "warning: .*events.log has 1 request.*first: .* body LFoot pushed with 5.0 N" \
        "$work/err" &&
    grep -q "^recording: ended in another state, $then: its requests were not played" "$work/out"
result $? "requests that are not played are named before the run, and the other state after it" \
    "$then and $again"
