#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every object that the EDS of a CANopen node names, asked of the node by SDO: it is there, has the
size of its type and the value that the EDS promises. What is read-only refuses a write. What has
limits accepts them and refuses what is beyond. And the EDS has the objects that CiA 301 and 402-2
make mandatory. Prints TAP.

eds_objects.py PROGRAM"""
import configparser
import os
import pathlib
import re
import subprocess
import sys

SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
sys.path[:0] = [str(SOURCE / "python"), str(SOURCE / "tests" / "service")]

import can  # noqa: E402
import coman_hil  # noqa: E402
from tap import result  # noqa: E402
import tap  # noqa: E402

PROGRAM = os.path.abspath(sys.argv[1])
RIG, BUS, NODE = "coman-cia402", "left_arm", 1
# of CiA 301; of CiA 402-2 in general, and of the modes that 0x6502 tells
MANDATORY = {
    "CiA 301": ("1000", "1001", "1018sub1"),
    "CiA 402-2": ("6040", "6041", "6060", "6061", "6502"),
    "profile position": ("607A", "6081", "6083", "6064"),
    "profile velocity": ("60FF", "606C"),
    "torque": ("6071",),
    "homing": ("6098", "6099sub1", "6099sub2"),
    "cyclic synchronous modes": ("607A", "60FF", "6071", "6064", "606C", "6077", "60C2sub1"),
}
SIZES = {2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4}    # bytes of a data type
SIGNED = (2, 3, 4)
READ_ONLY, TOO_HIGH, TOO_LOW, VALUE = 0x06010002, 0x06090031, 0x06090032, 0x06090030
NO_DATA = 0x08000024
# what the node measures, or tells of its state; what is no setting to write back
LIVE = re.compile("1001|1003|1010|1011|[4-7][08]0[1-9]|4010|[67][08]FD"
                  "|[67][08](41|61|62|64|6B|6C|74|77|78|79|F4)")


class Node:
    """The SDO server of the node, a request a tick."""

    def __init__(self, simulator):
        self.simulator = simulator

    def ask(self, data):
        """The eight bytes of the answer."""
        self.simulator.send(can.Message(arbitration_id=0x600 + NODE, is_extended_id=False,
                                        data=data, channel=BUS))
        self.simulator.step(1)
        answers = [f.data for f in self.simulator.frames(BUS)
                   if f.arbitration_id == 0x580 + NODE]
        assert len(answers) == 1, f"{len(answers)} answers to {data.hex()}"
        return answers[0]

    def read(self, index, sub):
        """An expedited upload's bytes, or the reason of an abort."""
        answer = self.ask(bytes([0x40, index & 255, index >> 8, sub, 0, 0, 0, 0]))
        if answer[0] == 0x80:
            return int.from_bytes(answer[4:], "little")
        return bytes(answer[4:8 - (answer[0] >> 2 & 3)])

    def write(self, index, sub, data):
        """0, or the reason of an abort."""
        answer = self.ask(bytes([0x23 | (4 - len(data)) << 2, index & 255, index >> 8, sub])
                          + data.ljust(4, b"\0"))
        return 0 if answer[0] == 0x60 else int.from_bytes(answer[4:], "little")


def complaints(node, name, keys):
    """What is wrong with a variable of the EDS."""
    index, _, sub = name.partition("sub")
    index, sub, kind = int(index, 16), int(sub or "0", 16), int(keys["DataType"], 16)
    if kind not in SIZES:
        return
    size, found = SIZES[kind], node.read(index, sub)
    if index == 0x1003 and sub > 0 and found == NO_DATA:  # no error yet
        return
    if not isinstance(found, bytes) or len(found) != size:
        yield f"{name}: read {found!r}, expected {size} bytes"
        return
    value = int.from_bytes(found, "little", signed=kind in SIGNED)
    promised = sum(int(part, 0) for part in keys["DefaultValue"].replace(
        "$NODEID", str(NODE)).split("+"))
    if not LIVE.match(name) and value != (promised if kind in SIGNED else promised % 2 ** 32):
        yield f"{name}: is {value}, the EDS promises {keys['DefaultValue']}"
    if keys["AccessType"] in ("ro", "const"):
        if node.write(index, sub, found) != READ_ONLY:
            yield f"{name}: a write of what is {keys['AccessType']} is not refused"
        return
    bits, signed = 8 * size, kind in SIGNED
    for key, step, reason in (("LowLimit", -1, TOO_LOW), ("HighLimit", 1, TOO_HIGH)):
        if key not in keys:
            continue
        own = int(keys[key], 0)
        if node.write(index, sub, own.to_bytes(size, "little", signed=signed)) != 0:
            yield f"{name}: its {key} {own} is refused"
        beyond = own + step
        if (-(1 << bits - 1) if signed else 0) <= beyond < 1 << (bits - 1 if signed else bits):
            data = beyond.to_bytes(size, "little", signed=signed)
            if node.write(index, sub, data) not in (reason, VALUE):
                yield f"{name}: {beyond} is not refused"
        node.write(index, sub, found)


def main():
    text = subprocess.run([PROGRAM, "eds", RIG, f"{BUS}/0x{NODE:02x}"], check=True,
                          capture_output=True, text=True, timeout=60).stdout
    eds = configparser.ConfigParser(interpolation=None)
    eds.optionxform = str
    eds.read_string(text)
    variables = [s for s in eds.sections() if re.fullmatch("[0-9A-F]{4}(sub[0-9A-F]+)?", s)
                 and "DataType" in eds[s]]
    print(f"1..{len(MANDATORY) + 2}")
    with coman_hil.Simulator(RIG, program=PROGRAM, hold="always") as simulator:
        node = Node(simulator)
        simulator.step(5)
        for what, names in MANDATORY.items():
            wrong = [name for name in names if name not in eds]
            wrong += [c for name in names if name in eds
                      for c in complaints(node, name, eds[name])]
            result(not wrong, f"what {what} makes mandatory is there", "\n".join(wrong))
        wrong = [c for name in variables for c in complaints(node, name, eds[name])]
        result(not wrong and len(variables) > 500, f"{len(variables)} objects are as the EDS says",
               "\n".join(wrong))
        result(node.read(0x4006, 0) == bytes([25, 0]),
               "a winding without a thermal model is at 25 degrees C")
    return tap.failed > 0


sys.exit(main())
