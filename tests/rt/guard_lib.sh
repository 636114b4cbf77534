# SPDX-License-Identifier: Apache-2.0
# Sourced by the tests that run the program under the guard: guarded NAME RIG ARGUMENT..., then a
# TAP line by verdict. Expects $guard and $program.
# shellcheck shell=bash
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
number=0
failures=0
ulimit -c 0
rigs=${HIL_SOURCE_DIR:=$(cd "$(dirname "$0")/../.." && pwd)}/config/rigs

# guarded RIG ARGUMENT...: runs it; status, and the guard's words in $work/log
guarded()
{
    local rig=$1
    shift
    case " $* " in
    *" --control "*) ;;
    *) set -- --control none "$@" ;; # or anybody may steer it
    esac
    rm -rf "$work/log" "$work/record"
    touch "$work/log"
    {
        LD_PRELOAD=$guard RT_GUARD_LOG=$work/log RT_GUARD_FAULTS=${faults:-forbid} \
            timeout 180 "$program" run "$rig" --quiet "$@" </dev/null
        status=$?
    } >"$work/out" 2>"$work/err"
    # on a busy machine a controller in real time may be too late for its robot; the loop did what
    # it did
    case " $* " in
    *" --clock real "*) [ $status = 1 ] && grep -q 'task squat failed' "$work/err" && status=0 ;;
    esac
}

# calls NAME: how often the system call was made, by phase; nothing when never
calls()
{
    sed -n "s/^rt guard: $1  *\([0-9 ]*[0-9]\).*/\1/p" "$work/log"
}

# verdict NAME CONDITION...: good when the run was and the condition holds
verdict()
{
    local name=$1
    shift
    number=$((number + 1))
    if [ "$status" = 0 ] && grep -q '^rt guard: clock' "$work/log" && "$@"; then
        echo "ok $number - $name"
        sed 's/^/# /' "$work/log"
    else
        echo "not ok $number - $name (status $status)"
        tail -n 20 "$work/log" "$work/err" | sed 's/^/# /'
        failures=$((failures + 1))
    fi
}

# only NAME...: no other system calls were made
only()
{
    local found name
    found=$(sed -n 's/^rt guard: \([a-z_]*\)  *[0-9][0-9 ]*   .*/\1/p' "$work/log")
    for name in $found; do
        case " $* " in
        *" $name "*) ;;
        *) echo "# also $name"; return 1 ;;
        esac
    done
}
