# SPDX-License-Identifier: Apache-2.0
"""The boards of COMAN's torso, as the author of a controller would test against them.

    pytest examples/pytest
"""
import struct

import pytest

CURRENT, STATUS = 0x114, 0x113        # of board 1; id = 1 << 8 | board << 4 | type
VOLTAGE_MODE, FAULT = 0x50, 0xA0


def start(robot):
    robot.send("torso", 0x001, "49 0C 00 00 00")   # telemetry: STATUS and CURRENT
    robot.send("torso", 0x001, "09 50")            # axis 0: voltage mode
    assert modes(robot.step(20))[-1] == VOLTAGE_MODE   # STATUS follows every change of it


def values(frames, identifier, form):
    return [struct.unpack_from(form, f.data)[0] for f in frames
            if f.channel == "torso" and f.arbitration_id == identifier]


def modes(frames):
    return values(frames, STATUS, "<xB")


def test_boards_answer_discovery(robot):
    robot.send("torso", 0x70F, "FF")
    kinds = {f.arbitration_id: f.data[1] for f in robot.step(2) if f.data[:1] == b"\xff"}
    assert kinds == {0x710: 4, 0x720: 4, 0x7C0: 6}


def test_all_buses_are_driven_together(robot):
    for bus in ("left_arm", "right_arm"):
        robot.send(bus, 0x70F, "FF")
    frames = robot.step(2)
    for bus in ("left_arm", "right_arm"):
        assert {f.arbitration_id for f in frames if f.channel == bus} >= {0x710, 0x720}
    assert not [f for f in frames if f.channel == "torso"]


def test_a_voltage_makes_a_current(robot):
    start(robot)
    robot.send("torso", 0x001, "72 38 00")         # 56 of 1333: 2 V of 48 V
    frames = robot.step(40)
    assert max(values(frames, CURRENT, "<h"), key=abs) != 0


def test_a_voltage_that_is_not_refreshed_ends(robot):
    start(robot)
    robot.send("torso", 0x001, "72 38 00")
    robot.step(50)
    robot.send("torso", 0x001, "73")               # GET: the reference stands
    assert values(robot.step(2), 0x010, "<xh") == [56]
    robot.step(100)
    robot.send("torso", 0x001, "73")               # 100 ms after the command it does not
    assert values(robot.step(2), 0x010, "<xh") == [0]


@pytest.mark.parametrize("simulator", [["--fault", "supply sag 30 0.05.."]], indirect=True)
def test_a_brown_out_is_told_in_status(robot):
    start(robot)
    assert modes(robot.step(20)) == []
    assert modes(robot.step(40))[-1] == FAULT
