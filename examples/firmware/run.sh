#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs a firmware on QEMU's ZCU102; its two CAN controllers are on the buses of a run of coman-hil:
#
#   run.sh FIRMWARE.elf [OPTION OF QEMU...]
#
# With COMAN_HIL_GATEWAY=HOST:PORT (coman-hil test --program sets it) through the run's gateway, by
# the socketcan.so beside the firmware; without it by the kernel's interfaces can0 and can1.
# -S -gdb tcp::1234 waits for a debugger.
set -eu
[ $# -gt 0 ] || {
    sed -n 's/^#   //p' "$0" >&2
    exit 2
}
firmware=$1
shift
hip=can0 shank=can1
if [ -n "${COMAN_HIL_GATEWAY:-}" ]; then
    hip=left_hip shank=left_shank
    LD_PRELOAD=$(cd "$(dirname "$firmware")" && pwd)/socketcan.so
    export LD_PRELOAD
fi
exec qemu-system-aarch64 -M xlnx-zcu102 -smp 1 -m 128 -display none -monitor none \
    -audiodev none,id=a -chardev stdio,id=console,signal=off -serial chardev:console \
    -object can-bus,id=hip -object can-bus,id=shank -machine canbus0=hip,canbus1=shank \
    -object can-host-socketcan,id=hip-host,canbus=hip,if=$hip \
    -object can-host-socketcan,id=shank-host,canbus=shank,if=$shank -kernel "$firmware" "$@"
