#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Lockstep over the gateway with clients of five buses: the same commands give the same state, bit
for bit, however they come. Sockets are as the system gives them, with Nagle's algorithm. Prints
TAP, and how many steps a second there were.
"""
import os
import random
import re
import select
import socket
import struct
import sys
import time
import traceback

import tap
from gateway_simulator import PATIENCE_S, Simulator

BUSES = ["torso", "left_leg", "right_leg", "left_arm", "right_arm"]
AXES = 2                # of boards 1 and 2 of each bus
REPEATS = 100
STEPS, TICKS = 20, 12
WINDUP = "49 1F 00 00 00"  # telemetry of all kinds


class Connection:
    """A client of one bus, or of all."""

    def __init__(self, simulator, bus, buffer=0):
        self.socket = socket.socket()
        if buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect((simulator.host, simulator.port))
        self.text, self.bus = "", bus
        for say, answer in (("", "< hi >"), (f"< open {bus} >", "< ok >"),
                            ("< rawmode >", "< ok >")):
            self.socket.sendall(say.encode())
            assert self.socket.recv(64).decode() == answer

    def send(self, identifier, data, bus=""):
        words = data.split()
        bus = bus if self.bus == "all" else ""
        self.socket.sendall(
            f"< send {identifier:03X} {len(words)} {' '.join(words)} {bus} >".encode())

    def step(self, tick, ticks):
        self.send(0x6F0, struct.pack("<IH", tick, ticks).hex(" "), "torso")
        while not (end := re.search("< frame 6FF [^>]*>", self.text)):
            received = self.socket.recv(65536)
            assert received, "the connection has ended"
            self.text += received.decode()
        self.text = self.text[end.end():]

    def skip(self):
        """Reads what is there."""
        while select.select([self.socket], [], [], 0)[0]:
            self.socket.recv(65536)


def session(simulator, connections, slow=None):
    """Drives every axis of the first two boards of each bus with voltages that change each step."""
    by_bus = {bus: connections[index % len(connections)] for index, bus in enumerate(BUSES)}
    noise = random.Random(7)
    for bus in BUSES:
        for board in (1, 2):
            by_bus[bus].send(board, WINDUP, bus)
            for axis in range(AXES):
                by_bus[bus].send(board, f"{0x80 * axis + 9:02X} 50", bus)
    by_bus["torso"].step(0, 5)
    tick = 5
    for _ in range(STEPS):
        for bus in BUSES[1:] + BUSES[:1]:
            for board in (1, 2):
                for axis in range(AXES):
                    volts = noise.randrange(-300, 300)
                    data = struct.pack("<Bh", 0x80 * axis + 0x72, volts).hex(" ")
                    by_bus[bus].send(board, data, bus)
        by_bus["torso"].step(tick, TICKS)
        tick += TICKS
        for connection in connections:
            connection.skip()
        if slow:
            slow.socket.recv(100)


def run(kind):
    with Simulator("--clock", "lockstep", "--hold", "always") as simulator:
        buses = ["all"] if kind == "one" else BUSES
        slow = Connection(simulator, "left_leg", 2048) if kind == "slow" else None
        session(simulator, [Connection(simulator, bus) for bus in buses], slow)
    return simulator.hash()


def test_a_hundred_repeats_leave_one_state():
    hashes = {}
    for number in range(REPEATS):
        kind = ("five", "slow", "one", "five")[number % 4]
        hashes.setdefault(run(kind), []).append(kind)
    assert len(hashes) == 1, {state: len(kinds) for state, kinds in hashes.items()}


def test_the_commands_matter():
    """Or the hashes above would say nothing."""
    with Simulator("--clock", "lockstep", "--hold", "always") as simulator:
        Connection(simulator, "torso").step(0, 5 + STEPS * TICKS)
    assert simulator.hash() != run("one")


def test_steps_a_second():
    """Reported; what is judged is counted by the test of the gateway's wake-ups."""
    count = 3000
    with Simulator("--clock", "lockstep", "--hold", "always") as simulator:
        client = Connection(simulator, "all")
        begin = time.monotonic()
        for tick in range(count):
            client.send(1, "72 00 00", "left_leg")
            client.step(tick, 1)
        took = time.monotonic() - begin
    print(f"# {count / took:.0f} commands and steps a second from Python, without python-can")


def main():
    tests = [(name, body) for name, body in globals().items() if name.startswith("test_")]
    print("1..%d" % len(tests))
    for name, body in tests:
        try:
            body()
            tap.result(True, name[5:])
        except Exception:
            tap.result(False, name[5:], traceback.format_exc())


sys.path.insert(0, os.path.dirname(__file__))
main()
