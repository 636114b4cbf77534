#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Lockstep over vcan, can0 to can4 (see run.sh): the simulator and a controller as two processes.

lockstep.py COMAN_HIL LOCKSTEP_CONTROLLER [TICKS STRIDE]

First the C controller of tests/bus, which checks every frame of every tick, with STEPs of one tick
and of several, and on buses that a wire paces; then a controller of python-can, which checks DONE
and the answers. The simulator's own counts must be those of the controllers. Ticks a second are
told, not judged. With TICKS and STRIDE only the C controller runs, so many ticks with so many a
STEP. Prints TAP.
"""
import glob
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time

PROGRAM, CONTROLLER = sys.argv[1:3]
LONG = [int(argument) for argument in sys.argv[3:5]]
TICKS_PYTHON = 100
RIG = os.environ["HIL_SOURCE_DIR"] + "/config/rigs/coman.yaml"
BUSES = ["can0", "can1", "can2", "can3", "can4"]
STEP, DONE = 0x6F0, 0x6FF
SET, GET, ASK, ANSWER = 0x40, 0x41, 0x001, 0x010  # MIN_POSITION of board 1
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


def c_controller(ticks, stride, *arguments):
    simulator = Simulator(ticks, *arguments)
    try:
        done = subprocess.run([CONTROLLER, str(ticks), str(stride), *BUSES], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True)
        if done.returncode:
            return False, done.stdout, simulator.text()
        ours = {row[0]: (int(row[1]), int(row[2]))
                for row in re.findall(r"^(can\d) sent (\d+) received (\d+)", done.stdout, re.M)}
        theirs = simulator.finish()
        good = all(theirs[bus] == (*ours[bus], 0, 0) for bus in BUSES)
        return good, done.stdout, theirs
    finally:
        simulator.stop()


def python_can_controller():
    try:
        import can
    except ImportError:
        return True, "SKIP python-can is not installed (Debian package python3-can)"
    simulator = Simulator(TICKS_PYTHON)
    try:
        bus = {name: can.interface.Bus(channel=name, interface="socketcan") for name in BUSES}

        def send(name, identifier, data):
            bus[name].send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

        frames = 0
        begin = time.monotonic()
        for tick in range(TICKS_PYTHON):
            for name in BUSES:
                send(name, ASK, struct.pack("<BI", SET, tick))
                send(name, ASK, [GET])
            send("can0", STEP, struct.pack("<IH", tick, 1))
            for name in BUSES:
                answers = []
                while True:
                    message = bus[name].recv(PATIENCE_S)
                    if message is None:
                        return False, "no DONE on %s in tick %d" % (name, tick)
                    frames += 1
                    if message.arbitration_id == DONE:
                        break
                    if message.arbitration_id == ANSWER and message.data[0] == GET:
                        answers.append(struct.unpack("<I", message.data[1:])[0])
                if answers != [tick] or struct.unpack("<IH", message.data)[0] != tick + 1:
                    return False, "tick %d of %s: %s" % (tick, name, (answers, message))
        rate = TICKS_PYTHON / (time.monotonic() - begin)
        theirs = simulator.finish()
        # and on every bus the DONE that says that the simulator stops
        good = sum(row[1] for row in theirs.values()) == frames + len(BUSES)
        return good, "%d ticks, %.0f a second" % (TICKS_PYTHON, rate), theirs
    finally:
        simulator.stop()


def main():
    if LONG:
        print("1..1")
        good, *facts = c_controller(*LONG)
        return check(good, "a C controller finds every frame of %d ticks at its place" % LONG[0],
                     *facts)
    print("1..4")
    good, *facts = c_controller(300, 1)
    result = check(good, "a C controller finds every frame of 300 ticks at its place", *facts)
    good, *facts = c_controller(1000, 20)
    result &= check(good, "and of 1000 ticks of which a STEP asks for 20", *facts)
    good, *facts = c_controller(200, 4, "--wire", "wire")
    result &= check(good, "and on buses that a wire paces", *facts)
    good, *facts = python_can_controller()
    return result & check(good, "a controller of python-can drives virtual time", *facts)


sys.exit(not main())
