#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: slcan_vcan.sh COMAN_HIL [guest]
# slcand of can-utils on a line of run --slcan: the interface behind it hears the boards answer, in
# the guest of tests/bus/uml/run.sh. Prints TAP.
set -u
program=$1

if [ "${2:-}" != guest ]; then
    if ! command -v slcand >/dev/null ||
        ! ls /usr/lib/uml/modules/*/kernel/drivers/net/can/slcan/slcan.ko >/dev/null 2>&1; then
        printf '1..1\nok 1 - slcand # SKIP no slcand, or no kernel module slcan\n'
        exit
    fi
    exec bash "$HIL_SOURCE_DIR/tests/bus/uml/run.sh" -t 120 bash "$0" "$program" guest
fi

. "$HIL_SOURCE_DIR/tests/service/tap.sh"
work=$(mktemp -d)
tap_show=$work/log
echo 1..2

mkdir -p /dev/pts
mount -t devpts -o ptmxmode=0666 none /dev/pts && ln -sf pts/ptmx /dev/ptmx
insmod "/usr/lib/uml/modules/$(uname -r)/kernel/drivers/net/can/slcan/slcan.ko"
"$program" run "$HIL_SOURCE_DIR/config/rigs/coman.yaml" --transport local --clock lockstep \
    --hold always --quiet --slcan torso=/dev/torso --ready "$work/ready" >"$work/log" 2>&1 \
    </dev/null &
pid=$!
for _ in $(seq 600); do
    [ -e "$work/ready" ] && break
    sleep 0.1
done

slcand -o -c -s8 /dev/torso can9 >>"$work/log" 2>&1
for _ in $(seq 100); do
    ip link set can9 up >>"$work/log" 2>&1 && break
    sleep 0.1
done

# a discovery and a STEP of two ticks, which candump hears as well as what the boards say
timeout 60 candump -L -n 6 can9 >"$work/heard" 2>>"$work/log" &
listener=$!
for _ in $(seq 100); do
    grep -q can9 /proc/net/can/rcvlist_all && break
    sleep 0.1
done
cansend can9 70F#FF >>"$work/log" 2>&1
cansend can9 6F0#000000000200 >>"$work/log" 2>&1
wait "$listener"
cut -d ' ' -f 3 "$work/heard" >>"$work/log"
[ "$(cut -d ' ' -f 3 "$work/heard" | sed '$s/#.*//' | tr '\n' ' ')" = \
    "70F#FF 6F0#000000000200 710#FF04025157 720#FF04025157 7C0#FF06030005 6FF " ]
result $? "slcand's interface hears the boards answer"
kill "$pid"
wait "$pid"
result $? "the run ends"
exit $failed
