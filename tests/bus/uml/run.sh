#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Runs a command on a kernel that has CAN, whatever the kernel of the machine: boots user-mode Linux
# with this machine's files as its read-only root, loads the CAN modules, creates the virtual
# interfaces can0 to can4, runs the command, powers off.
#
#   run.sh [-t SECONDS] [-x] COMMAND [ARGUMENT...]
#
# With -x the command takes the place of the guest's first process: it writes what it has to say to
# $HIL_WORK/output, its exit status to $HIL_WORK/status, and powers off.
# The command's output goes to standard output; the exit status is the command's, 70 when the guest
# did not come to its end (its console is shown as TAP comments). Without user-mode Linux the TAP
# plan is one skipped test with the reason. HIL_SOURCE_DIR and HIL_BINARY_DIR are passed on; the
# guest can write to HIL_BINARY_DIR, HIL_WORK (a temporary directory, kept when HIL_WORK_KEEP is
# set) and /tmp, which is its own.
#
# On a CPU whose XSAVE area is larger than the buffer of linux.uml (2,696 bytes; with AMX it is
# 11,008) the guest's ptrace is that of preload_xsave.c; HIL_UML_XSAVE=always or never, for tests,
# says when. HIL_UML_PRELOAD, for tests too, is a library to preload before it,
# HIL_UML_ENVIRONMENT a variable NAME=VALUE for the guest's processes.
set -u

limit=120
if [ "${1:-}" = -t ]; then
    limit=$2
    shift 2
fi
limit=$((3 * limit)) # as ctest's: it ends what hangs, and a busy machine takes its time
first=
if [ "${1:-}" = -x ]; then
    first=yes
    shift
fi
if [ $# -eq 0 ]; then
    sed -n 's/^#   //p' "$0" >&2
    exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
: "${HIL_SOURCE_DIR:=$(cd "$here/../../.." && pwd)}"
: "${HIL_BINARY_DIR:=$PWD}"

skip() {
    printf '1..1\nok 1 - user_mode_linux # SKIP %s\n' "$1"
    exit 0
}

kernel=$(command -v linux.uml) || skip "linux.uml is not installed (Debian package user-mode-linux)"
ls /usr/lib/uml/modules/*/kernel/net/can/can-raw.ko >/dev/null 2>&1 ||
    skip "the CAN modules of user-mode Linux are not installed"
for program in insmod ip pkill setsid taskset; do
    command -v "$program" >/dev/null ||
        skip "$program is not installed (kmod, iproute2, procps, util-linux)"
done
[ "$(id -u)" = 0 ] ||
    skip "the guest's root needs to read everything the host's root can: run as root"

work=$(mktemp -d /tmp/hil-uml-XXXXXX) || exit 70
session=
clean_up() {
    # whatever is left of the guest: its processes have a session of their own
    [ -n "$session" ] && pkill -KILL -s "$session" 2>/dev/null
    [ -n "${HIL_WORK_KEEP:-}" ] || rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 70' INT TERM HUP

cp "$here/init.py" "$work/init" || exit 70
printf '%s\0' CMOCKA_MESSAGE_OUTPUT=TAP HIL_UML=1 "HIL_SOURCE_DIR=$HIL_SOURCE_DIR" \
    "HIL_BINARY_DIR=$HIL_BINARY_DIR" >"$work/environment"
# an empty word: the command takes the place of the first process
printf '%s\0' ${first:+""} "$@" >"$work/command"

# the guest's memory is a sparse file; a small /dev/shm, as in containers, would kill it half-way
shm_kib=$(df --output=avail -k /dev/shm 2>/dev/null | tail -n 1)
[ "${shm_kib:-0}" -ge 700000 ] || export TMPDIR=$work

# the ptrace for large XSAVE areas; xsave_area is built on x86-64 only
case ${HIL_UML_XSAVE:-auto} in
always) xsave_area=1000000 ;;
never) xsave_area=0 ;;
*) xsave_area=$("$HIL_BINARY_DIR/tests/xsave_area" 2>/dev/null) ;;
esac
preload=${HIL_UML_PRELOAD:-}
[ "${xsave_area:-0}" -le 2696 ] || preload=${preload:+$preload:}$HIL_BINARY_DIR/tests/uml_xsave.so

# one processor: a guest that wanders between two is three times slower
processor=$(taskset -cp $$ | sed 's/.*[:,-] *//')

# job control off: the background process is no group leader, so that setsid keeps its id
setsid taskset -c "$processor" timeout -k 5 "$limit" \
    env ${preload:+"LD_PRELOAD=$preload"} \
    "$kernel" mem=512M root=/dev/root rootfstype=hostfs rootflags=/ ro \
    init="$work/init" HIL_WORK="$work" PYTHONHASHSEED=0 \
    ${HIL_UML_ENVIRONMENT:+"$HIL_UML_ENVIRONMENT"} \
    con=null con0=fd:0,fd:1 pty.legacy_count=0 quiet panic=1 \
    </dev/null >"$work/console" 2>&1 &
session=$!
# show the output while it comes; the status file marks its end
touch "$work/output"
tail -f -n +1 --pid="$session" -s 0.1 "$work/output" &
follower=$!
wait "$session"
wait "$follower"

if [ ! -s "$work/status" ]; then
    echo "Bail out! the guest did not finish within $limit s; its console:"
    tail -n 40 "$work/console" | tr -d '\r' | sed 's/^/# /'
    exit 70
fi
exit "$(cat "$work/status")"
