#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Protocols that a file describes, over the buses: the compact protocol as a file gives the bytes of
# the one in C, on every bus and through start-up, switching, commands and telemetry; the frame of
# quadruped actuators and ODrive's hold the robot; a file of one's own that is wrong is refused with
# its place. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
program=$HIL_BINARY_DIR/coman-hil

# hold RIG TICKS: so many ticks of the hold task, recorded
hold()
{
    tap_show=$work/$1.err
    timeout -k 5 100 "$program" run "$1" --transport local --clock free --task hold --ticks "$2" \
        --quiet --record "$work/$1" >"$work/$1.out" 2>"$work/$1.err" </dev/null
    result $? "the run of $1 ends with status 0"
}

# still RIG: motors went on, and no joint is farther than 0.05 rad from where it began
still()
{
    tap_show=$work/out
    python3 - "$work/$1/signals.csv" >"$work/out" <<'END'
import csv, sys
rows = list(csv.reader(open(sys.argv[1])))
head, first, last = rows[0], rows[1], rows[-1]
columns = [i for i, name in enumerate(head) if name.startswith("q_")]
far = [head[i] for i in columns if abs(float(last[i]) - float(first[i])) > 0.05]
print(len(columns), "joints, too far:", far)
sys.exit(len(columns) < 20 or bool(far))
END
    result $? "$1 stands where it stood"
}

echo 1..14
hold coman-compact 400
hold coman-described 400
tap_show=$work/out
diff "$work/coman-compact/candump.log" "$work/coman-described/candump.log" >"$work/out" &&
    [ "$(wc -l <"$work/coman-described/candump.log")" -gt 10000 ]
result $? "the described compact protocol has the bytes of the one in C"

hold coman-mini-cheetah 1000
still coman-mini-cheetah
hold coman-odrive 1000
still coman-odrive

# the first frames of the start: leave, its answer, enter, commands of eight bytes
tap_show=$work/coman-mini-cheetah/candump.log
grep -q ' can0 001#FFFFFFFFFFFFFFFD$' "$tap_show" &&
    grep -q ' can0 000#01[0-9A-F]\{10\}$' "$tap_show" &&
    grep -q ' can0 003#FFFFFFFFFFFFFFFC$' "$tap_show"
result $? "drives of the mini cheetah are switched and answer"

tap_show=$work/out
"$program" dbc coman-mini-cheetah --bus torso -o "$work/torso.dbc" >"$work/out" 2>&1 &&
    grep -q 'SG_ kp : 27|12@0+ (0.1221001221001221,0) \[0|500\] "Nm/rad"' "$work/torso.dbc"
result $? "its DBC has the packed fields"
"$program" protocol "$HIL_SOURCE_DIR/config/protocols/odrive.yaml" >"$work/out" 2>&1 &&
    grep -q '^Answer: ENCODER_ESTIMATES, id 0x009 + 0x20 a, 8 bytes, every 2 ms.' "$work/out"
result $? "a page says what a file describes"

# signals RIG: what the DBC files of a rig have of telemetry, states and commands
signals()
{
    mkdir "$work/dbc-$1" && "$program" dbc "$1" -o "$work/dbc-$1" >"$work/out" 2>&1 &&
        cat "$work/dbc-$1"/*.dbc | grep -E '^ SG_ ([A-Za-z]+_[a-z_]+|[fm][xyz]) ' | sort
}
tap_show=$work/out
diff <(signals coman-compact) <(signals coman-described) >"$work/out" &&
    [ "$(signals coman-odrive | grep -c pos_estimate)" -eq 23 ]
result $? "the DBC of the described protocol has the signals of the one in C"

sed '/^```yaml$/,/^```$/!d' "$HIL_SOURCE_DIR/docs/own-boards.md" | awk '/^```/{n++; next} n==3' \
    >"$work/my.yaml"
cp -r "$HIL_SOURCE_DIR/config" "$work/config" && cp "$work/my.yaml" "$work/config/protocols/" &&
    sed 's/^name: .*/name: mine/; s/mini-cheetah.yaml$/my.yaml/' \
        "$HIL_SOURCE_DIR/config/rigs/coman-mini-cheetah.yaml" >"$work/config/rigs/mine.yaml" &&
    timeout -k 5 100 "$program" run "$work/config/rigs/mine.yaml" --transport local --clock free \
        --task hold --ticks 1500 --quiet --record "$work/mine" >"$work/out" 2>&1 </dev/null
result $? "the example of the guide runs"
still mine

sed 's/bits: 12, order: big, target: kp/bits: 40, order: big, target: kp/' \
    "$HIL_SOURCE_DIR/config/protocols/mini-cheetah.yaml" >"$work/wrong.yaml"
"$program" protocol "$work/wrong.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -qE 'wrong.yaml:[0-9]+:[0-9]+: .*40.*1 to 32' "$work/out"
result $? "a field that is too long is refused with its place"
exit "$failed"
