# SPDX-License-Identifier: Apache-2.0
"""A simulator that serves its buses to clients of the test over TCP."""
import os
import re
import signal
import subprocess
import tempfile
import time

PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
RIG = os.path.join(os.environ["HIL_SOURCE_DIR"], "config", "rigs", "coman.yaml")
WORK = tempfile.TemporaryDirectory()
PATIENCE_S = 20


class Simulator:
    def __init__(self, *arguments):
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "run", RIG, "--transport", "local", "--gateway", "0", "--quiet", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        self.buses = []
        end = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"^gateway: (\S+) port (\d+)$", self.text(), re.M)):
            assert self.process.poll() is None and time.monotonic() < end, self.text()
            time.sleep(0.02)
        self.host, self.port = found[1], int(found[2])

    def text(self):
        return open(self.log.name).read()

    def join(self, channel):
        """A bus of python-can, which need not be installed for the others."""
        import can
        bus = can.Bus(interface="socketcand", host=self.host, port=self.port, channel=channel)
        self.buses.append(bus)
        return bus

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        for bus in self.buses:
            bus.shutdown()
        self.process.send_signal(signal.SIGINT)
        try:
            self.status = self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()

    def hash(self):
        return re.search(r"state hash (\w+)", self.text())[1]
