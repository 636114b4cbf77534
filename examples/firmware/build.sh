#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Builds the firmware and what connects QEMU with a run:
#
#   build.sh DIR [BUG...]     DIR/firmware.elf or, with bugs (README.md has their names),
#                             DIR/firmware-BUG.elf for each; DIR/socketcan.so
set -eu
[ $# -gt 0 ] || {
    sed -n 's/^#   //p' "$0" >&2
    exit 2
}
here=$(cd "$(dirname "$0")" && pwd)
out=$1
shift
mkdir -p "$out"
cc=${CROSS_COMPILE:-aarch64-linux-gnu-}gcc

# current OUTPUT SOURCE: an output is newer than its source and every header
current()
{
    [ "$1" -nt "$2" ] && [ -z "$(find "$here" -name '*.h' -newer "$1")" ]
}

# firmware OUTPUT [FLAG...]: interrupts must not touch floating-point registers, which their entry
# does not save; without an MMU no access may be unaligned
firmware()
{
    output=$1
    shift
    common="-std=gnu11 -O2 -g -Wall -Wextra -Werror -ffreestanding -fno-pic -mcpu=cortex-a53
        -mstrict-align -fno-tree-loop-distribute-patterns -ffp-contract=off"
    # shellcheck disable=SC2086
    for file in main leg boards can machine; do
        current "$output.$file.o" "$here/$file.c" ||
            "$cc" $common -mgeneral-regs-only "$@" -c "$here/$file.c" -o "$output.$file.o"
    done
    # shellcheck disable=SC2086
    current "$output.control.o" "$here/control.c" ||
        "$cc" $common "$@" -c "$here/control.c" -o "$output.control.o"
    "$cc" -c "$here/start.S" -o "$output.start.o"
    "$cc" -nostdlib -static -no-pie -Wl,-T,"$here/memory.ld" -Wl,--build-id=none \
        -Wl,--no-warn-rwx-segments "$output".*.o -o "$output"
}

current "$out/socketcan.so" "$here/socketcan.c" ||
    "${CC:-cc}" -O2 -g -Wall -Wextra -Werror -shared -fPIC -o "$out/socketcan.so" \
        "$here/socketcan.c" -lpthread
[ $# -gt 0 ] || firmware "$out/firmware.elf"
for bug in "$@"; do
    firmware "$out/firmware-$bug.elf" -DBUG_"$(echo "$bug" | tr '[:lower:]' '[:upper:]')"
done
