#!/bin/busybox sh
# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=dash
#
# First process of the guest that run.sh boots: loads the drivers, runs the programs, powers off.
# ttyS0 is the console, ttyS1 takes the programs' output, ttyS2 the exit status.
/bin/busybox --install -s /bin
export PATH=/bin HOME=/ CMOCKA_MESSAGE_OUTPUT=TAP HIL_QEMU=1

mount -t devtmpfs none /dev
for port in ttyS0 ttyS1 ttyS2; do
    stty -F /dev/$port raw -echo
done
exec </dev/null >/dev/ttyS1 2>&1

power_off() {
    echo "$1" >/dev/ttyS2
    # the ports have sent all before the power goes
    sleep 0.2
    poweroff -f
}

mount -t proc none /proc
mount -t sysfs none /sys
mount -t tmpfs none /tmp
while read -r module; do
    insmod "/modules/$module" || {
        echo "Bail out! cannot load $module"
        power_off 71
    }
done </modules/order
ip link set lo up

status=0
while read -r program; do
    "/programs/$program" || status=1
done </programs/order
power_off $status
