#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""run --gateway with an unmodified client: python-can's socketcand interface joins local buses.

In lockstep the client drives virtual time by STEP frames, switches a motor on and reads the current
that its voltage makes; two such runs leave the same recording. With the real clock telemetry comes
by itself. gateway_lockstep.py has clients of several buses. Prints TAP.
"""
import filecmp
import logging
import os
import re
import struct
import subprocess
import sys
import tempfile
import time
import traceback

try:
    import can
    from gateway_simulator import PATIENCE_S, PROGRAM, RIG, Simulator
except ImportError:
    print("1..1\nok 1 - gateway # SKIP python-can is not installed (Debian package python3-can)")
    sys.exit(0)

WORK = tempfile.TemporaryDirectory()
STEP, DONE = 0x6F0, 0x6FF
complaints = []  # of python-can about what it was sent


class Listener(logging.Handler):
    def emit(self, record):
        complaints.append(record.getMessage())


logging.getLogger("can").setLevel(logging.WARNING)
logging.getLogger("can").addHandler(Listener())


def send(bus, identifier, data):
    bus.send(can.Message(arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=False))


def receive(bus, wanted):
    """The frames up to the first that wanted accepts."""
    frames, end = [], time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        frame = bus.recv(1.0)
        if frame:
            frames.append(frame)
            if wanted(frame):
                return frames
    raise AssertionError("timed out; the last frames: %s" % frames[-5:])


class Stepper:
    """Virtual time by STEP and DONE on one bus."""

    def __init__(self, bus):
        self.bus, self.tick = bus, 0

    def step(self, ticks=1):
        send(self.bus, STEP, struct.pack("<IH", self.tick, ticks).hex())
        frames = receive(self.bus, lambda frame: frame.arbitration_id == DONE)
        self.tick, flags = struct.unpack("<IH", bytes(frames[-1].data))
        return frames[:-1], flags


def lockstep_session(record):
    with Simulator("--clock", "lockstep", "--hold", "always", "--record", record) as simulator:
        bus = simulator.join("can0")
        stepper = Stepper(bus)
        send(bus, 0x70F, "FF")
        answers, flags = stepper.step()
        assert sorted(f.arbitration_id for f in answers
                      if f.data[:1] == b"\xff") == [0x710, 0x720, 0x7C0], answers
        assert stepper.tick == 1 and flags == 0
        send(bus, 0x001, "49 0D 00 00 00")   # POSITION, STATUS, CURRENT
        send(bus, 0x001, "09 50")            # axis 0: voltage mode
        stepper.step(10)
        send(bus, 0x001, "72 A6 00")         # 166 of 1333: 6 V
        frames, _ = stepper.step(20)
        currents = [struct.unpack_from("<h", f.data)[0] for f in frames
                    if f.arbitration_id == 0x114]
        assert len(currents) == 5, frames
        assert currents[0] != 0 and len(set(currents)) > 1, currents
        assert stepper.tick == 31
        send(bus, STEP, struct.pack("<IH", 7, 1).hex())
        refused = receive(bus, lambda frame: frame.arbitration_id == DONE)[-1]
        assert struct.unpack("<IH", bytes(refused.data)) == (31, 4), refused
        return currents


def test_lockstep_is_driven_by_a_client():
    complaints.clear()
    lockstep_session(os.path.join(WORK.name, "first"))
    # It reads 1024 bytes at a time: of a frame that is cut in two it may say so, and lose nothing
    bad = [text for text in complaints if "incomplete" not in text.lower()]
    assert len(bad) <= 1 and all(text.endswith("'\n'") for text in bad), bad


def test_frames_have_the_virtual_time_and_a_flood_loses_none():
    with Simulator("--clock", "lockstep", "--hold", "always") as simulator:
        bus, other = simulator.join("can0"), simulator.join("can0")
        stepper = Stepper(bus)
        stepper.step(7)
        send(bus, STEP, struct.pack("<IH", 7, 5).hex())
        done = receive(bus, lambda frame: frame.arbitration_id == DONE)[-1]
        assert done.timestamp == 0.012, done
        send(other, 0x7FE, "01")
        relayed = receive(bus, lambda frame: frame.arbitration_id == 0x7FE)[-1]
        assert relayed.timestamp == 0.012, relayed
        stepper.tick = 12
        send(bus, 0x001, "49 0F 00 00 00")
        send(bus, 0x002, "49 0F 00 00 00")
        frames, _ = stepper.step(2000)
        telemetry = [f for f in frames if f.arbitration_id in (0x111, 0x121)]
        assert len(telemetry) == 1000, len(telemetry)
        assert all(a.timestamp <= b.timestamp for a, b in zip(frames, frames[1:]))


def test_every_frame_of_a_flood_is_received_or_lost():
    with Simulator("--clock", "lockstep", "--hold", "always") as simulator:
        leg, torso = simulator.join("can1"), simulator.join("can0")
        for _ in range(6000):
            send(leg, 0x7FE, "01")
        Stepper(torso).step()
        for _ in range(5000):
            send(leg, 0x7FE, "01")
        time.sleep(0.5)
    said = re.search(r"^gateway: .* (\d+) frames to the buses, (\d+) rejected", simulator.text(),
                     re.M)
    row = re.search(r"^  left_leg +can1 +(\d+) +\d+ +(\d+)", simulator.text(), re.M)
    assert int(said[1]) > 6000 + 4096, said[0]
    assert int(row[1]) + int(row[2]) == int(said[1]) - 1, (said[0], row[0])


def test_two_lockstep_sessions_leave_the_same_bytes():
    assert lockstep_session(os.path.join(WORK.name, "second")) == \
        lockstep_session(os.path.join(WORK.name, "third"))
    for name in ("candump.log", "signals.csv"):
        assert filecmp.cmp(*(os.path.join(WORK.name, d, name) for d in ("second", "third")),
                           shallow=False)


def test_telemetry_comes_in_real_time_under_the_name_of_the_bus():
    with Simulator("--clock", "real", "--hold", "always") as simulator:
        leg, other = simulator.join("left_leg"), simulator.join("can1")
        send(leg, 0x70F, "FF")
        heard = receive(other, lambda frame: frame.arbitration_id == 0x7D0)
        assert heard[0].arbitration_id == 0x70F, "a client does not hear the others of its bus"
        receive(leg, lambda frame: frame.arbitration_id == 0x7D0)
        send(leg, 0x001, "49 01 00 00 00")
        frames = receive(leg, lambda frame, seen=[]: seen.append(frame) or len(
            [f for f in seen if f.arbitration_id == 0x111]) == 50)
        assert all(len(f.data) == 8 for f in frames if f.arbitration_id == 0x111)
    assert simulator.status == 0, simulator.text()
    assert re.search(r"^gateway: 2 clients, 0 refused, 0 disconnected; \d+ frames to the buses",
                     simulator.text(),
                     re.M), simulator.text()


def test_an_unknown_bus_is_refused():
    with Simulator("--clock", "lockstep") as simulator:
        try:
            simulator.join("nonsense")
        except Exception:
            return
        raise AssertionError("joined a bus that does not exist")


def test_what_is_no_address_is_refused():
    for text in ("x", "70000", ":1", "local:1", "1.2.3.4:x"):
        ended = subprocess.run([PROGRAM, "run", RIG, "--transport", "local", "--ticks", "1",
                                "--gateway", text],
                               capture_output=True, text=True, timeout=PATIENCE_S)
        assert ended.returncode == 2 and text.split(":")[0] in ended.stderr, (text, ended)


def main():
    tests = [(name, body) for name, body in globals().items() if name.startswith("test_")]
    print("1..%d" % len(tests))
    for number, (name, body) in enumerate(tests, 1):
        try:
            body()
            print("ok %d - %s" % (number, name[5:]))
        except Exception:
            print("not ok %d - %s" % (number, name[5:]))
            print("".join("# %s\n" % line for line in traceback.format_exc().splitlines()), end="")
        sys.stdout.flush()


main()
