#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs the rig in real time on the interface can0, which must exist, and asks which boards are
# there.
set -eu
candump -n 2 -T 20000 can0,7C0:7FC >frames.txt & # the answers of the boards 1 and 2
frames=$!
coman-hil run rig.yaml --transport socketcan --duration 10 --ready ready --quiet &
trap 'kill $! 2>/dev/null || true; wait' EXIT
until [ -e ready ]; do
    kill -0 $! # ends the script when the run has ended
    sleep 0.1
done
cansend can0 7E0#
wait $frames
[ "$(wc -l <frames.txt)" -eq 2 ]
cat frames.txt
