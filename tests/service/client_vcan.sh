#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: client_vcan.sh COMAN_HIL ELBOW (in the guest of tests/bus/uml/run.sh, can0 to can4)
# The client in lockstep over SocketCAN: the controller of examples/controller-c does what it does
# through the gateway. Prints TAP.
set -u
program=$1 elbow=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml
mkdir "$work/tables"
echo 1..2

# control NAME READY OPTION...: the controller's text in NAME
control() {
    local name=$1 ready=$2 pid status
    shift 2
    "$program" run "$rig" --clock lockstep --hold always --quiet --ready "$work/ready" "$@" \
        >"$work/log" 2>&1 </dev/null &
    pid=$!
    for _ in $(seq 600); do
        [ -e "$work/ready" ] && break
        sleep 0.1
    done
    timeout -k 5 240 "$elbow" "$work/tables" "$ready" LElbj RElbj >"$work/$name" 2>"$work/out"
    status=$?
    cat "$work/log" >>"$work/out"
    kill "$pid"
    wait "$pid"
    return $status
}

"$program" dbc "$rig" -o "$work/tables" >"$work/out" 2>&1 && control vcan - --transport socketcan
result $? "a controller moves joints on two buses over vcan"
control gateway "$work/ready" --transport local --gateway 0 &&
    diff "$work/vcan" "$work/gateway" >>"$work/out" 2>&1
result $? "it does the same as through the gateway"
exit $failed
