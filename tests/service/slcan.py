#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""run --slcan with unmodified clients: what a serial adapter answers, on a pseudo-terminal and over
TCP; python-can's slcan interface, in lockstep, the same frames each time. Prints TAP."""
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import termios
import time
import tty

from ready import wait_until_ready
from tap import result
import tap

PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
WORK = tempfile.TemporaryDirectory(prefix="coman-hil-slcan-")
PATIENCE_S = 30


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Simulator:
    """A run with slcan channels and no gateway: a terminal for the bus of STEP, TCP for another."""

    def __init__(self, rig="coman", buses=("torso", "left_leg"), *arguments):
        self.path = os.path.join(WORK.name, f"line-{time.monotonic_ns()}")
        self.port = free_port()
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name)
        ready = tempfile.mktemp(dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "run", rig, "--transport", "local", "--ready", ready, "--quiet",
             "--hold", "always", "--clock", "lockstep", "--slcan", f"{buses[0]}={self.path}",
             "--slcan", f"{buses[1]}=tcp:{self.port}", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log, cwd=WORK.name)
        wait_until_ready(ready, self.process, PATIENCE_S, self.text)

    def text(self):
        return open(self.log.name).read()

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.process.send_signal(signal.SIGINT)
        try:
            self.status = self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()


class Line:
    """What is said and answered on a line, by bytes."""

    def __init__(self, descriptor):
        self.descriptor = descriptor

    @classmethod
    def terminal(cls, path):
        descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(descriptor, termios.TCSANOW)
        return cls(descriptor)

    def ask(self, command, answer):
        """Sends a command and waits for as many bytes as the answer has; whether it is that."""
        os.write(self.descriptor, command.encode())
        return self.wait(len(answer)) == answer

    def wait(self, size):
        got, end = b"", time.monotonic() + PATIENCE_S
        os.set_blocking(self.descriptor, False)
        while len(got) < size and time.monotonic() < end:
            try:
                got += os.read(self.descriptor, size - len(got))
            except BlockingIOError:
                time.sleep(0.002)
        return got.decode()

    def close(self):
        os.close(self.descriptor)


ANSWERS = [  # of an adapter at 1 Mbit/s
    ("V\r", "V1010\r"), ("N\r", "NHIL0\r"), ("\r", "\r"), ("Q\r", "\a"), ("F\r", "\a"),
    ("S6\r", "\a"), ("O\r", "\a"),                     # 500 kbit/s: not this bus
    ("S9\r", "\a"), ("Y2\r", "\a"), ("S8\r", "\r"),
    ("t70F1FF\r", "\a"),                               # not open
    ("M00000000\r", "\r"), ("mFFFFFFFF\r", "\r"), ("M00000001\r", "\a"), ("X1\r", "\r"),
    ("O\r", "\r"), ("O\r", "\a"), ("S8\r", "\a"), ("Z1\r", "\a"), ("F\r", "F00\r"),
    ("t70F9FF\r", "\a"), ("t70F2FF\r", "\a"), ("t8001FF\r", "\a"), ("T200000001FF\r", "\a"),
    ("b7002FFFF\r", "\a"),                             # CAN FD on a classic bus
    ("t70F1FF\r", "z\r"), ("T0000070F1FF\r", "Z\r"), ("C\r", "\r"),
    ("L\r", "\r"), ("t70F1FF\r", "\a"), ("C\r", "\r"),
]


def adapters_answer():
    with Simulator() as simulator:
        terminal = Line.terminal(simulator.path)
        connection = socket.create_connection(("127.0.0.1", simulator.port), PATIENCE_S)
        for name, line in (("terminal", terminal), ("connection", Line(connection.fileno()))):
            wrong = [c for c, a in ANSWERS if not line.ask(c, a)]
            result(not wrong, f"a {name} answers as a serial adapter", wrong)

        # a client that comes later finds the line, closed
        terminal.close()
        again = Line.terminal(simulator.path)
        result(again.ask("F\r", "\a") and again.ask("V\r", "V1010\r"), "a line is there again")
        again.close()
        connection.close()
    result(simulator.status == 0 and not os.path.lexists(simulator.path),
           "the run ends and removes the link", simulator.text())


def time_stamps_and_steps():
    """STEP by a line: 70F#FF goes before it, DONE and answers come with their times."""
    with Simulator("coman", ("torso", "left_leg")) as simulator:
        line = Line.terminal(simulator.path)
        steps = [line.ask(c, a) for c, a in (("C\r", "\r"), ("S8\r", "\r"), ("Z1\r", "\r"),
                                              ("O\r", "\r"), ("t70F1FF\r", "z\r"))]
        os.write(line.descriptor, b"t6F0600000000" + b"0200\r")
        heard = ""
        while "t6FF" not in heard or not heard.endswith("\r"):
            more = line.wait(1)
            if not more:
                break
            heard += more
        result(all(steps) and re.search(r"t7105FF040251570001\r", heard)
               and re.search(r"t6FF602000000[0-9A-F]{4}0002\r", heard),
               "STEP and DONE go over a line, with time stamps", repr(heard))
        line.close()


def who_does_not_read_is_closed():
    """A line that nobody reads keeps STEP waiting for a bounded time; then its channel closes."""
    with Simulator("coman", ("left_leg", "torso")) as simulator:
        line = Line.terminal(simulator.path)
        connection = socket.create_connection(("127.0.0.1", simulator.port), PATIENCE_S)
        steps = Line(connection.fileno())
        opened = line.ask("O\r", "\r") and steps.ask("O\r", "\r")
        for board in (1, 2, 3):  # all telemetry
            os.write(line.descriptor, f"t00{board}5497F020000\r".encode())
        done = 0
        for step in range(6):
            tick = (1000 * step).to_bytes(4, "little").hex()
            os.write(steps.descriptor, f"t6F06{tick}E803\r".encode())
            heard = ""
            while not re.search(r"t6FF6[0-9A-F]{12}\r", heard):
                more = steps.wait(1)
                if not more:
                    break
                heard += more
            done += "t6FF6" in heard
        termios.tcflush(line.descriptor, termios.TCIFLUSH)
        result(opened and done == 6 and line.ask("F\r", "\a") and line.ask("O\r", "\r")
               and line.ask("F\r", "F08\r") and line.ask("F\r", "F00\r"),
               "a line that is not read is closed, and tells so", f"{done} of 6 steps")
        line.close()
        connection.close()


def python_can(clock_ticks):
    """The frames of a discovery over python-can, on both lines."""
    import can
    with Simulator() as simulator:
        keys = {"interface": "slcan", "bitrate": 1000000}
        torso = can.Bus(channel=simulator.path, **keys)
        leg = can.Bus(channel=f"socket://127.0.0.1:{simulator.port}", **keys)
        leg.send(can.Message(arbitration_id=0x70F, data=b"\xff", is_extended_id=False))
        time.sleep(0.2)  # over two connections only the order of one is kept
        torso.send(can.Message(arbitration_id=0x6F0, is_extended_id=False,
                               data=bytes([0, 0, 0, 0, clock_ticks, 0])))
        frames, end = [], time.monotonic() + PATIENCE_S
        while len(frames) < 5 and time.monotonic() < end:
            frame = leg.recv(1)
            if frame:
                frames.append(f"{frame.arbitration_id:03X}#{frame.data.hex()}")
        done = torso.recv(PATIENCE_S)
        torso.shutdown()
        leg.shutdown()
    return frames, done and done.arbitration_id


def main():
    print("1..7", flush=True)
    adapters_answer()
    time_stamps_and_steps()
    who_does_not_read_is_closed()
    try:
        import can  # noqa: F401
        import serial  # noqa: F401
    except ImportError:
        result(True, "python-can drives the boards # SKIP no python3-can or python3-serial")
        return tap.failed > 0
    first, second = python_can(3), python_can(3)
    result(first == second and first[1] == 0x6FF and first[0] == [
        "710#ff04025157", "720#ff04025157", "730#ff04025157", "7C0#ff06030005", "7D0#ff06030005"],
        "python-can drives the boards by slcan, the same each time", f"{first} {second}")
    return tap.failed > 0


sys.exit(main())
