# SPDX-License-Identifier: Apache-2.0
"""The boards of COMAN's torso, as the author of a controller would test against them.

    pytest examples/pytest
"""
import can
import pytest

pytestmark = pytest.mark.simulator(hold="always")
BOARD = "torso_0x01"                # a node of the bus, as `coman-hil dbc` names it


def command(sim, what, **values):
    sim.command("torso", f"{BOARD}_COMMAND", command=what, **values)


def discover(sim, bus):
    """By hand: a frame of python-can, whose channel is the bus."""
    sim.send(can.Message(arbitration_id=0x70F, data=b"\xff", channel=bus, is_extended_id=False))


def test_boards_answer_discovery(simulator):
    discover(simulator, "torso")
    simulator.step(2)
    kinds = {f.arbitration_id: f.data[1] for f in simulator.frames() if f.data[:1] == b"\xff"}
    assert kinds == {0x710: 4, 0x720: 4, 0x7C0: 6}


def test_all_buses_are_driven_together(simulator):
    for bus in ("left_arm", "right_arm"):
        discover(simulator, bus)
    simulator.step(2)
    for bus in ("left_arm", "right_arm"):
        assert {f.arbitration_id for f in simulator.frames(bus)} >= {0x710, 0x720}
    assert not simulator.frames("torso")


def test_a_voltage_makes_a_current(simulator):
    waist = simulator.joints["WaistLat"]
    simulator.enable("WaistLat")
    assert waist.mode == "open_loop"
    waist.voltage_v = 2.0
    simulator.step(40)
    assert waist.current_a > 0.05
    assert waist.motor_position_rad > waist.position_rad        # the link is clamped


def test_a_voltage_that_is_not_refreshed_ends(simulator):

    def reference():
        command(simulator, "GET_OPEN_LOOP_0")
        simulator.step(2, refresh=False)
        return simulator.received("torso", f"{BOARD}_REPLY")[0]["GET_OPEN_LOOP_pwm_0"]

    simulator.enable("WaistLat")
    command(simulator, "SET_OPEN_LOOP_0", SET_OPEN_LOOP_pwm_0=4.2)
    simulator.step(50, refresh=False)
    assert reference() == pytest.approx(4.2, abs=0.04)      # percent of the supply
    simulator.step(100, refresh=False)
    assert reference() == 0


@pytest.mark.simulator(faults=["supply sag 30 0.1.."])
def test_a_brown_out_is_told_in_status(simulator):
    simulator.enable("WaistLat")
    simulator.step(40)
    assert simulator.joints["WaistLat"].is_on
    simulator.step(60)
    assert simulator.joints["WaistLat"].mode == "hardware_fault"
    assert simulator.joints["WaistLat"].faults == 1         # under-voltage
