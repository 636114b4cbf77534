#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Runs programs on a machine that has CAN controllers, whatever the machine: QEMU without KVM boots
# the installed kernel with two SJA1000 controllers (kvaser_pci: can0 and can1) on one bus, from an
# initial file system made of a static busybox, iproute2, the CAN modules, and the programs with
# their shared libraries.
#
#   run.sh [-t SECONDS] PROGRAM...
#
# The programs' output goes to standard output; the exit status is 0 when all ended with 0, 1 when
# one did not, 70 when the guest did not come to its end (its console is shown as TAP comments).
# Where something is not installed the TAP plan is one skipped test with the reason. HIL_WORK_KEEP
# keeps the temporary directory.
set -u

limit=60
if [ "${1:-}" = -t ]; then
    limit=$2
    shift 2
fi
if [ $# -eq 0 ]; then
    sed -n 's/^#   //p' "$0" >&2
    exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)

skip() {
    printf '1..1\nok 1 - qemu # SKIP %s\n' "$1"
    exit 0
}

fail() {
    echo "Bail out! $1"
    exit 70
}

qemu=$(command -v qemu-system-x86_64) ||
    skip "QEMU is not installed (Debian package qemu-system-x86)"
busybox=$(command -v busybox) || skip "busybox is not installed (Debian package busybox-static)"
ip=$(command -v ip) || skip "ip is not installed (Debian package iproute2)"
tc=$(command -v tc) || skip "tc is not installed (Debian package iproute2)"
for program in cpio gzip ldd timeout; do
    command -v "$program" >/dev/null ||
        skip "$program is not installed (cpio, gzip, libc-bin, coreutils)"
done
if ldd "$busybox" >/dev/null 2>&1; then
    skip "busybox is not static (Debian package busybox-static)"
fi

# the newest installed kernel that has the controller's driver
kernel=
modules=
for candidate in $(printf '%s\n' /lib/modules/* | sort -V); do
    if [ -r "/boot/vmlinuz-${candidate##*/}" ] &&
        ls "$candidate"/kernel/drivers/net/can/sja1000/kvaser_pci.ko* >/dev/null 2>&1; then
        kernel=/boot/vmlinuz-${candidate##*/} modules=$candidate
    fi
done
[ -n "$kernel" ] || skip "no readable kernel with kvaser_pci (Debian package linux-image-amd64)"
"$qemu" -device help 2>/dev/null | grep -q '"kvaser_pci"' || skip "this QEMU has no kvaser_pci"

work=$(mktemp -d /tmp/hil-qemu-XXXXXX) || exit 70
guest=
clean_up() {
    [ -n "$guest" ] && kill -KILL "$guest" 2>/dev/null
    [ -n "${HIL_WORK_KEEP:-}" ] || rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 70' INT TERM HUP

# a program and what it is linked with, at the paths that the linker will look at
add_libraries() {
    ldd "$1" 2>/dev/null | sed -n 's/.*=> \(\/[^ ]*\) .*/\1/p; s/^\s*\(\/[^ ]*\) .*/\1/p' |
        while read -r library; do
            mkdir -p "$root$(dirname "$library")" && cp -nL "$library" "$root$library"
        done
}

root=$work/root
mkdir -p "$root"/{bin,dev,proc,sys,tmp,modules,programs} || exit 70
cp "$here/init.sh" "$root/init" && chmod +x "$root/init"
cp "$busybox" "$root/bin/busybox"
# busybox's ip knows neither bit rates nor controllers, and its shell prefers it to any other
for program in "$ip" "$tc" "$(readlink -f "$(command -v sh)")"; do
    add_libraries "$program"
done
cp "$ip" "$tc" "$root/bin/" || fail "cannot copy ip and tc"
cp "$(command -v sh)" "$root/bin/sh" || fail "cannot copy sh"
for program in "$@"; do
    name=$(basename "$program")
    cp "$program" "$root/programs/$name" || fail "cannot read $program"
    add_libraries "$program"
    echo "$name" >>"$root/programs/order"
done
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan \
    drivers/net/can/sja1000/sja1000 drivers/net/can/sja1000/kvaser_pci net/sched/sch_netem; do
    case $(echo "$modules/kernel/$module".ko*) in
    *.ko) cp "$modules/kernel/$module.ko" "$root/modules/" ;;
    *.ko.xz) xz -dc "$modules/kernel/$module.ko.xz" >"$root/modules/${module##*/}.ko" ;;
    *.ko.zst) zstd -qdc "$modules/kernel/$module.ko.zst" >"$root/modules/${module##*/}.ko" ;;
    *) skip "the kernel has no module ${module##*/}" ;;
    esac
    echo "${module##*/}.ko" >>"$root/modules/order"
done
(cd "$root" && find . | cpio --quiet -o -H newc | gzip -1) >"$work/initramfs" || exit 70

# threadirqs, as a preemptible kernel has them: a program above them can fill a controller's queue
# before the interrupt that a frame has left is served
touch "$work/console" "$work/output" "$work/status"
timeout -k 5 "$limit" "$qemu" -accel tcg -cpu max -m 256 -nodefaults -no-user-config \
    -display none -no-reboot \
    -kernel "$kernel" -initrd "$work/initramfs" \
    -append "console=ttyS0 quiet loglevel=4 panic=-1 tsc=reliable no_timer_check threadirqs" \
    -object can-bus,id=cb -device kvaser_pci,canbus=cb -device kvaser_pci,canbus=cb \
    -serial "file:$work/console" -serial "file:$work/output" -serial "file:$work/status" \
    </dev/null >"$work/qemu" 2>&1 &
guest=$!
# show the output while it comes
tail -f -n +1 --pid="$guest" -s 0.1 "$work/output" &
follower=$!
wait "$guest"
guest=
wait "$follower"

status=$(tr -cd 0-9 <"$work/status")
if [ -z "$status" ]; then
    echo "Bail out! the guest did not finish within $limit s; its console:"
    cat "$work/qemu" "$work/console" | tail -n 40 | tr -d '\r' | sed 's/^/# /'
    exit 70
fi
exit "$status"
