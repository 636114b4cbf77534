#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Standing on the drives' own position loops: the set points are sent once, as a host does that
leaves the rest to the boards, and COMAN stands on, from both starts. The gains of iCub's boards are
those of examples/icub, the others the drives' own. A loop that feeds the sway, as an integral does,
has the robot fall within a minute. Arguments: the program and the duration, s. Prints TAP."""
import math
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

import tap

ROOT = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
RIGS = ROOT / "config" / "rigs"
GEAR = 100
POSITION, CYCLIC_POSITION, CLOSED_LOOP, OPERATIONAL = 1, 8, 8, 1


def pose():
    """Joint angles of the rig's start, rad, without those that are 0."""
    robot = (ROOT / "config" / "robots" / "coman.yaml").read_text()
    home = re.search(r"  crouch_home:(?:.*\n)+?    joints_rad:\n((?:      \w+: [-\d.]+\n)+)",
                     robot)[1]
    lean = re.search(r"^  joints_rad: \{(.*)\}", (RIGS / "coman.yaml").read_text(), re.M)[1]
    return {joint: float(angle) for joint, angle in re.findall(r"(\w+): ([-\d.]+)", home + lean)}


def axes(rig):
    """Bus, address, index on the board and joint of every axis."""
    for name, boards in re.findall(r"  - name: (\w+)\n.*\n    boards:\n((?:      .*\n?)+)",
                                   (RIGS / f"{rig}.yaml").read_text()):
        for address, joints in re.findall(r"kind: motor, address: (\w+), axes: \[(.*?)\]", boards):
            for index, joint in enumerate(joints.split(", ")):
                if joint != "spare":
                    yield name, int(address, 0), index, joint


def icub(address, index, angle):
    """Gains, mode and target for a board of the iCub family."""
    leg = (ROOT / "examples" / "icub" / "left_leg.xml").read_text()
    group = re.search(r'<group name="POS_PIDS">(.*?)</group>', leg, re.S)[1]
    gain = {name: int(value) for name, value in re.findall(r'name="(\w+)"> +(-?\d+)', group)}
    axis = index << 7
    target = round(angle * 4096 / (2 * math.pi))

    yield address, struct.pack("<BhhhB", 0x52 | axis, gain["kp"], gain["ki"], gain["kd"],
                               gain["shift"])
    yield address, struct.pack("<Bhhh", 0x54 | axis, gain["ko"], gain["maxOutput"], gain["maxInt"])
    yield address, struct.pack("<BB", 0x09 | axis, POSITION)
    yield address, struct.pack("<Bih", 0x1b | axis, target, 10000)


def cia402(address, index, angle):
    """Mode, target and controlwords by SDO; the node goes to OPERATIONAL."""
    def write(entry, value, size):
        command = {1: 0x2f, 2: 0x2b, 4: 0x23}[size]
        return 0x600 + address, struct.pack("<BHBi", command, entry + 0x800 * index, 0, value)

    yield 0, struct.pack("<BB", OPERATIONAL, address)
    yield write(0x6060, CYCLIC_POSITION, 1)
    yield write(0x607a, round(angle * 1e5), 4)
    for controlword in 6, 7, 15:
        yield write(0x6040, controlword, 2)


def odrive(address, _, angle):
    """State and target for an ODrive, whose control mode is position from the start."""
    yield address << 5 | 0x07, struct.pack("<I", CLOSED_LOOP)
    yield address << 5 | 0x0c, struct.pack("<fhh", angle * GEAR / (2 * math.pi), 0, 0)


def write_log(path, rig, frames):
    """Writes the frames of all axes, a tick between two of one board."""
    angle = pose()
    lines = []
    boards = {}
    for bus, address, index, joint in axes(rig):
        for frame_id, data in frames(address, index, angle.get(joint, 0.0)):
            at = boards[bus, address] = boards.get((bus, address), 0.05) + 0.002
            lines.append((at, f"({at:.6f}) {bus} {frame_id:03X}#{data.hex().upper()}\n"))
    path.write_text("".join(line for _, line in sorted(lines)))


def stands(program, seconds, work, rig, log, *options):
    """Lets the robot stand; returns whether it does and what the program said."""
    run = subprocess.run([program, "run", rig, "--transport", "local", "--clock", "free",
                          "--control", "none", "--stimulus", log, "--duration", seconds, *options],
                         cwd=work, capture_output=True, text=True, timeout=280)
    said = run.stdout + run.stderr
    return (run.returncode == 0 and f"{seconds}.000 s virtual" in said and "released" in said
            and "fell" not in said and " 0 trips" in said and " 0 malformed" in said), said


def main():
    program, seconds = sys.argv[1:]
    print("1..6")
    with tempfile.TemporaryDirectory() as name:
        work = pathlib.Path(name)
        for rig, boards, frames in (("coman", "coman", icub),
                                    ("coman-cia402", "coman-cia402", cia402),
                                    ("coman-odrive", "coman-mini-cheetah", odrive)):
            log = work / f"{rig}.log"
            write_log(log, boards, frames)
            for options in (), ("--settle",):
                good, said = stands(program, seconds, work, rig, log, *options)
                tap.result(good, f"{rig} stands {' '.join(options)}", said)
    return tap.failed > 0


sys.exit(main())
