#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The firmware of examples/firmware passes all its scenarios, and each of its seeded bugs is caught
# by its own scenario alone. Prints TAP.
set -u
example=$HIL_SOURCE_DIR/examples/firmware
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"

for needed in qemu-system-aarch64:qemu-system-arm aarch64-linux-gnu-gcc:gcc-aarch64-linux-gnu; do
    if ! command -v "${needed%:*}" >/dev/null; then
        echo "1..1"
        skip firmware "${needed%:*} is not installed (${needed#*:}; ./dev setup --qemu)"
        exit 0
    fi
done

sh "$example/bugs.sh" -o "$work/runs" "$HIL_BINARY_DIR/coman-hil" >"$work/table" 2>&1
caught=$?
tap_show="$work/table"
for firmware in correct byte_order timeout race fifo bus_off; do
    name="the bug $firmware is caught by its own scenario alone"
    [ $firmware != correct ] || name="the correct firmware passes every scenario"
    grep -q "^$firmware .*ok" "$work/table" && ! grep -q "^$firmware .*bad" "$work/table"
    result $? "$name"
done
result $caught "the table is as it should be"

echo "1..$number"
exit $failed
