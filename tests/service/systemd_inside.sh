#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# In the guest of systemd.sh, as a service of systemd: installs the package, starts its units, and
# sees to it that they do what a laboratory expects of them. Prints TAP and powers the guest off.
set -u
packages=$HIL_BINARY_DIR/systemd-packages
package=$(echo "$packages"/coman-hil_*.deb)
log=$HIL_WORK/log
unit=coman-hil@coman
. "$(dirname "$0")/tap.sh"
tap_show=$log

# check STATUS NAME: a result, with what systemd has to say of a failure
check() {
    result "$1" "$2"
    if [ "$1" -ne 0 ]; then
        systemctl --no-pager --full status $unit 2>&1 | head -n 20 | sed 's/^/# /'
        journalctl --no-pager -n 15 2>&1 | sed 's/^/# /'
    fi
    : >"$log"
}

property() { systemctl show -P "$1" $unit; }
journal() { journalctl --no-pager -o cat -u $unit "$@"; }

# within SECONDS COMMAND...: it comes true in that time
within() {
    local end=$((SECONDS + $1))
    shift
    until "$@" >/dev/null 2>&1; do
        [ $SECONDS -le $end ] || return 1
        sleep 0.4
    done
}

main_pid_is_not() { [ "$(property MainPID)" != "$1" ] && [ "$(property MainPID)" != 0 ]; }
answers_on_can() { timeout 2 candump -n 1 -T 1500 can0,700:70F 2>/dev/null |
    grep -q . & sleep 0.2; cansend can0 70F#FF; wait $!; }
# said COUNT TEXT: the journal has it so often at least
said() { [ "$(journal | grep -c "$2")" -ge "$1" ]; }

finish() {
    echo "$1" >"$HIL_WORK/status"
    sync
    echo o >/proc/sysrq-trigger
    sleep 60
}

test_installation() {
    dpkg --force-unsafe-io -i "$package" >"$log" 2>&1 && [ -z "$(dpkg --verify coman-hil)" ] &&
        [ "$(property ActiveState)" = inactive ]
    check $? "the package is installed and starts nothing"
    # the laboratory's own rig of this name: the installed one at 100 Hz, which this kernel keeps
    mkdir -p /etc/coman-hil/rigs
    cat >/etc/coman-hil/rigs/coman.yaml <<'END'
extends: coman
tick_s: 0.01
tasks:
  servo: {command_period_s: 0.01}
END
    ip link delete can0
    systemctl start coman-hil-vcan@can0 && ip -br link show type vcan | grep -q '^can0 .*UP'
    check $? "the unit creates a virtual interface"
    ! systemctl start coman-hil-vcan@can1 2>/dev/null && ip link show can1 >/dev/null
    check $? "and leaves alone what has been there before it"
}

test_start() {
    timeout 90 systemctl start $unit
    check $? "systemctl start comes back when the loop has run its first tick"
    [ "$(property ActiveState)/$(property SubState)" = active/running ]
    check $? "it is running"
    within 60 answers_on_can
    check $? "its boards answer on can0"
    within 60 eval 'systemctl --no-pager status $unit | grep -q "Status: .* s  x"'
    check $? "systemctl status tells how it is"
}

# as the service's own user, with the limits of the unit
as_service() {
    local user
    user=$(stat -c %u "/proc/$(property MainPID)")
    prlimit --rtprio=95 --memlock=unlimited setpriv \
        --reuid="$user" --regid="$user" --clear-groups "$@"
}

test_rights() {
    local pid
    pid=$(property MainPID)
    ps -L -o user=,cls=,rtprio= -p "$pid" >"$log"
    ! grep -q '^root' "$log"
    check $? "it does not run as root"
    ps -L -o cls=,rtprio= -p "$pid" >"$log"
    [ "$(grep -c 'FF  *80' "$log")" = 1 ]
    check $? "one thread, the loop, has the FIFO priority of the rig"
    grep VmLck "/proc/$pid/status" >"$log"
    awk '{ exit !($2 > 1000) }' "$log"
    check $? "its memory is locked"
    grep '^Cap' "/proc/$pid/status" >"$log"
    [ "$(grep -c '0000000000000000$' "$log")" = 5 ]
    check $? "it has no capability at all"
    as_service coman-hil doctor --measure 0 coman >"$log" 2>&1 && ! grep -q '^fail' "$log" &&
        grep -q '^ok   FIFO priority' "$log" && grep -q '^ok   locked memory' "$log" &&
        [ "$(grep -c '^ok   interface' "$log")" = 5 ]
    check $? "doctor finds as its user that it may do what the rig says"
}

test_control() {
    local socket=/run/coman-hil/coman/control
    coman-hil ctl status --socket $socket >"$log" 2>&1 &&
        as_service coman-hil ctl status --socket $socket >>"$log" 2>&1
    check $? "root and its user may ask it how it is"
    ! setpriv --reuid=65534 --regid=65534 --clear-groups coman-hil ctl status --socket $socket \
        >"$log" 2>&1
    check $? "nobody else may"
}

test_reload() {
    local pid
    pid=$(property MainPID)
    timeout 90 systemctl reload $unit
    within 60 said 1 "reload: restarting" && within 60 answers_on_can &&
        [ "$(property MainPID)" = "$pid" ]
    check $? "reload starts the rig anew in the same process"
}

test_journal() {
    journalctl --no-pager -o cat -u $unit >"$log"
    [ -s "$log" ] && ! LC_ALL=C grep -nP '[\x00-\x08\x0b-\x1f\x7f]|^<[0-9]>' "$log" >"$log.odd"
    check $? "the journal has whole lines without control characters or prefixes"

    # a program that sends nonsense to every address of every bus, as fast as it can
    journal --cursor-file="$HIL_WORK/cursor" >/dev/null
    for n in 0 1 2 3 4; do
        cangen "can$n" -g 0 -n 1000 -I r -L r -D r -p 1 2>/dev/null &
        cangen "can$n" -g 0 -n 1000 -I 001 -L 1 -D 7F -p 1 2>/dev/null &
    done
    wait $(jobs -p)
    # what the loop has counted is written a second later
    within 60 eval 'journal -n 100 | grep -q "more like it"'
    sleep 2.5
    journal --cursor-file="$HIL_WORK/cursor" >"$log"
    echo "# 10000 frames of nonsense left $(wc -l <"$log") lines in the journal"
    grep -q 'more like it' "$log" && [ "$(wc -l <"$log")" -ge 5 ] && [ "$(wc -l <"$log")" -le 1000 ]
    check $? "a flood of events leaves few lines, which tell how many there were"
    journal -p warning >"$log"
    grep -q 'unknown command' "$log" && ! grep -q 'dynamics:' "$log"
    check $? "journalctl -p warning shows what went wrong, and only that"
    [ "$(property ActiveState)/$(property NRestarts)" = active/0 ]
    check $? "the service has outlived it"
}

# a controller that sees its boards vanish, in real time: by their silence; the links are clamped,
# since a robot falls whose controller waits too long for the guest's only processor
test_silence() {
    local controller on="torso/0x01 .*: axis 0 from idle to voltage mode" before
    # the nonsense may have given boards other addresses
    echo 'OPTIONS=--hold always' >/etc/default/coman-hil-coman
    systemctl restart $unit
    before=$(journal | grep -c "$on")
    coman-hil task hold coman --clock real --reconnect >"$HIL_WORK/task" 2>&1 </dev/null &
    controller=$!
    within 60 said $((before + 1)) "$on" && systemctl restart $unit &&
        within 60 said $((before + 2)) "$on"
    check $? "a controller in real time finds the boards of a restarted service"
    cp "$HIL_WORK/task" "$log"
    journal -n 30 >>"$log"
    grep -q "sends no telemetry" "$HIL_WORK/task" && grep -q "looking for the boards again" \
        "$HIL_WORK/task"
    check $? "it has noticed their silence"
    kill -TERM $controller
    wait $controller
    check $? "and switches the motors off at its end"
    timeout 90 systemctl stop $unit
    [ "$(property ActiveState)" = inactive ] && [ "$(property Result)" = success ]
    check $? "stop ends the service well"
    rm /etc/default/coman-hil-coman
}

# Rows of a recording before the one of the given time have 0 V everywhere, later ones have not.
judge_voltages() {
    python3 - "$1" "$2" <<'END'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1])))
on = float(sys.argv[2])
driven = [float(r["time_s"]) for r in rows
          if any(abs(float(v)) > 0 for k, v in r.items() if k.startswith("voltage_"))]
before = [r for r in rows if float(r["time_s"]) < on]
print(f"{len(before)} rows before the motors were on at {on} s, "
      f"voltages from {driven[0] if driven else None} s")
sys.exit(not (len(before) > 1 and driven and driven[0] >= on))
END
}

# the same in lockstep, where the outcome does not hang on the clock; a rig of the laboratory's own
test_reconnection() {
    local controller pid on found
    unit=coman-hil@lab
    cat >/etc/coman-hil/rigs/lab.yaml <<'END'
extends: coman
tick_s: 0.004
tasks:
  servo: {command_period_s: 0.004}
  squat: {depth_m: 0.05, period_s: 1.5, cycles: 1}
END
    echo 'OPTIONS=--clock lockstep --record recording --record-period 4 --force' \
        >/etc/default/coman-hil-lab
    timeout 90 systemctl start $unit
    check $? "a rig that extends one that extends the package's is started"
    coman-hil task squat lab --clock lockstep --reconnect >"$HIL_WORK/task" 2>&1 </dev/null &
    controller=$!
    within 60 said 1 "robot is released" && systemctl restart $unit &&
        within 60 said 2 "robot is released"
    check $? "a controller finds the boards of a restarted service"

    pid=$(property MainPID)
    kill -STOP "$pid"
    within 60 main_pid_is_not "$pid"
    check $? "a stopped process is found by the watchdog and started anew"
    journalctl --no-pager -u $unit | grep -qi watchdog
    check $? "the journal says so"
    within 60 said 3 "robot is released"
    check $? "the controller finds its boards once more"

    wait $controller
    found=$?
    cp "$HIL_WORK/task" "$log"
    [ $found = 0 ] && [ "$(grep -c "looking for the boards again" "$log")" = 2 ]
    check $? "and ends the squat that it has begun three times"
    sed -n 's/.*cycles done, \([0-9.]*\) mm deep.*/\1/p' "$HIL_WORK/task" |
        awk '{ exit !($1 > 45 && $1 < 55) }'
    check $? "50 mm deep, within a tenth"
    systemctl stop $unit
    on=$(journal | awk '
        /^dynamics:/ { on = "" }
        on == "" && /idle to voltage mode/ { on = $1 }
        END { print on }')
    judge_voltages /var/lib/coman-hil/lab/recording/signals.csv "${on:-0}" >"$log" 2>&1
    check $? "until it has switched the motors on again they are at 0 V"
}

test_examples() {
    mkdir -p /etc/systemd/system/coman-hil@.service.d
    cp /usr/share/doc/coman-hil/examples/can-configure.conf \
        /etc/systemd/system/coman-hil@.service.d/
    systemctl daemon-reload
    timeout 90 systemctl start $unit
    pid=$(property MainPID)
    grep Cap "/proc/$pid/status" >"$log"
    [ "$(sed -n 's/^CapEff:\s*//p' "/proc/$pid/status")" = 0000000000001000 ] &&
        [ "$(readlink "/proc/$pid/ns/user")" = "$(readlink /proc/self/ns/user)" ]
    check $? "a drop-in gives it the right to set up interfaces, and no other"
    rm -r /etc/systemd/system/coman-hil@.service.d
    systemctl daemon-reload

    groupadd --system realtime >/dev/null 2>&1
    mkdir -p /etc/systemd/network /etc/udev/rules.d
    cp /usr/share/doc/coman-hil/examples/*.network /usr/share/doc/coman-hil/examples/*.link \
        /etc/systemd/network/
    cp /usr/share/doc/coman-hil/examples/*.rules /etc/udev/rules.d/
    SYSTEMD_LOG_LEVEL=debug SYSTEMD_LOG_TARGET=console \
        timeout 1 /lib/systemd/systemd-networkd >"$log.networkd" 2>&1
    SYSTEMD_LOG_LEVEL=debug udevadm test -a add /sys/class/net/can0 >"$log.udev" 2>&1
    grep -h '80-coman-hil' "$log.networkd" "$log.udev" >"$log"
    grep -q '80-coman-hil-can.rules' "$log" &&
        ! grep -hE '80-coman-hil.*(Unknown|Invalid|Failed|ignor)' "$log.networkd" "$log.udev"
    check $? "networkd and udev understand the examples"
    rm /etc/systemd/network/80-coman-hil-can.* /etc/udev/rules.d/80-coman-hil-can.rules
}

# What the guides tell people to type on such a machine; they make the interfaces themselves.
test_guides() {
    systemctl stop $unit coman-hil-vcan@can0
    for n in 1 2 3 4; do ip link delete can$n; done
    python3 "$HIL_SOURCE_DIR/tests/service/manual.py" "$HIL_SOURCE_DIR" guest >"$log" 2>&1
    check $? "the commands of the guides for such a machine work"
    rm -f /etc/systemd/network/80-coman-hil-can.* /etc/udev/rules.d/80-coman-hil-can.rules
    ip link delete can0
    systemctl start coman-hil-vcan@can0 && timeout 90 systemctl start $unit
}

test_upgrade_and_removal() {
    local pid
    systemctl enable -q $unit coman-hil-vcan@can0
    pid=$(property MainPID)
    dpkg --force-unsafe-io -i "$packages/next.deb" >"$log" 2>&1 && within 60 main_pid_is_not "$pid"
    check $? "an upgrade starts what runs anew, with the new program"
    [ ! -L "/proc/$(property MainPID)/exe" ] || readlink "/proc/$(property MainPID)/exe" >"$log"
    ! grep -q deleted "$log" && [ -e /etc/coman-hil/rigs/lab.yaml ]
    check $? "and keeps the rigs of the laboratory"

    dpkg -r coman-hil >"$log" 2>&1 && [ "$(property ActiveState)" = inactive ] &&
        ! pidof coman-hil >>"$log" && ! ip link show can0 >>"$log" 2>&1
    check $? "removing it stops what runs and takes the virtual interfaces away"
    [ -d /var/lib/private/coman-hil ] && [ -e /var/lib/coman-hil/lab/recording/candump.log ]
    check $? "recordings stay"
    dpkg -P coman-hil >"$log" 2>&1
    (cd /run/upper && find etc usr var -name '*coman-hil*' ! -type c ! -path 'var/log/*') |
        sort >>"$log"
    [ "$(grep -e '^etc/' -e '^usr/' -e '^var/' "$log" | tr '\n' ' ')" = \
        "etc/coman-hil etc/default/coman-hil-lab " ]
    check $? "a purge leaves the laboratory's own files and nothing else"
}

echo 1..39
test_installation
test_start
test_rights
test_control
test_reload
test_journal
test_silence
test_reconnection
test_examples
test_guides
test_upgrade_and_removal
finish $failed
