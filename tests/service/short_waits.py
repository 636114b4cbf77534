#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Clients with short waits: eight drives with the MIT frame on one CAN FD bus of 1 and 5 Mbit/s. In
virtual time every answer is counted at its place on the wire. In real time the share of answers
after 0.5 ms and 1 ms is reported, and no answer may wait for a tick. Prints TAP.

short_waits.py PROGRAM"""
import json
import os
import re
import select
import socket
import struct
import subprocess
import sys
import tempfile
import time

from ready import wait_until_ready
from tap import check

PROGRAM = os.path.abspath(sys.argv[1])
SECONDS = 10
JOINTS = ("LHipSag", "LHipLat", "LHipYaw", "LKneeSag", "LAnkLat", "LAnkSag", "RHipSag", "RHipLat")
UNDRIVEN = ("WaistLat WaistSag WaistYaw RHipYaw RKneeSag RAnkLat RAnkSag LShSag LShLat LShYaw "
            "LElbj RShSag RShLat RShYaw RElbj").split()
MOTORS = len(JOINTS)
DELAY_S = 0.00005               # reply_delay_s of mini-cheetah.yaml
FRAME = re.compile(rb"< (?:fd)?frame ([0-9A-F]+) (?:[0-9]+ )?([0-9.]+) ([0-9A-F]*)")
HOLD = "7F FF 7F F0 00 00 07 FF"  # all set-points in the middle of their ranges


class Run:
    """A run of eight drives, and a client of the gateway."""

    def __init__(self, tick_s, clock, wire, delay=None):
        self.folder = tempfile.TemporaryDirectory()
        path = os.path.join(self.folder.name, "")
        protocols = os.path.join(os.path.dirname(PROGRAM), "config", "protocols")
        with open(os.path.join(protocols, "mini-cheetah.yaml")) as file:
            text = file.read()
        text = re.sub(r"(    from: \w+\n)", r"\1    fd: true\n", text)
        with open(path + "mit-fd.yaml", "w") as file:
            file.write(text)
        boards = [{"kind": "motor", "address": 1 + i, "axes": [joint], **(delay or {})}
                  for i, joint in enumerate(JOINTS)]
        rig = {"extends": "coman-mini-cheetah", "tick_s": tick_s,
               "substep_s": min(tick_s, 0.001), "protocol": "mit-fd.yaml",
               "scene": {"engine": "none"}, "robot": {"fixed_base": True},
               "initial": {"hold": "always"}, "wire": {"mode": wire},
               "tasks": {"servo": {"command_period_s": max(tick_s, 0.001)}},
               "buses": [{"name": "arm", "interface": "can0", "fd": True,
                          "data_bitrate": 5000000, "boards": boards}],
               "undriven": UNDRIVEN, "lockstep": {"bus": "arm"}}
        with open(path + "rig.yaml", "w") as file:
            json.dump(rig, file)
        self.log = open(path + "log", "w+")
        self.process = subprocess.Popen(
            [PROGRAM, "run", path + "rig.yaml", "--transport", "local", "--clock", clock,
             "--gateway", "0", "--ready", path + "ready", "--quiet"],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        places = wait_until_ready(path + "ready", self.process, 60,
                                  lambda: open(self.log.name).read())
        self.socket = socket.create_connection(
            (places["gateway_host"], int(places["gateway_port"])), timeout=20)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.text = b""
        self.tick = 0
        for say, answer in (("", "< hi >"), ("< open arm >", "< ok >"),
                            ("< rawmode >", "< ok >")):
            self.socket.sendall(say.encode())
            while answer.encode() not in self.text:
                self.text += self.socket.recv(65536)
            self.text = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(20)

    def read(self):
        """The frames that have arrived: identifier, virtual time, data."""
        received = self.socket.recv(1 << 20)
        assert received, open(self.log.name).read()
        self.text += received
        end = self.text.rfind(b">") + 1
        frames = [(int(frame[1], 16), float(frame[2]), frame[3])
                  for frame in FRAME.finditer(self.text[:end])]
        self.text = self.text[end:]
        return frames

    def step(self, motors, data=HOLD):
        """Commands motors and runs one tick. Returns the motor and time of each answer."""
        commands = [f"< fdsend {motor:X} 1 8 {data} >" for motor in motors]
        commands.append(f"< send 6F0 6 {struct.pack('<IH', self.tick, 1).hex(' ')} >")
        self.socket.sendall("".join(commands).encode())
        self.tick += 1
        answers = []
        while True:
            for identifier, at, payload in self.read():
                if identifier == 0x6FF:
                    return answers
                if identifier == 0:
                    answers.append((int(payload[:2], 16), at))


def count_in_virtual_time(tick_s, together, wait_s):
    """Commands `together` drives a tick, in turn. Returns the numbers of commands, of answers
    later than wait_s after the command, of answers before their delay, and of missing or swapped
    answers."""
    commands, late, early, wrong = [], 0, 0, 0
    with Run(tick_s, "lockstep", "wire") as run:
        run.step(range(1, MOTORS + 1), "FF FF FF FF FF FF FF FC")
        for _ in range(20):
            run.step([])
        answers = []
        for index in range(round(SECONDS / 0.001 * MOTORS / together)):
            first = index * together % MOTORS
            motors = [1 + first + k for k in range(together)]
            commands += [(motor, run.tick * tick_s) for motor in motors]
            answers += run.step(motors)
        for _ in range(20):
            answers += run.step([])
    for (motor, begin), (answering, at) in zip(commands, answers):
        wrong += motor != answering
        late += at > begin + wait_s
        early += at < begin + DELAY_S
    return len(commands), late, early, wrong + abs(len(commands) - len(answers))


def delays_in_virtual_time(delay, ticks):
    """The times from commands to their answers of one drive with another delay, s."""
    with Run(0.001, "lockstep", "wire", delay) as run:
        times = []
        for _ in range(ticks):
            begin = run.tick * 0.001
            answers = run.step([1])
            for _ in range(3):
                answers += run.step([])
            times += [at - begin for _, at in answers]
        return times


def latencies_in_real_time(tick_s, period_s, seconds, delay=None):
    """Commands all drives each period. Returns the latencies of the answers, s, and how many
    answers are missing."""
    times, missing = [], 0
    with Run(tick_s, "real", "ideal", delay) as run:
        batch = "".join(f"< fdsend {motor:X} 1 8 FF FF FF FF FF FF FF FD >"
                        for motor in range(1, MOTORS + 1)).encode()
        due = time.monotonic()
        for _ in range(round(seconds / period_s)):
            due = max(due + period_s, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
            begin = time.monotonic()
            run.socket.sendall(batch)
            left = MOTORS
            while left and select.select([run.socket], [], [], 2)[0]:
                found = sum(identifier == 0 for identifier, _, _ in run.read())
                times += [time.monotonic() - begin] * found
                left -= found
            missing += left
    return sorted(times), missing


print("1..7")
for name, tick_s, together, wait_s in (
        ("eight drives at 1 kHz answer within 1 ms", 0.001, MOTORS, 0.001),
        ("a drive at a time answers within 0.5 ms", 0.000125, 1, 0.0005)):
    commands, late, early, wrong = count_in_virtual_time(tick_s, together, wait_s)
    check(commands == SECONDS * 1000 * MOTORS and late == early == wrong == 0,
          f"virtual time: {name}", f"{commands} commands, {late} answers late, {early} early, "
          f"{wrong} missing or out of order")

fixed = delays_in_virtual_time({"reply_delay_s": 0.0021}, 50)
check(len(fixed) == 50 and max(fixed) - min(fixed) < 2e-6 and 0.0021 < min(fixed) < 0.0023,
      "virtual time: an answer takes the delay of its board",
      f"{min(fixed) * 1e3:.4f} to {max(fixed) * 1e3:.4f} ms")
spread = [delays_in_virtual_time({"reply_delay_s": 0.001, "reply_spread_s": 0.001}, 200)
          for _ in range(2)]
check(spread[0] == spread[1] and len(spread[0]) == 200 and min(spread[0]) > 0.001
      and max(spread[0]) < 0.0022 and max(spread[0]) - min(spread[0]) > 0.0009,
      "virtual time: the random part of a delay repeats with the seed",
      f"{min(spread[0]) * 1e3:.4f} to {max(spread[0]) * 1e3:.4f} ms")

times, missing = latencies_in_real_time(0.1, 0.037, 5)
early = sum(t < 0.01 for t in times) / max(1, len(times))
check(missing == 0 and early > 0.9, "real time: no answer waits for a tick of 100 ms",
      f"{100 * early:.1f} % within 10 ms, median {times[len(times) // 2] * 1e3:.2f} ms, "
      f"{missing} missing")
times, missing = latencies_in_real_time(0.001, 0.001, SECONDS)
check(missing == 0, "real time: eight drives at 1 kHz answer every command",
      f"{len(times)} answers, later than 0.5 ms: "
      f"{100 * sum(t > 0.0005 for t in times) / len(times):.1f} %, than 1 ms: "
      f"{100 * sum(t > 0.001 for t in times) / len(times):.1f} %, median "
      f"{times[len(times) // 2] * 1e3:.3f} ms")
times, missing = latencies_in_real_time(0.001, 0.0137, 5, {"reply_delay_s": 0.0031})
check(missing == 0 and min(times) > 0.0031 and times[len(times) // 2] < 0.0051,
      "real time: an answer waits for the delay of its board, not for a tick",
      f"delay 3.1 ms, answers after {min(times) * 1e3:.2f} ms, median "
      f"{times[len(times) // 2] * 1e3:.2f} ms, 90 % {times[9 * len(times) // 10] * 1e3:.2f} ms, "
      f"{missing} missing")
