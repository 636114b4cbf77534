#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: guard_runs.sh GUARD COMAN-HIL
# The unchanged program under the guard: in every clock, with all that can be switched on beside the
# loop, nothing is done in it that a real-time loop may not do, no page is faulted in, and the
# system calls are those expected. Prints TAP, with the guard's table of each run.
set -u
guard=$1
program=$2
# shellcheck source=/dev/null
. "$(dirname "$0")/guard_lib.sh"

echo 1..25

guarded "$rigs/coman.yaml" --transport local --clock lockstep --task squat --ticks 3000 --wire ideal
verdict "lockstep on ideal buses makes no system call" only

guarded "$rigs/coman.yaml" --transport local --clock lockstep --task squat --ticks 3000 --wire wire
verdict "nor on buses in wire mode" only

for rig in grasp walkman coman-fd coman-foc coman-compact coman-cia402 \
    coman-mini-cheetah; do
    task=squat
    [ $rig = grasp ] && task=grasp
    guarded "$rigs/$rig.yaml" --transport local --clock lockstep --task $task --ticks 3000 \
        --wire wire --record "$work/record" --record-format both
    verdict "$rig, recorded" only clock_nanosleep
done

guarded "$rigs/walk-flat.yaml" --transport local --clock lockstep --task walk --ticks 5500
verdict "a walk, its estimator and plan among it" only

guarded "$rigs/walk-sensors.yaml" --transport local --clock lockstep --task walk --ticks 5500
verdict "a walk by an attitude filter and boards with clocks of their own" only

guarded "$rigs/coman-sensors.yaml" --transport local --clock free --ticks 3000 --energy --settle
verdict "noisy sensors, the account of energy and a settled start" only

guarded "$rigs/coman-drives.yaml" --transport local --clock lockstep --ticks 3000 --energy \
    --task squat
verdict "drives with friction, backlash, heat and a supply that rises" only

guarded "$rigs/coman.yaml" --transport local --clock lockstep --task squat --ticks 3000 \
    --fault 'sensor LKneeSag.torque garbage amplitude=5 0.2..1' \
    --fault 'board left_leg/0x01 intermittent 0.5..1' \
    --fault 'board right_leg/0x02 hung 2.95..3.2' \
    --fault 'motor RKneeSag open_phase 1.5..1.6' --fault 'bus left_arm loss p=0.1 0.5..2' \
    --fault 'bus right_arm late delay=0.002 0.5..2' --fault 'supply sag volts=3 2..2.5'
verdict "faults on a sensor, boards, a motor, buses and the supply" only

guarded "$rigs/coman.yaml" --transport local --clock real --task squat --duration 1.5 \
    --record "$work/record" --record-format both
verdict "in real time with a task and a recording the loop sleeps and does nothing else" only \
    clock_nanosleep

guarded "$rigs/coman.yaml" --transport local --clock real --task squat --duration 1.5 --wire wire
verdict "likewise on buses in wire mode" only clock_nanosleep

guarded "$rigs/coman-fd.yaml" --transport local --clock real --task squat --duration 1 --wire wire
verdict "CAN FD in real time" only clock_nanosleep

# client COMMAND...: joins the torso's bus by the gateway, then runs the command with the connection
# as descriptor 3
client()
{
    local gateway_port pid control gateway_host
    for _ in $(seq 500); do
        [ -e "$work/ready" ] && break
        sleep 0.02
    done
    . "$work/ready"
    exec 3<>"/dev/tcp/127.0.0.1/$gateway_port" || return
    printf '< open torso >< rawmode >' >&3
    "$@" >"$work/heard"
    exec 3>&-
}
# STEP frames of ten ticks each, after each a pause in which the loop waits
steps()
{
    for k in $(seq 0 19); do
        printf '< send 6f0 6 %x 0 0 0 a 0 >' $((k * 10)) >&3
        sleep 0.01
    done
    timeout 1 cat <&3
}
listen()
{
    timeout 1 cat <&3
}
made()
{
    local name
    for name in "$@"; do
        [ -n "$(calls "$name")" ] || return
    done
}

client listen &
guarded "$rigs/coman.yaml" --transport local --clock real --task squat --gateway 0 \
    --ready "$work/ready" --duration 1.5
wait $!
verdict "in real time the loop waits for frames of a client of the gateway, and wakes its thread" \
    only clock_nanosleep ppoll read write

client steps &
guarded "$rigs/coman.yaml" --transport local --clock lockstep --gateway 0 \
    --ready "$work/ready" --ticks 200
wait $!
verdict "a client of the gateway drives lockstep: the loop sleeps for it" made ppoll read write

# all that can be asked of a running simulator
steer()
{
    local tries=0 tunable
    until "$program" ctl --socket "$work/control" status >"$work/steered" 2>&1; do
        tries=$((tries + 1))
        [ $tries -lt 200 ] || return
        sleep 0.02
    done
    tunable=$("$program" ctl --socket "$work/control" list tunables '*position_kp' |
        sed -n 's/^ *\([^ ]*position_kp\).*/\1/p' | head -n 1)
    while read -r request; do
        # shellcheck disable=SC2086
        "$program" ctl --socket "$work/control" $request >>"$work/steered" 2>&1 </dev/null
    done <<END
pause
checkpoint 1
step 20
push Waist force_n=20,0,0 duration_s=0.1
set ${tunable:-supply_v}=40
step 30
restore 1
resume
statistics
speed 2
subscribe q_* --rows 20
wait time_s=0.5
pause
reset
resume
speed max
stop
END
}
for clock in real free; do
    steer &
    guarded "$rigs/coman.yaml" --transport local --clock $clock --task squat \
        --control "$work/control"
    wait $!
    grep -i 'expected' "$work/steered" | sed 's/^/# /'
    verdict "pause, step, checkpoint, push, set, restore, speed, reset, $clock clock" \
        only clock_nanosleep ppoll read write
done

# three pages that watch everything, frames and rows too; watched: each has seen some of it
watch_pages()
{
    HIL_BINARY_DIR=$(dirname "$program") /usr/bin/python3 \
        "$HIL_SOURCE_DIR/tests/service/page_watchers.py" "$work/err" 3 >"$work/watched" 2>&1
}
watched()
{
    sed 's/^/# /' "$work/watched"
    grep -Eq '^states( [1-9][0-9]*){3}$' "$work/watched" && only clock_nanosleep
}
export HIL_SOURCE_DIR
for clock in real free; do
    rm -f "$work/err"
    watch_pages &
    guarded "$rigs/coman.yaml" --transport local --clock $clock --task squat --http 0 \
        --ticks 2500
    wait $!
    verdict "three pages cost the loop nothing but their copy, $clock clock" watched
done

guarded "$rigs/coman.yaml" --transport local --clock real --duration 1
verdict "in real time without a task the loop sleeps and does nothing else" only clock_nanosleep

# the engine that is not made for a loop is caught: it is said to allocate
mkdir -p "$work/config/rigs"
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work/config/"
sed 's/engine: native .*/engine: simbody/; s/friction: sticking/friction: regularized/
    /robot_surfaces:/d' "$rigs/coman.yaml" \
    >"$work/config/rigs/simbody.yaml"
guarded "$work/config/rigs/simbody.yaml" --transport local --clock free --hold none --ticks 300
number=$((number + 1))
if grep -q 'VIOLATION in phase \(plant\|sensors\)' "$work/log"; then
    echo "ok $number - an engine that allocates is caught in the program too"
    head -n 3 "$work/log" | sed 's/^/# /'
else
    echo "not ok $number - an engine that allocates is caught in the program too"
    cat "$work/log" "$work/err" | sed 's/^/# /'
    failures=$((failures + 1))
fi
exit $((failures > 0))
