#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Boards of each protocol answer a request on vcan, on a kernel that has CAN (run it through
# tests/bus/uml/run.sh). Prints TAP with the table of coman-hil-bench latency --answers.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"
echo 1..1
mkdir -p /dev/pts
mount -t devpts -o ptmxmode=666,newinstance devpts /dev/pts
[ -e /dev/ptmx ] || ln -s pts/ptmx /dev/ptmx
for can in 0 1 2 3 4 5 6 7 8 9; do
    [ $can -gt 4 ] && ip link add can$can type vcan
    ip link set can$can down # CAN FD, for moteus
    ip link set can$can mtu 72 && ip link set can$can up
done
name="two bare sockets and the boards of five protocols answer on vcan"
timeout 400 "$HIL_BINARY_DIR/coman-hil-bench" latency --answers --count 50 >"$work/out" \
    2>"$work/err" </dev/null
status=$?
answered=$(awk '$0 ~ / vcan / && $NF == 0 { n++ } END { print n }' "$work/out")
if [ $status = 0 ] && [ "$answered" = 6 ]
then ok "$name"; else not_ok "$name"; fi
sed 's/^/# /' "$work/out"
