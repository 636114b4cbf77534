#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: reload.py COMAN-HIL
The program as a service manager sees it, with a manager made of one socket: ready after the first
tick, fed watchdog, a rig that is read again on SIGHUP when it is good and left alone when not. No
stop is lost in a reload: neither while the rig is read, nor between two runs. Prints TAP."""
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
    def __init__(self, program, work, *more, environment=()):
        self.work = work
        self.heard = []
        shutil.copytree(os.environ["HIL_SOURCE_DIR"] + "/config", work + "/config")
        self.rig = work + "/config/rigs/coman.yaml"
        self.manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.manager.bind(work + "/notify")
        self.manager.settimeout(0.1)
        self.log = open(work + "/err", "w")
        self.process = subprocess.Popen(
            [program, "run", self.rig, "--transport", "local", "--clock", "real", *more],
            env=dict(os.environ, NOTIFY_SOCKET=work + "/notify", WATCHDOG_USEC="500000",
                     **dict(environment)),
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

    def has_heard(self, what):
        """what has come since it was last asked for; without patience"""
        self.manager.setblocking(False)
        try:
            while True:
                self.heard.append(self.manager.recv(4096).decode())
        except BlockingIOError:
            self.manager.settimeout(0.1)
        return any(what in text for text in self.heard)

    def says(self, what):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            with open(self.work + "/err") as log:
                if what in log.read():
                    return True
            time.sleep(0.05)
        return False

    def says_now(self, what):
        with open(self.work + "/err") as log:
            return what in log.read()


def end(service):
    if service.process.poll() is None:
        service.process.kill()
    service.process.wait()
    service.manager.close()
    service.log.close()


number = 0


def result(name, good, service):
    global number
    number += 1
    print(("ok" if good else "not ok"), number, "-", name, flush=True)
    if not good:
        with open(service.work + "/err") as log:
            print("".join("# " + line for line in log.readlines()[-10:]), flush=True)


def stop_while_the_rig_is_read(program, work):
    """SIGTERM right behind the reload's first message, when the old run still goes on."""
    service = Service(program, work)
    try:
        good = service.hears("READY=1")
        service.process.send_signal(signal.SIGHUP)
        good = good and service.hears("RELOADING=1")
        service.process.send_signal(signal.SIGTERM)
        result("a stop while the rig is read again ends it",
               good and service.hears("STOPPING=1") and service.process.wait(PATIENCE_S) == 0,
               service)
    finally:
        end(service)


def stop_between_two_runs(program, work):
    """The new run has a long trajectory to read, and is held while it does so."""
    path = work + "/trajectory.csv"
    with open(path, "w") as file:
        file.write("time_s,LElbj_deg\n0,-30\n60,-60\n")
    service = Service(program, work, "--task", "follow", "--trajectory", path)
    try:
        good = service.hears("READY=1")
        with open(path, "w") as file:
            file.write("time_s,LElbj_deg\n0,-30\n")
            file.writelines(f"{60 + 1e-3 * k:.3f},-60\n" for k in range(500000))
        service.process.send_signal(signal.SIGHUP)
        good = good and service.hears("RELOADING=1") and service.says("reload: restarting")
        service.process.send_signal(signal.SIGSTOP)
        result("the old run is not said to be ready again",
               good and not service.has_heard("READY=1"), service)
        begin_s = time.monotonic()
        service.process.send_signal(signal.SIGTERM)
        service.process.send_signal(signal.SIGCONT)
        result("a stop between two runs ends it at once, and well",
               service.hears("STOPPING=1") and service.process.wait(PATIENCE_S) == 0
               and time.monotonic() - begin_s < 15, service)
    finally:
        end(service)


def keep_tokens_from_the_journal(program, work):
    """The page's tokens are in the runtime directory, for its owner, and nowhere in the log."""
    run = work + "/run"
    os.mkdir(run, 0o700)
    service = Service(program, work, "--http", "127.0.0.1:0",
                      environment={"RUNTIME_DIRECTORY": run + ":/nowhere"})
    try:
        good = service.hears("READY=1") and service.says("page: http://127.0.0.1:")
        with open(run + "/page") as file:
            tokens = [line.split()[1] for line in file if not line.startswith("port")]
        with open(work + "/err") as log:
            text = log.read()
        result("a service's page has its tokens in a file of its owner",
               good and len(tokens) == 2 and min(map(len, tokens)) >= 32
               and os.stat(run + "/page").st_mode & 0o777 == 0o600
               and f"its tokens: {run}/page\n" in text, service)
        result("and no token in what it prints",
               "token=" not in text and not any(token in text for token in tokens), service)
    finally:
        end(service)
    shutil.rmtree(work + "/config")
    os.remove(work + "/notify")
    service = Service(program, work, "--http", "127.0.0.1:0", "--control", "none",
                      environment={"RUNTIME_DIRECTORY": ""})
    try:
        result("without such a directory it says how to get them",
               service.hears("READY=1") and service.says("give --token-file FILE")
               and not service.says_now("token="), service)
    finally:
        end(service)


def main():
    print("1..13")
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
            end(service)
    with tempfile.TemporaryDirectory() as work:
        stop_while_the_rig_is_read(sys.argv[1], work)
    with tempfile.TemporaryDirectory() as work:
        stop_between_two_runs(sys.argv[1], work)
    with tempfile.TemporaryDirectory() as work:
        keep_tokens_from_the_journal(sys.argv[1], work)


main()
