#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The firmware of examples/firmware passes all its scenarios, and each of its seeded bugs is caught
# by the scenario that names it. Prints TAP.
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

# every scenario and every bug that the sources name is in the table
for scenario in "$example"/scenarios/firmware_*.yaml; do
    name=${scenario##*/firmware_}
    name=${name%.yaml}
    grep -q "^correct  *$name  *ok$" "$work/table"
    result $? "the correct firmware passes $name"
done
for bug in $(grep -oh 'BUG_[A-Z_]*' "$example"/*.c | sort -u); do
    bug=$(echo "${bug#BUG_}" | tr '[:upper:]' '[:lower:]')
    grep -q "^$bug  *[a-z_]*  *FAIL$" "$work/table"
    result $? "the bug $bug is caught by the scenario that names it"
done
result $caught "the table is as it should be"

echo "1..$number"
exit $failed
