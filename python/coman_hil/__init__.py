# SPDX-License-Identifier: Apache-2.0
"""Tests and controllers in Python against coman-hil, a real-time simulator over SocketCAN.

    import coman_hil

    with coman_hil.Simulator("coman-compact", hold="always") as sim:
        sim.enable()
        sim.joints["LElbj"].voltage_v = 2.0
        sim.step(100)

Units are in the names: _rad, _v, _a, _nm, _s. Signals of frames have those of the DBC.
coman_hil.pytest is a plugin for pytest.
"""
from .control import Control
from .database import Bus, Database, Message, Signal
from .errors import (BoardError, ControlError, GatewayError, NoTelemetry, ProgramNotFound,
                     RigError, SimulatorDied, SimulatorError, SimulatorStopped, SimulatorTimeout,
                     UnknownName)
from .gateway import GatewayBus
from .robot import ForceSensor, Joint
from .simulator import Simulator

__all__ = [
    "BoardError", "Bus", "Control", "ControlError", "Database", "ForceSensor",
    "GatewayBus", "GatewayError", "Joint", "Message", "NoTelemetry", "ProgramNotFound", "RigError",
    "Signal", "Simulator", "SimulatorDied", "SimulatorError", "SimulatorStopped",
    "SimulatorTimeout", "UnknownName",
]
