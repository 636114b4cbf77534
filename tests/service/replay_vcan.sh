#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Recorded frames onto live buses (run it through tests/bus/uml/run.sh): which, in which order,
# when. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/*.out $work/*.err"

# listen NAME ARGUMENT...: what candump hears while the program replays
listen()
{
    local name=$1
    shift
    candump -r 4000000 -L can0 can1 >"$work/$name.log" 2>/dev/null &
    local listener=$!
    for _ in $(seq 100); do
        [ "$(grep -c '^ *can[01] ' /proc/net/can/rcvlist_all)" = 2 ] && break
        sleep 0.1
    done
    "$program" replay "$@" >"$work/$name.out" 2>"$work/$name.err" </dev/null
    status=$?
    local sent
    sent=$(awk '/ frames sent, / { sent += $2 } END { print sent }' "$work/$name.out")
    for _ in $(seq 100); do
        [ "$(wc -l <"$work/$name.log")" -ge "$sent" ] && break
        sleep 0.1
    done
    kill $listener
    wait $listener 2>/dev/null
}

# of LOG BUS: its frames
of() { awk -v bus="$2" '$2 == bus { print $3 }' "$1"; }

echo 1..6

"$program" run coman --transport local --clock lockstep --task squat --duration 0.15 --wire ideal \
    --record "$work/run" --control none --quiet >"$work/run.out" 2>"$work/run.err" </dev/null
log=$work/run/candump.log

# A tenth of the speed: a frame takes a guest 0.2 ms
listen all "$work/run" --onto can0 --onto can1 --speed 0.1
[ $status -eq 0 ] && cmp -s <(of "$log" can0) <(of "$work/all.log" can0) &&
    cmp -s <(of "$log" can1) <(of "$work/all.log" can1) && [ -s "$work/all.log" ]
result $? "every frame of the chosen interfaces is sent, in order"

grep -qE "can0: [0-9]+ frames sent, 0 lost; late by p50 .* ms, p99 .* ms, max .* ms" "$work/all.out"
result $? "it says what was sent and how late"

# A frame of each tick, every 20 ms: delays do not add up. A busy guest may be late with most of
# them, but is prompt with one of fifty: the least lateness of each third is the same.
listen timed "$work/run" --onto can1 --id 0x6ff --speed 0.05
python3 - "$log" "$work/timed.log" <<'END'
import sys
def times(path):
    rows = [line.split() for line in open(path)]
    return [float(t.strip("()")) for t, bus, f in rows if bus == "can1" and f.startswith("6FF#")]
then, now = (times(path) for path in sys.argv[1:])
late = [(b - now[0]) - 20 * (a - then[0]) for a, b in zip(then, now)]
third = len(late) // 3
least = [min(late[i * third:(i + 1) * third]) for i in range(3)]
print(f"# {len(now)} frames, the least lateness of each third:", *(f"{t:.6f} s" for t in least))
sys.exit(not (len(then) == len(now) >= 90 and max(least) - min(least) < 0.02))
END
result $? "at their times"

listen some "$log" --speed 0.2 --onto can1=can0 --id 0x6f0 --id 0x6ff..0x700 --onto can0=can1
chosen='^(6F0|6FF|700)#'
[ $status -eq 0 ] && cmp -s <(of "$log" can1 | grep -E "$chosen") <(of "$work/some.log" can0) &&
    cmp -s <(of "$log" can0 | grep -E "$chosen") <(of "$work/some.log" can1)
result $? "chosen identifiers, onto other interfaces"

listen part "$work/run" --onto can1 --from 0.05 --to 0.1 --speed 0.2
awk '{ t = substr($1, 2) + 0 } t >= 0.05 && t <= 0.1' "$log" >"$work/span.log"
cmp -s <(of "$work/span.log" can1) <(of "$work/part.log" can1) && [ -s "$work/part.log" ]
result $? "a part of it"

"$program" replay "$work/run" --onto no-such-if >"$work/none.out" 2>"$work/none.err"
[ $? -eq 2 ] && grep -q no-such-if "$work/none.err"
result $? "an interface that is not there is an error"
