#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Protocols that a file describes, over the buses: the compact protocol by its file gives the bytes
# of the one in the program, on every bus and through start-up, commands and telemetry; the frame of
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

echo 1..57
hold coman-compact 400
hold coman-described 400
tap_show=$work/out
diff "$work/coman-compact/candump.log" "$work/coman-described/candump.log" >"$work/out" &&
    [ "$(wc -l <"$work/coman-described/candump.log")" -gt 10000 ]
result $? "the file of the compact protocol gives the bytes of its name"

hold coman-mini-cheetah 1000
still coman-mini-cheetah
hold coman-odrive 1000
still coman-odrive
hold coman-robstride 1000
still coman-robstride

# the drives that robots of today have: each holds the robot, and each squats it as its own host
for name in damiao robstride-mit cubemars-mit cubemars-servo myactuator-rmd vesc; do
    hold coman-$name 1000
    still coman-$name
done
for name in damiao robstride cubemars-servo vesc; do
    tap_show=$work/out
    timeout -k 5 100 "$program" run coman-$name --transport local --clock lockstep \
        --control none --task squat --ticks 1500 --quiet >"$work/out" 2>&1 </dev/null &&
        grep -q ' 0 malformed, 0 time-outs, 0 trips' "$work/out" && ! grep -qi 'fell' "$work/out"
    result $? "coman-$name squats in lockstep"
done

# the makers' motors on a small arm: each holds it under its weight for ten seconds, and moves it
# along a trajectory
cat >"$work/wave.csv" <<'END'
time_s,yaw_rad,pitch_rad,elbow_rad
0,0,0.8,0.9
1,0.6,0.3,1.6
2,-0.6,1.2,0.4
3,0,0.8,0.9
END
for name in damiao robstride robstride-mit cubemars-mit cubemars-servo myactuator-rmd vesc; do
    for task in hold "follow --trajectory $work/wave.csv"; do
        tap_show=$work/out
        # shellcheck disable=SC2086
        timeout -k 5 100 "$program" run arm-$name --transport local --clock lockstep \
            --control none --task $task --quiet --record "$work/arm-$name-${task%% *}" \
            >"$work/out" 2>&1 </dev/null &&
            grep -q ' 0 malformed, 0 time-outs, 0 trips' "$work/out"
        result $? "the motors of arm-$name carry out the task ${task%% *}"
    done
done

# Kt Kw / R = 0.546 Nm/A x 0.5457 V s/rad / 0.17 ohm = 1.7526 Nm s/rad is count 1435 of kd, and 20/s
# times that is 287 of kp: gains that an AK80-6 bears
tap_show=$work/out
grep -c ' can0 002#[0-9A-F]\{7\}11F59B[0-9A-F]\{3\}$' "$work/arm-cubemars-mit-hold/candump.log" \
    >"$work/out" && [ "$(cat "$work/out")" -gt 10000 ]
result $? "the host asks a small drive for the damping of its winding"

# stop and its answer, the parameter of the mode, enable, commands with the torque in bits 8 to 23
tap_show=$work/coman-robstride/candump.log
grep -q ' can0 0400FD01#0000000000000000$' "$tap_show" &&
    grep -q ' can0 020001FD#[0-9A-F]\{16\}$' "$tap_show" &&
    grep -q ' can0 1200FD02#0570000000000000$' "$tap_show" &&
    grep -q ' can0 0300FD03#0000000000000000$' "$tap_show" &&
    grep -q ' can0 028003FD#[0-9A-F]\{16\}$' "$tap_show" &&
    [ "$(grep -o ' can0 01[0-9A-F]\{4\}01#' "$tap_show" | sort -u | wc -l)" -gt 1 ]
result $? "drives of RobStride speak with fields in 29-bit identifiers"

# replay: what the controller sent is played to drives, whose own frames of the log are left out
hashed()
{
    timeout -k 5 100 "$program" run coman-robstride --transport local --clock lockstep \
        --control none --quiet "$@" 2>"$work/err" </dev/null | sed -n 's/^ *state hash //p'
}
tap_show="$work/err"
first=$(hashed --task hold --ticks 300 --record "$work/recorded")
[ -n "$first" ] && [ "$first" = "$(hashed --stimulus "$work/recorded")" ]
result $? "a recorded run with 29-bit identifiers repeats"

# the DBC: extended identifiers, which bits carry values, and what
tap_show=$work/robstride.dbc
"$program" dbc coman-robstride --bus torso -o "$work/robstride.dbc" >"$work/out" 2>&1 &&
    grep -q "^BO_ $((0x81000001)) torso_0x01_CONTROL_0: 8 host$" "$tap_show" &&
    grep -q "^BA_ \"VFrameFormat\" BO_ $((0x81000001)) 1;$" "$tap_show" &&
    grep -q "^BA_ \"IdentifierMask\" BO_ $((0x81000001)) $((0xffff00));$" "$tap_show" &&
    grep -q "^CM_ BO_ $((0x81000001)) \"in the identifier 8|16@1+ torque (0.0036" "$tap_show"
result $? "its DBC has extended identifiers and says which bits carry values"
tap_show=$work/out
"$program" protocol robstride >"$work/out" 2>&1 &&
    grep -q '^Answer: FEEDBACK, id 0x02000080 + 0x100 a, 8 bytes, 29-bit identifier' "$work/out" &&
    grep -q '^- identifier bits 16-21 `faults`: u6$' "$work/out"
result $? "its page has the fields of the identifier"

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
    grep -q '^Answer: ENCODER_ESTIMATES, id 0x009 + 0x20 a, 8 bytes, every 10 ms.' "$work/out"
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
result $? "the DBC of the file has the signals of its name"

sed '/^```yaml$/,/^```$/!d' "$HIL_SOURCE_DIR/docs/own-boards.md" >"$work/yaml"
awk '/^```/{n++; next} n==3' "$work/yaml" >"$work/my.yaml"
awk '/^```/{n++; next} n==5' "$work/yaml" >"$work/mine.yaml"
timeout -k 5 100 "$program" run "$work/mine.yaml" --transport local --clock free \
        --task hold --ticks 1500 --quiet --record "$work/mine" >"$work/out" 2>&1 </dev/null
result $? "the example of the guide runs"
still mine

sed 's/bits: 12, order: big, target: kp/bits: 40, order: big, target: kp/' \
    "$HIL_SOURCE_DIR/config/protocols/mini-cheetah.yaml" >"$work/wrong.yaml"
"$program" protocol "$work/wrong.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -qE 'wrong.yaml:[0-9]+:[0-9]+: .*40.*1 to 32' "$work/out"
result $? "a field that is too long is refused with its place"

# identifiers that collide: on every bus, and of the boards of a rig
tap_show=$work/out
sed 's/id: 0x300/id: 0x200/' "$work/my.yaml" >"$work/equal.yaml"
"$program" protocol "$work/equal.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'equal.yaml:[0-9]*:9: found identifier 0x201 of frame "STATUS"' "$work/out"
result $? "one identifier of host and board is refused with its place"
sed 's/id: 0x300/id: 0x201/' "$work/my.yaml" >"$work/shifted.yaml"
sed 's/my.yaml/shifted.yaml/' "$work/mine.yaml" >"$work/shifted-rig.yaml"
"$program" check "$work/shifted-rig.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] &&
    grep -q 'coman-mini-cheetah.yaml:[0-9]*:[0-9]*: found board torso/0x02, whose' "$work/out" &&
    grep -q ' the identifier 0x202 that frame STATUS of board torso/0x01 (line' "$work/out"
result $? "identifiers of two boards that collide are refused with both boards"

# CAN FD with counters and checksums both ways: no board refuses a frame of the host's, every frame
# has the checksum of another implementation and every count follows the one before it
cp "$HIL_SOURCE_DIR/tests/service/checked.yaml" "$work/checked.yaml"
printf 'extends: coman-fd\nname: checked\nprotocol: checked.yaml\n' \
    >"$work/checked-rig.yaml"
tap_show=$work/out
timeout -k 5 100 "$program" run "$work/checked-rig.yaml" --transport local --clock free \
    --task hold --ticks 300 --control none --record-period 1 --quiet --record "$work/checked" \
    >"$work/out" 2>&1 </dev/null &&
    grep -q ' 0 foreign, 0 unknown commands, 0 malformed' "$work/out"
result $? "a protocol with CAN FD, counters and checksums runs"
python3 - "$work/checked/candump.log" >"$work/out" 2>&1 <<'END'
import collections, functools, re, sys


def crc8_sae_j1850(data):
    """The remainder of a long division of the whole message by x^8 + x^4 + x^3 + x^2 + 1."""
    rest = int.from_bytes(bytes([data[0] ^ 0xff]) + data[1:], "big") << 8
    for bit in range(rest.bit_length() - 1, 7, -1):
        if rest >> bit & 1:
            rest ^= 0x11d << bit - 8
    return rest ^ 0xff


assert crc8_sae_j1850(b"123456789") == 0x4b
xor = functools.partial(functools.reduce, lambda a, b: a ^ b)
counts, seen, wrong = {}, collections.Counter(), []
for line in open(sys.argv[1]):
    bus, word, data = re.fullmatch(r"\(\S+\) (\S+) (\w+)##?(\w+)\n", line).groups()
    number = int(word, 16)
    data = bytes.fromhex(data[1:] if "##" in line else data)
    first = number < 0x140 or 0x180 <= number < 0x240
    good = data[0] == crc8_sae_j1850(data[1:]) if first else data[-1] == xor(data[:-1])
    if number < 0x240:
        count, key = data[1 if first else 0] & 0xf, (bus, number)
        good = good and count == (counts.get(key, -1) + 1) % 16
        counts[key] = count
    seen[number >> 6] += 1
    if not good:
        wrong.append(line)
print(seen, len(wrong), wrong[:1])
sys.exit(bool(wrong) or len(seen) < 4 or min(seen.values()) < 23)
END
result $? "its checksums and counters are right"
mkdir "$work/dbc-checked" && "$program" dbc "$work/checked-rig.yaml" -o "$work/dbc-checked" \
    >"$work/out" 2>&1 &&
    grep -q '"alive counts the frames; byte 0 is the CRC-8 SAE J1850 of the others"' \
        "$work/dbc-checked/checked-left.dbc"
result $? "its DBC says what counts and what is a checksum"
if /usr/bin/python3 -c 'import canmatrix.formats' 2>/dev/null; then
    /usr/bin/python3 "$HIL_SOURCE_DIR/tests/service/dbc_judge.py" checked "$work/dbc-checked" \
        "$work/checked" 1 8000 >"$work/out" 2>&1
    result $? "its frames read by canmatrix are what the plant did"
else
    result 0 "its frames read by canmatrix # SKIP python3-canmatrix is not installed"
fi
exit "$failed"
