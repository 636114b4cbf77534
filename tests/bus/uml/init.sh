#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# First process of the guest that run.sh boots: prepares the machine, runs the command, powers off.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root HIL_WORK
export LC_ALL=C.UTF-8

fail() {
    echo "guest: $*"
    echo "Bail out! guest: $*" >>"$HIL_WORK/output"
    power_off 71
}

power_off() {
    echo "$1" >"$HIL_WORK/status"
    sync
    echo o >/proc/sysrq-trigger
    # never return: a first process that ends is a kernel panic
    while :; do
        sleep 60
    done
}

# a directory of the host, at the path it has there; the last wins over what lies above it
host_directory() {
    mkdir -p "$1" && mount -t hostfs -o "$1" none "$1" && mount -o "remount,$2" "$1"
}

mount -t proc none /proc
# shellcheck source=/dev/null
. "$HIL_WORK/environment"
mount -t sysfs none /sys
mount -t tmpfs none /dev
mkdir /dev/shm
for node in 'null 3' 'zero 5' 'full 7' 'random 8' 'urandom 9'; do
    # shellcheck disable=SC2086
    mknod -m 666 "/dev/${node% *}" c 1 ${node#* }
done
ln -s /proc/self/fd /dev/fd
mount -t tmpfs none /run
mount -t tmpfs none /tmp
host_directory "$HIL_WORK" rw || exit 1
host_directory "$HIL_SOURCE_DIR" ro || fail "cannot mount $HIL_SOURCE_DIR"
host_directory "$HIL_BINARY_DIR" rw || fail "cannot mount $HIL_BINARY_DIR"

modules=/usr/lib/uml/modules/$(uname -r)/kernel
for module in net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw \
    drivers/net/can/dev/can-dev drivers/net/can/vcan drivers/net/can/vxcan; do
    insmod "$modules/$module.ko" || fail "cannot load $module"
done
ip link set lo up
for number in 0 1 2 3 4; do
    ip link add dev "can$number" type vcan && ip link set "can$number" up ||
        fail "cannot create can$number"
done

cd "$HIL_BINARY_DIR" || fail "no $HIL_BINARY_DIR"
# shellcheck disable=SC2154
if [ -n "$first" ]; then
    exec "${command[@]}" </dev/null >>"$HIL_WORK/console" 2>&1
fi
# shellcheck disable=SC2154
"${command[@]}" </dev/null >>"$HIL_WORK/output" 2>&1
power_off $?
