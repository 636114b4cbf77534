#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds a recorded run against its DBC files, read and decoded by canmatrix, which knows nothing of
us: dbc_judge.py RIG FOLDER RECORD FIRST_NUMBER LEAST [LAG]. Answers to commands tell what was LAG s
before.

Every frame must be of a message and have its sender's length; what boards say of a joint (the
signal's comment) must be what the plant had, to within half of the last bit of signal and encoder.
Its signals carry the joint's name, or that of the force's component. Prints three TAP lines, and
two more for icub boards: what an encoder makes of a voltage, and that
byte 0 has names."""
import csv
import glob
import math
import re
import sys

import canmatrix.formats
import tap

rig, folder, record, first, least = sys.argv[1:4] + [int(x) for x in sys.argv[4:6]]
lag_s = float(sys.argv[6]) if len(sys.argv) > 6 else 0
tap.begin(first)
# signals by name without the joint: the columns that are added up, with their factors
STATE = {
    "position": [("q_*_rad", 1)],
    "motor_position": [("qm_*_rad", 1)],
    "motor_encoder": [("qm_*_rad", 1)],
    "link_position": [("q_*_rad", 1)],
    "deflection": [("qm_*_rad", 1), ("q_*_rad", -1)],
    "current": [("current_*_a", 1)],
    "torque": [("torque_*_nm", 1)],
    "spring_torque": [("torque_*_nm", 1)],
}
# what the encoders of config/rigs/coman.yaml add to the signal's own step where that is finer, rad
LINK_TICK, MOTOR_TICK = 2 * math.pi / 4096, 2 * math.pi / 409600
ENCODER = {
    "position": LINK_TICK,
    "link_position": LINK_TICK,
    "motor_position": MOTOR_TICK,
    "motor_encoder": MOTOR_TICK,
    "deflection": LINK_TICK + MOTOR_TICK,
}


def check(good, name, found):
    tap.check(good, f"{rig}: {name}", found)


def quantity(frame, signal):
    name = signal.name.removeprefix(f"{signal.comment}_")
    if frame.name.endswith("_MOTOR_POSITION") or frame.name.endswith("_FOC") and name == "position":
        return "motor_position"
    return name


with open(record + "/signals.csv") as file:
    rows = {round(float(r["time_s"]) * 1e6): r for r in csv.DictReader(file)}
buses, masked = {}, {}
for path in glob.glob(f"{folder}/{rig}-*.dbc"):
    matrix = canmatrix.formats.loadp_flat(path)
    interface = re.search(r'CM_ "Rig \S+, bus \S+ on (\w+):', open(path).read()).group(1)
    # 29-bit identifiers by the bits that carry no values
    buses[interface] = {(f.arbitration_id.id, bool(f.arbitration_id.extended)): f
                        for f in matrix.frames}
    masked[interface] = [(int(f.attributes.get("IdentifierMask", 0)), f) for f in matrix.frames
                         if int(f.attributes.get("IdentifierMask", 0))]

frames, strange, compared, worst, wrong = 0, set(), {}, 0.0, []
with open(record + "/candump.log") as log:
    for line in log:
        time, bus, id_hex, fd, data = re.fullmatch(
            r"\((\S+)\) (\S+) ([0-9A-F]{3}|[0-9A-F]{8})#(#[0-9A-F])?(\S*)\n", line).groups()
        number, extended = int(id_hex, 16), len(id_hex) == 8
        frame = buses[bus].get((number, extended)) or next(
            (f for mask, f in masked[bus] if bool(f.arbitration_id.extended) == extended
             and number & ~mask == f.arbitration_id.id), None)
        frames += 1
        data = bytes.fromhex(data)
        from_host = frame is not None and "host" in frame.transmitters
        if frame is None or len(data) > frame.size or bool(fd) != frame.is_fd:
            strange.add(line)
            continue
        if from_host or frame.is_multiplexed or len(data) < frame.size:
            if not from_host and not frame.is_multiplexed and not frame.name.endswith("ORCE"):
                strange.add(line)
            continue
        row = rows.get(round((float(time) - lag_s) * 1e6))
        if not row:
            continue
        values = frame.decode(data)
        for signal in frame.signals:
            what = quantity(frame, signal)
            if what not in STATE or not signal.comment or f"q_{signal.comment}_rad" not in row:
                continue
            scale = {"mA": 1e-3, "A": 1, "rad": 1, "Nm": 1}[signal.unit]
            truth = sum(k * float(row[c.replace("*", signal.comment)]) for c, k in STATE[what])
            step = float(signal.factor) * scale
            error = abs(float(values[signal.name].phys_value) * scale - truth)
            coarse = ENCODER.get(what, 0)
            # a deflection is the difference of two rounded numbers
            allowed = (1.01 if what == "deflection"
                       else 0.505) * step
            if abs(step - coarse) > 0.01 * coarse:
                allowed += coarse / 2
            compared[what] = compared.get(what, 0) + 1
            worst = max(worst, error / allowed)
            if error > allowed:
                wrong.append(
                    f"{bus} {frame.name} {signal.name} {time}: {error:.3g} of {allowed:.3g} off")
check(not strange, "every frame is of a message, in its length and format",
      f"{frames} frames, {len(strange)} strange {next(iter(strange), '').strip()}")
check(not wrong and sum(compared.values()) >= least and len(compared) >= 2,
      "decoded values are those of the plant to within half a bit",
      f"{compared}, the worst at {worst:.3f} of its half bit; {len(wrong)} wrong: {wrong[:1]}")
names, odd = 0, []
for bus in buses.values():
    for frame in bus.values():
        own = [s.name for s in frame.signals]
        if len(set(own)) < len(own) or max(map(len, own), default=0) > 32:
            odd.append(frame.name)
        for signal in frame.signals:
            if signal.comment and not frame.is_multiplexed and "host" not in frame.transmitters:
                names += 1
                if not signal.name.startswith(f"{signal.comment}_") and \
                        signal.name not in ("fx", "fy", "fz", "mx", "my", "mz"):
                    odd.append(f"{frame.name}.{signal.name}")
check(names > 20 and not odd, "signals are named after joints and components, once in a message",
      f"{names} names, odd ones: {odd[:3]}")

command = next((f for b in buses.values() for f in b.values()
                if f.signal_by_name("SET_OPEN_LOOP_pwm_1")), None)
if command:
    made = []
    for axis, byte in ((0, 0x72), (1, 0xF2)):
        signal = command.signal_by_name(f"SET_OPEN_LOOP_pwm_{axis}")
        raw = command.encode({"command": byte, signal.name: int(signal.phys2raw(25))})
        made.append(raw[: int(signal.attributes["FrameLength"])].hex())
    check(made == ["724d01", "f24d01"],
          "25 % of the voltage, encoded for either axis, is the firmware's frame", made)
    names = command.signal_by_name("command").values
    check(names[0x72] == "SET_OPEN_LOOP_0" and names[0xF2] == "SET_OPEN_LOOP_1"
          and all(str(n).endswith("_0" if v < 128 else "_1") for v, n in names.items()),
          "byte 0 has a name for each command and axis", f"{len(names)} values")
sys.exit(tap.failed > 0)
