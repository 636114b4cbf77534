#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# COMAN in lockstep with everything broken at random, two runs side by side in their own processes,
# one of them with less of the machine and recording: no rule is broken, and both agree to the last
# bit. SOAK=full: an hour; SOAK=N: N simulated seconds. Prints TAP.
# usage: lockstep.sh SOAK_LOCKSTEP SECONDS
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
seconds=$2 limit=280 # of the wall's, a run
case "${SOAK:-}" in
full) seconds=3600 limit=1700 ;;
[1-9]*) seconds=$SOAK limit=1700 ;;
esac
number=0
bad=0

result() { # GOOD NAME
    number=$((number + 1))
    if [ "$1" = 0 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        bad=1
        sed 's/^/# /' "$work"/*.err
        diff "$work/plain.out" "$work/recorded.out" | head -20 | sed 's/^/# /'
    fi
}

# hash FILE: of the whole run
hash() {
    sed -n 's/^soak: .* hash \([0-9a-f]*\)$/\1/p' "$1"
}

echo 1..3
nice -n 5 timeout $limit "$program" $seconds 1 "$work/recording" \
    >"$work/recorded.out" 2>"$work/recorded.err" &
timeout $limit "$program" $seconds 1 >"$work/plain.out" 2>"$work/plain.err"
plain=$?
wait $!
recorded=$?
[ $plain = 0 ]
result $? "$seconds simulated seconds of faults break no rule"
[ $recorded = 0 ] && [ -s "$work/recording/candump.log" ]
result $? "nor do they while a recorder runs and the machine is busy"
[ -n "$(hash "$work/plain.out")" ] &&
    [ "$(hash "$work/plain.out")" = "$(hash "$work/recorded.out")" ]
result $? "both runs agree in every frame and every state"
sed 's/^/# /' "$work/plain.out"
exit $bad
