#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: dynamics_instructions.sh DYNAMICS-COUNT MODULE
# Instructions of one evaluation of COMAN's accelerations by callgrind: a figure that does not
# depend on how busy the machine is. The numeric implementation has a budget, a tenth over the
# 27,843 that it took when that was set (x86-64, gcc 12, -O3); what else there is, is measured
# beside it. Prints TAP.
program=$1
module=$2
robot=${HIL_SOURCE_DIR:?}/config/robots/coman.yaml

# total ENGINE N [MODULE]: instructions of a whole program with N evaluations, nothing when it fails
total() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null \
        "$program" "$robot" "$@" 2>&1 >/dev/null |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}

# each ENGINE [MODULE]: of one evaluation; the difference of two runs leaves the rest of the program
# out, and 64 is the number of states
each() {
    engine=$1
    shift
    few=$(total "$engine" 64 "$@")
    many=$(total "$engine" 192 "$@")
    echo $(((${many:-0} - ${few:-0}) / 128))
}

number=0
failures=0
# budget ENGINE INSTRUCTIONS
budget() {
    number=$((number + 1))
    found=$(each "$1")
    echo "# $1: $found instructions"
    if [ "$found" -gt 0 ] && [ "$found" -le "$2" ]; then
        echo "ok $number - $1 takes at most $2 instructions"
    else
        echo "not ok $number - $1 takes at most $2 instructions"
        failures=$((failures + 1))
    fi
}

echo 1..1
if ! command -v valgrind >/dev/null; then
    echo "ok 1 # SKIP valgrind is not installed"
    exit 0
fi
budget generic 30600
for engine in generated Simbody MuJoCo; do
    if "$program" "$robot" $engine 1 "$module" 2>/dev/null; then
        echo "# $engine: $(each $engine "$module") instructions"
    fi
done
exit $((failures > 0))
