#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# What was crossed for 64-bit ARM (./dev build aarch64), run under QEMU's user mode. Prints TAP.
#
#   emulate.sh tests NAME...      the test programs of these names
#   emulate.sh bits RIG:TASK...   rows of the table of bits; all of them without one
set -u
what=$1
shift
. "$(dirname "$0")/../service/tap.sh"
binary=$HIL_SOURCE_DIR/build/aarch64 root=$HIL_SOURCE_DIR/build/debian-arm64
emulator=qemu-aarch64-static

for need in "$(command -v $emulator)" "$root/packages" "$binary/coman-hil"; do
    if [ ! -e "$need" ]; then
        echo 1..1
        skip "aarch64 $what" "nothing was crossed for it (./dev setup --aarch64)"
        exit 0
    fi
done

if [ "$what" = bits ]; then
    export HIL_BINARY_DIR=$binary HIL_EMULATOR="$emulator -L $root" HIL_INSTRUCTIONS=plain
    export OBJDUMP=aarch64-linux-gnu-objdump
    exec bash "$HIL_SOURCE_DIR/tests/service/same_bits.sh" "$@"
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tap_show=$work/out
echo "1..$#"
for name in "$@"; do
    HIL_BINARY_DIR=$binary timeout -k 5 60 $emulator -L "$root" "$binary/tests/test_$name" \
        >"$work/out" 2>&1 </dev/null
    # cmocka counts what a program skips apart, and says so in words of its own
    result $? "$name passes on aarch64"
done
exit "$failed"
