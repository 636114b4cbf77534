# SPDX-License-Identifier: Apache-2.0
"""Tests in Python. The fixture `simulator` of coman_hil starts a simulator of rig.yaml for each
test."""
import pathlib

import pytest

RIG = str(pathlib.Path(__file__).with_name("rig.yaml"))
pytestmark = pytest.mark.simulator(RIG)


def bend(simulator, way_rad, seconds):
    """The controller in Python: turns the elbow by an angle and returns the angle that is left."""
    elbow = simulator.joints["LElbj"]
    target_rad = elbow.motor_position_rad + way_rad
    for _ in range(round(seconds * 250)):
        elbow.voltage_v = 40 * (target_rad - elbow.motor_position_rad)
        simulator.step(4)
    return target_rad - elbow.motor_position_rad


def test_the_elbow_bends(simulator):
    simulator.enable("LElbj")
    assert abs(bend(simulator, -0.5, 1.5)) < 0.05
    assert not simulator.tripped()


@pytest.mark.simulator(RIG, faults=["jam: motor LElbj jam manual"])
def test_a_jammed_motor_stays_where_it_is(simulator):
    simulator.enable("LElbj")
    simulator.fault("jam")
    assert abs(bend(simulator, -0.1, 0.1) + 0.1) < 0.01
