#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: probe_cost.sh WITH WITHOUT
# What the tracepoints cost that nobody watches: a tick of the same loop with and without them, in
# instructions by callgrind. A tick hits nine. Prints TAP.
ticks=20
budget=27 # instructions: a nop each, and up to two to bring an argument where it can be described
echo 1..1
if ! command -v valgrind >/dev/null; then
    echo "ok 1 # SKIP valgrind is not installed"
    exit 0
fi

count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=loop_run \
        "$1" nothing 2>&1 |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}

with=$(count "$1")
without=$(count "$2")
cost=$(((${with:-1000000} - ${without:-0}) / ticks))
name="nine probes cost a tick at most $budget instructions"
if [ "${without:-0}" -gt 0 ] && [ $cost -le $budget ]; then
    echo "# $cost instructions"
    echo "ok 1 - $name"
else
    echo "# with ${with:-none}, without ${without:-none} in $ticks ticks"
    echo "not ok 1 - $name"
    exit 1
fi
