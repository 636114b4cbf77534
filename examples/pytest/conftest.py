# SPDX-License-Identifier: Apache-2.0
"""Fixtures for tests of a controller against the simulator.

simulator starts coman-hil in lockstep with a gateway, for each test anew; robot has all its buses
as one of python-can (every_bus.py) and the means to move virtual time. Nothing depends on how fast
the machine is, and a test repeats bit for bit. The program is the one of the environment variable
COMAN_HIL, else coman-hil on the PATH; the rig is that of COMAN_HIL_RIG, else the installed coman.
"""
import os
import re
import struct
import subprocess
import tempfile
import time

import can
import pytest
from every_bus import EveryBus

RIG = os.environ.get("COMAN_HIL_RIG", "coman")
STEP, DONE, STEP_BUS = 0x6F0, 0x6FF, "torso"
PATIENCE_S = 20


@pytest.fixture
def simulator(request):
    """Host and port of a gateway. A test may ask for arguments of `coman-hil run`:
    @pytest.mark.parametrize("simulator", [["--fault", "supply sag 30 0.1.."]], indirect=True)"""
    program = os.environ.get("COMAN_HIL", "coman-hil")
    with tempfile.NamedTemporaryFile("w+") as log:
        process = subprocess.Popen(
            [program, "run", RIG, "--transport", "local", "--clock", "lockstep", "--hold", "always",
             "--gateway", "0", "--quiet", *getattr(request, "param", [])],
            stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            yield gateway_of(process, log.name)
        finally:
            process.terminate()
            process.wait(PATIENCE_S)


def gateway_of(process, log):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and process.poll() is None:
        found = re.search(r"^gateway: (\S+) port (\d+)$", open(log).read(), re.M)
        if found:
            return found[1], int(found[2])
        time.sleep(0.02)
    pytest.fail("the simulator did not start:\n" + open(log).read())


class Robot:
    def __init__(self, bus):
        self.bus, self.tick = bus, 0

    def send(self, bus, identifier, data):
        self.bus.send(can.Message(arbitration_id=identifier, data=bytes.fromhex(data), channel=bus,
                                  is_extended_id=False))

    def step(self, milliseconds=1):
        """Runs the simulator on; the frames that it sent meanwhile, frame.channel is the bus."""
        self.send(STEP_BUS, STEP, struct.pack("<IH", self.tick, milliseconds).hex())
        frames = []
        while True:
            frame = self.bus.recv(PATIENCE_S)
            assert frame, "no DONE"
            if frame.arbitration_id == DONE:
                self.tick = struct.unpack_from("<I", frame.data)[0]
                return frames
            frames.append(frame)


@pytest.fixture
def robot(simulator):
    with EveryBus(*simulator) as bus:
        yield Robot(bus)
