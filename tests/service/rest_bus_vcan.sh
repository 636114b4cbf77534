#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Two simulators on one bus (run it through tests/bus/uml/run.sh): the boards of one are the real
# ones of the other, whose log, status and doctor say when they are heard. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/*.out $work/*.err"

# simulate NAME RIG ARGUMENT...: starts a simulator and waits until its loop runs; its process. It
# has no priority of real time and runs at a fiftieth of it: two overloaded loops would leave
# nothing of the guest's only processor to who asks.
simulate()
{
    local name=$1 rig=$2
    shift 2
    setpriv --bounding-set -sys_nice --inh-caps -sys_nice \
        "$program" run "$rig" --clock real --transport socketcan \
        --control "$work/$name.socket" "$@" >"$work/$name.out" 2>"$work/$name.err" </dev/null &
    simulator=$!
    for _ in $(seq 600); do
        "$program" ctl speed 0.02 --socket "$work/$name.socket" >/dev/null 2>&1 && break
        sleep 0.05
    done
}

# said COUNT TEXT NAME: waits until the log of a simulator has so many lines with the text
said()
{
    for _ in $(seq 600); do
        [ "$(grep -c "$2" "$work/$3.err")" -ge "$1" ] && return
        sleep 0.1
    done
    return 1
}

# joint NAME: the angle of LHipSag in a simulator, rad
joint()
{
    "$program" ctl --socket "$work/$1.socket" --json status |
        sed -n 's/.*"joints": *{[^}]*"LHipSag": *\([-0-9.e]*\).*/\1/p'
}

# whether both hold the leg's pose: the rotor is where the other's is
follows()
{
    for _ in $(seq 20); do
        angles="$(joint real) $(joint rest)"
        echo "$angles" | awk '{ d = $1 - $2; exit !(NF == 2 && d < 0.02 && d > -0.02) }' && return
    done
    return 1
}

status() { "$program" ctl --socket "$work/rest.socket" status; }

echo 1..6

simulate rest coman-rest-bus --bus left_shank=can2
rest=$simulator
said 3 "external board silent for" rest && ! grep -q "external board heard" "$work/rest.err"
result $? "boards that are not there are silent"

# It may not be asked before a whole second: the guest is slow
"$program" doctor coman-rest-bus --measure 0 --listen 0.2 >"$work/doctor.out" 2>&1
[ "$(grep -c "^warn external .* on can0 is silent: not heard in 0.2 s" "$work/doctor.out")" = 3 ]
result $? "doctor says which"

# What comes from the other simulator is what its own boards say
simulate real coman-foc-leg --task hold
real=$simulator
said 3 "external board heard" rest
result $? "boards that come are heard"

"$program" doctor coman-rest-bus --measure 0 --listen 1 >"$work/heard.out" 2>&1
[ "$(grep -cE "external +board hip_... on can0 is (heard|silent: last heard)" \
    "$work/heard.out")" = 3 ] &&
    status | grep -qE "external  hip_sag on left_hip: (heard|silent), last [0-9.]+ s ago"
result $? "doctor and status say when"

follows
result $? "their joint follows"
echo "# LHipSag: $angles rad there and here"

kill -TERM "$real"
wait "$real"
for _ in $(seq 600); do
    silent=$(status | grep -cE "external  hip_... on left_hip: silent, last [0-9.]+ s ago")
    [ "$silent" = 3 ] && break
    sleep 0.05
done
[ "$silent" = 3 ]
result $? "boards that go are silent again"

kill -TERM "$rest"
wait "$rest"
