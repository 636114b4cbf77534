#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: client_vcan.sh COMAN_HIL ELBOW [EXPECTED]
# The client in lockstep over SocketCAN: the controller of examples/controller-c does what it does
# through the gateway, which is written here first; with the file EXPECTED of it the script runs in
# the guest of tests/bus/uml/run.sh, on can0 to can4. Prints TAP.
set -u
program=$1 elbow=$2 expected=${3:-}
rig=$HIL_SOURCE_DIR/config/rigs/coman.yaml
# the guest reads a folder of the build
work=$(mktemp -d "$HIL_BINARY_DIR/client_vcan-XXXXXX")
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"
mkdir "$work/tables"
"$program" dbc "$rig" -o "$work/tables" >"$work/out" 2>&1

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
    timeout -k 5 240 "$elbow" "$ready" LElbj RElbj >"$work/$name" 2>"$work/out"
    status=$?
    cat "$work/log" >>"$work/out"
    kill "$pid"
    wait "$pid"
    return $status
}

if [ -z "$expected" ]; then
    # a failure here is seen there, as a text that differs
    control gateway "$work/ready" --transport local --gateway 0 || cat "$work/out" >>"$work/gateway"
    bash "$HIL_SOURCE_DIR/tests/bus/uml/run.sh" -t 180 \
        bash "$0" "$program" "$elbow" "$work/gateway"
    exit
fi

echo 1..2
control vcan "$work/tables/coman.joints" --transport socketcan
result $? "a controller moves joints on two buses over vcan"
[ -s "$expected" ] && diff "$work/vcan" "$expected" >>"$work/out" 2>&1
result $? "it does the same as through the gateway"
exit $failed
