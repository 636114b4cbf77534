# SPDX-License-Identifier: Apache-2.0
"""A simulator that serves its buses to clients of the test over TCP."""
import os
import re
import signal
import subprocess
import tempfile

from ready import wait_until_ready

PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
RIG = os.path.join(os.environ["HIL_SOURCE_DIR"], "config", "rigs", "coman.yaml")
WORK = tempfile.TemporaryDirectory()
PATIENCE_S = 20


class Simulator:
    def __init__(self, *arguments):
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name)
        ready = tempfile.mktemp(dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "run", RIG, "--transport", "local", "--gateway", "0", "--ready", ready,
             "--quiet", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        self.buses = []
        places = wait_until_ready(ready, self.process, PATIENCE_S, self.text)
        self.host, self.port = places["gateway_host"], int(places["gateway_port"])

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
