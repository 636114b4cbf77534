#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The service as a laboratory has it: installed, with systemd as the first process of a kernel that has
# CAN. Without arguments, on the host: installs into a folder and boots the guest. With "guest" it is the
# guest's first process and becomes systemd; with "test" it is the service that tests the others.
set -u
here=$(cd "$(dirname "$0")" && pwd)

host() {
    if ! command -v /lib/systemd/systemd >/dev/null; then
        printf '1..1\nok 1 - systemd # SKIP systemd is not installed\n'
        exit 0
    fi
    rm -rf "$HIL_BINARY_DIR/installed"
    cmake --install "$HIL_BINARY_DIR" --prefix "$HIL_BINARY_DIR/installed" >/dev/null || exit 70
    exec bash "$here/../bus/uml/run.sh" -t 200 -x bash "$here/systemd.sh" guest
}

# first process of the guest
guest() {
    mount --bind "$HIL_BINARY_DIR/installed" /usr/local
    mount -t tmpfs none /var
    mkdir -p /var/lib /var/cache /var/log /var/tmp
    mount -t tmpfs none /etc/default
    mkdir -p /run/units /run/systemd/journald.conf.d /run/systemd/system.conf.d
    printf '[Journal]\nStorage=volatile\nRateLimitBurst=0\n' >/run/systemd/journald.conf.d/test.conf
    cat >/run/units/hil-test.target <<END
[Unit]
Requires=basic.target
Wants=hil-test.service
After=basic.target
AllowIsolate=yes
END
    # the guest's /dev is made by hand, and no private one can be put in its place
    mkdir /run/units/coman-hil-vcan@.service.d
    printf '[Service]\nPrivateDevices=no\n' >/run/units/coman-hil-vcan@.service.d/guest.conf
    # basic.target of the distribution starts what this guest has no use for
    printf '[Unit]\nRequires=systemd-journald.service\nAfter=systemd-journald.service\n' >/run/units/basic.target
    cat >/run/units/hil-test.service <<END
[Unit]
DefaultDependencies=no
After=systemd-journald.service
[Service]
Type=oneshot
Environment=HIL_WORK=$HIL_WORK HIL_SOURCE_DIR=$HIL_SOURCE_DIR HIL_BINARY_DIR=$HIL_BINARY_DIR
ExecStart=/bin/bash $here/systemd.sh test
StandardOutput=append:$HIL_WORK/output
StandardError=append:$HIL_WORK/console
TimeoutStartSec=180
END
    export SYSTEMD_UNIT_PATH=/run/units:/usr/local/lib/systemd/system:/usr/lib/systemd/system
    exec /lib/systemd/systemd --system --unit=hil-test.target --log-target=journal --show-status=no \
        systemd.unified_cgroup_hierarchy=1
}

number=0
result() {
    number=$((number + 1))
    if [ "$2" -eq 0 ]; then
        echo "ok $number - $1"
    else
        echo "not ok $number - $1"
        systemctl --no-pager --full status coman-hil@coman 2>&1 | head -n 20 | sed 's/^/# /'
        journalctl --no-pager -n 15 2>&1 | sed 's/^/# /'
    fi
}

property() { systemctl show -P "$1" coman-hil@coman; }

# within SECONDS COMMAND...: it comes true in that time
within() {
    local limit=$1
    shift
    for _ in $(seq $((limit * 10))); do
        "$@" >/dev/null 2>&1 && return 0
        sleep 0.1
    done
    return 1
}

main_pid_is_not() { [ "$(property MainPID)" != "$1" ] && [ "$(property MainPID)" != 0 ]; }
answers_on_can() { timeout 2 candump -n 1 -T 1500 can0,700:70F 2>/dev/null | grep -q . & sleep 0.2; cansend can0 70F#FF; wait $!; }

finish() {
    echo "$1" >"$HIL_WORK/status"
    sync
    echo o >/proc/sysrq-trigger
    sleep 60
}

run_tests() {
    echo 1..11
    for n in 0 1 2 3 4; do ip link delete "can$n"; done
    for n in 0 1 2 3 4; do systemctl start "coman-hil-vcan@can$n"; done
    ip -br link show type vcan | grep -q can4
    result "the unit creates virtual interfaces" $?

    timeout 30 systemctl start coman-hil@coman
    result "systemctl start comes back when the loop has run its first tick" $?
    [ "$(property ActiveState)/$(property SubState)" = active/running ]
    result "it is running" $?
    within 10 eval 'property StatusText | grep -q " s  x"'
    result "its status line tells how it is" $?
    [ "$(ps -o user= -p "$(property MainPID)")" != root ]
    result "it does not run as root" $?
    answers_on_can
    result "its boards answer on can0" $?

    pid=$(property MainPID)
    timeout 20 systemctl reload coman-hil@coman
    within 10 eval 'journalctl --no-pager -u coman-hil@coman | grep -q "reload: starting anew"' &&
        within 10 answers_on_can && [ "$(property MainPID)" = "$pid" ]
    result "reload starts the rig anew in the same process" $?

    kill -STOP "$pid"
    within 20 main_pid_is_not "$pid" && within 10 answers_on_can
    result "a stopped process is found by the watchdog and started anew" $?
    journalctl --no-pager -u coman-hil@coman | grep -qi watchdog
    result "the journal says so" $?

    timeout 20 systemctl stop coman-hil@coman
    [ "$(property ActiveState)" = inactive ] && [ "$(property Result)" = success ]
    result "stop ends it well" $?
    systemctl stop coman-hil-vcan@can0
    ! ip link show can0 >/dev/null 2>&1
    result "the unit removes the interface" $?
    journalctl --no-pager -o cat -u coman-hil@coman | head -n 40 | sed 's/^/# /'
    finish 0
}

case ${1:-} in
guest) guest ;;
test) run_tests ;;
*) host ;;
esac
