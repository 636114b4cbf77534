#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""run --gateway with an unmodified client: python-can's socketcand interface joins local buses.

In lockstep the client drives virtual time by STEP frames, switches a motor on and reads the current
that its voltage makes; two such runs leave the same recording. With the real clock telemetry comes
by itself. Everything on the torso's bus, so that a command cannot be overtaken by a STEP on another
connection. Prints TAP.
"""
import filecmp
import logging
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback

try:
    import can
except ImportError:
    print("1..1\nok 1 - gateway # SKIP python-can is not installed (Debian package python3-can)")
    sys.exit(0)

logging.getLogger("can").setLevel(logging.ERROR)  # it warns of the newlines between frames
PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
RIG = os.path.join(os.environ["HIL_SOURCE_DIR"], "config", "rigs", "coman.yaml")
WORK = tempfile.TemporaryDirectory()
STEP, DONE = 0x6F0, 0x6FF
PATIENCE_S = 20


class Simulator:
    def __init__(self, *arguments):
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "run", RIG, "--transport", "local", "--gateway", "0", "--quiet", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        self.buses = []
        end = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"^gateway: (\S+) port (\d+)$", self.text(), re.M)):
            assert self.process.poll() is None and time.monotonic() < end, self.text()
            time.sleep(0.02)
        self.host, self.port = found[1], int(found[2])

    def text(self):
        return open(self.log.name).read()

    def join(self, channel):
        bus = can.Bus(interface="socketcand", host=self.host, port=self.port, channel=channel)
        self.buses.append(bus)
        return bus

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        for bus in self.buses:
            bus.shutdown()
        self.process.send_signal(signal.SIGINT)
        try:
            self.status = self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()


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
    lockstep_session(os.path.join(WORK.name, "first"))


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
    for text in ("x", "70000", ":1", "localhost:1", "1.2.3.4:x"):
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
