#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# COMAN squats in lockstep on buses in wire mode, SECONDS of virtual time (5 by default); the time
# of every frame in the recording must be that of the reference encoder. iCub's boards answer 100 us
# after a command.
# Usage: wire_times.sh COMAN-HIL WIRE_LOG [SECONDS]
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
echo 1..2
"$1" run "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --wire wire --clock lockstep --transport local \
    --task squat --duration "${3:-5}" --record "$dir/record" --quiet >"$dir/log" 2>&1
status=$?
if [ $status -eq 0 ]; then
    echo "ok 1 - COMAN squats over wires"
else
    sed 's/^/# /' "$dir/log"
    echo "not ok 1 - COMAN squats over wires"
fi
if "$2" 1000 100 0x6f0 0x6ff <"$dir/record/candump.log"; then
    echo "ok 2 - every frame ends when the reference encoder says"
else
    echo "not ok 2 - every frame ends when the reference encoder says"
    status=1
fi
exit $status
