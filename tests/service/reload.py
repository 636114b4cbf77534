#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: reload.py COMAN-HIL
The program as a service manager sees it, with a manager made of one socket: ready after the first
tick, fed watchdog, a rig that is read again on SIGHUP when it is good and left alone when not.
Prints TAP."""
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 30


class Service:
    def __init__(self, program, work):
        self.work = work
        self.heard = []
        shutil.copytree(os.environ["HIL_SOURCE_DIR"] + "/config", work + "/config")
        self.rig = work + "/config/rigs/coman.yaml"
        self.manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.manager.bind(work + "/notify")
        self.manager.settimeout(0.1)
        self.log = open(work + "/err", "w")
        self.process = subprocess.Popen(
            [program, "run", self.rig, "--transport", "local", "--clock", "real"],
            env=dict(os.environ, NOTIFY_SOCKET=work + "/notify", WATCHDOG_USEC="500000"),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self.log)

    def hears(self, what):
        """what comes, or has come since it was last asked for"""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            for i, text in enumerate(self.heard):
                if what in text:
                    del self.heard[: i + 1]
                    return True
            try:
                self.heard.append(self.manager.recv(4096).decode())
            except socket.timeout:
                if self.process.poll() is not None:
                    return False
        return False

    def says(self, what):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            with open(self.work + "/err") as log:
                if what in log.read():
                    return True
            time.sleep(0.05)
        return False


number = 0


def result(name, good, service):
    global number
    number += 1
    print(("ok" if good else "not ok"), number, "-", name, flush=True)
    if not good:
        with open(service.work + "/err") as log:
            print("".join("# " + line for line in log.readlines()[-10:]), flush=True)


def main():
    print("1..7")
    with tempfile.TemporaryDirectory() as work:
        service = Service(sys.argv[1], work)
        try:
            result("it is ready after its first tick", service.hears("READY=1"), service)
            result("it feeds the watchdog, more than once",
                   service.hears("WATCHDOG=1") and service.hears("WATCHDOG=1"), service)
            result("its status line tells how it is", service.hears("STATUS="), service)

            with open(service.rig) as file:
                good = file.read()
            with open(service.rig, "w") as file:
                file.write(good.replace("supply_v:", "suply_v:"))
            service.process.send_signal(signal.SIGHUP)
            result("a rig that is wrong is refused and the run goes on",
                   service.hears("RELOADING=1") and service.hears("READY=1")
                   and service.says("reload refused") and service.says("suply_v")
                   and service.process.poll() is None, service)

            with open(service.rig, "w") as file:
                file.write(good)
            service.process.send_signal(signal.SIGHUP)
            result("a good one is taken, in the same process",
                   service.hears("RELOADING=1") and service.says("reload: restarting")
                   and service.hears("READY=1") and service.process.poll() is None, service)

            service.process.send_signal(signal.SIGTERM)
            result("it says that it stops", service.hears("STOPPING=1"), service)
            result("and ends well", service.process.wait(PATIENCE_S) == 0, service)
        finally:
            service.process.kill()
            service.process.wait()


main()
