#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Lockstep over vcan, can0 to can4 (see run.sh): the simulator and a controller that proves of
every tick that nothing was lost and nothing changed its place, in either direction.

lockstep.py COMAN_HIL [TICKS STRIDE]

Each STEP asks for some ticks. Before it the number of the tick is written into a parameter of
board 1 of every bus and read back: the one answer must carry it. Of the telemetry, which is
switched on, the identifiers between two DONE frames must be the same ones in the same order every
four STEPs, as the boards have four slots; STATUS has a slower period of its own. The simulator's
own counts must be those of the controller. Frames as in docs/controller.md. Ticks a second are
told, not judged. With TICKS and STRIDE only so many ticks run, with so many a STEP. Prints TAP.
"""
import glob
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

PROGRAM = sys.argv[1]
LONG = [int(argument) for argument in sys.argv[2:4]]
RIG = os.environ["HIL_SOURCE_DIR"] + "/config/rigs/coman.yaml"
BUSES = ["can0", "can1", "can2", "can3", "can4"]
STEP, DONE = 0x6F0, 0x6FF
STOPPING = 1 << 3  # flag of DONE
SET, GET, ASK, ANSWER = 0x40, 0x41, 0x001, 0x010  # MIN_POSITION of board 1
POLICY = bytes([0x49, 0x7F, 0, 0, 0])  # of board 1: POSITION, PID_VAL, CURRENT, VELOCITY
STATUS = (3, 12)  # types of periodic frames of class 1
SLOTS = 4
WARM_UP = 2 * SLOTS  # STEPs in which the frames of each slot are learned
PATIENCE_S = 90
WORK = tempfile.mkdtemp()
NUMBER = 0


def check(good, name, *facts):
    global NUMBER
    NUMBER += 1
    print("%s %d - %s" % ("ok" if good else "not ok", NUMBER, name))
    for fact in facts:
        for line in str(fact).splitlines():
            print("# " + line)
    sys.stdout.flush()
    return good


class Simulator:
    """Until TICKS ticks have run; its summary goes to a file."""

    def __init__(self, ticks, *arguments):
        self.text_path = os.path.join(WORK, "simulator.txt")
        self.output = open(self.text_path, "w")
        self.process = subprocess.Popen(
            [PROGRAM, "run", RIG, "--clock", "lockstep", "--transport", "socketcan",
             "--hold", "always", "--ticks", str(ticks), "--quiet", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.output, stderr=subprocess.STDOUT)
        self.wait_for_buses()

    def text(self):
        with open(self.text_path) as file:
            return file.read()

    def wait_for_buses(self):
        """A controller must not send before the simulator listens on every bus."""
        end = time.monotonic() + PATIENCE_S
        while self.listening() < set(BUSES):
            assert time.monotonic() < end and self.process.poll() is None, self.text()
            time.sleep(0.05)

    @staticmethod
    def listening():
        """The interfaces that a socket receives from, in the kernel's lists."""
        found = set()
        for path in glob.glob("/proc/net/can/rcvlist_*"):
            with open(path) as listing:
                found |= set(re.findall(r"^ *(can\d) ", listing.read(), re.M))
        return found

    def finish(self):
        """Received, sent and lost frames by interface."""
        status = self.process.wait(PATIENCE_S)
        assert status == 0, self.text()
        rows = re.findall(r"^  \w+ +(can\d) +(\d+) +(\d+) +(\d+) +(\d+)", self.text(), re.M)
        return {row[0]: tuple(int(number) for number in row[1:]) for row in rows}

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            self.process.wait(PATIENCE_S)


class Bus:
    """The controller's end of one interface."""

    def __init__(self, name):
        self.name = name
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
        self.socket.bind((name,))
        self.socket.settimeout(PATIENCE_S)
        self.sent = self.received = 0
        self.pattern = {}

    def send(self, identifier, data):
        self.socket.send(struct.pack("=IB3x8s", identifier, len(data), data))
        self.sent += 1

    def receive(self):
        identifier, length, data = struct.unpack("=IB3x8s", self.socket.recv(16))
        self.received += 1
        return identifier, data[:length]

    def judge_step(self, tick, stride):
        """Returns what is wrong with the frames of one STEP up to DONE, None when nothing is."""
        answers, periodic = [], []
        while (frame := self.receive())[0] != DONE:
            identifier, data = frame
            if identifier == ANSWER and data[0] == GET:
                answers.append(struct.unpack("<I", data[1:5])[0])
            elif identifier >> 8 != 1 or identifier & 0xF not in STATUS:
                periodic.append(identifier)
        step = tick // stride
        if step < WARM_UP:
            self.pattern[step % SLOTS] = periodic
        if struct.unpack("<IH", frame[1])[0] != tick + stride:
            return "DONE of another tick"
        if answers != [tick]:
            return "answers with %s" % answers
        if self.pattern[step % SLOTS] != periodic:
            return "not the frames of four STEPs ago: %s" % periodic
        return None

    def judge_end(self, ticks):
        if not any(self.pattern.values()):
            return "no telemetry"
        identifier, data = self.receive()
        tick, flags = struct.unpack("<IH", data[:6])
        if identifier != DONE or tick != ticks or not flags & STOPPING:
            return "not the DONE that says that the simulator stops"
        return None


def drive(buses, ticks, stride):
    """Returns what is wrong, None when nothing is."""
    for bus in buses:
        bus.send(ASK, POLICY)
    for tick in range(0, ticks, stride):
        for bus in buses:
            bus.send(ASK, struct.pack("<BI", SET, tick))
            bus.send(ASK, bytes([GET]))
        buses[0].send(STEP, struct.pack("<IH", tick, stride))
        for bus in buses:
            if wrong := bus.judge_step(tick, stride):
                return "%s, tick %d: %s" % (bus.name, tick, wrong)
    for bus in buses:
        if wrong := bus.judge_end(ticks):
            return "%s: %s" % (bus.name, wrong)
    return None


def control(ticks, stride, *arguments):
    simulator = Simulator(ticks, *arguments)
    buses = [Bus(name) for name in BUSES]
    try:
        begin = time.monotonic()
        if wrong := drive(buses, ticks, stride):
            return False, wrong, simulator.text()
        rate = ticks / (time.monotonic() - begin)
        theirs = simulator.finish()
        good = all(theirs[bus.name] == (bus.sent, bus.received, 0, 0) for bus in buses)
        return good, "%d ticks, %.0f a second" % (ticks, rate), theirs
    finally:
        simulator.stop()


def main():
    runs = [("every frame of %d ticks is at its place" % LONG[0], *LONG)] if LONG else [
        ("every frame of 300 ticks is at its place", 300, 1),
        ("and of 1000 ticks of which a STEP asks for 20", 1000, 20),
        ("and on buses that a wire paces", 200, 4, "--wire", "wire"),
    ]
    print("1..%d" % len(runs))
    good = True
    for name, *what in runs:
        result, *facts = control(*what)
        good &= check(result, name, *facts)
    return good


sys.exit(not main())
