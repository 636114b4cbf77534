#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: compile.py COMAN-HIL
A start that has to compile the dynamics of a robot that is not built in, with a compiler that takes
long: the service manager is asked for patience, a log and a terminal are told, nothing is left
behind, and when the compiler is killed the run begins with the numeric code. Prints TAP."""
import os
import pty
import shutil
import socket
import subprocess
import sys
import tempfile

from tap import check

PROGRAM = sys.argv[1]
PATIENCE_S = 60


def robot_of_our_own(work):
    """COMAN with another mass of the waist."""
    shutil.copytree(os.environ["HIL_SOURCE_DIR"] + "/config", work + "/config")
    path = work + "/config/robots/coman.yaml"
    with open(path) as file:
        text = file.read()
    before, mass, after = text.partition("mass_kg: ")
    with open(path, "w") as file:
        file.write(before + mass + "1" + after)


def put_compiler(work, script):
    os.makedirs(work + "/tools", exist_ok=True)
    with open(work + "/tools/cc", "w") as file:
        file.write("#!/bin/sh\n" + script)
    os.chmod(work + "/tools/cc", 0o700)


def start(work, cache, **others):
    environment = dict(os.environ, PATH=work + "/tools:" + os.environ["PATH"],
                       XDG_CACHE_HOME=work + "/" + cache)
    environment.pop("CACHE_DIRECTORY", None)
    environment.update(others.pop("env", {}))
    return subprocess.Popen(
        [PROGRAM, "run", work + "/config/rigs/coman.yaml", "--transport", "local", "--clock",
         "free", "--ticks", "50", "--control", "none"],
        env=environment, stdin=subprocess.DEVNULL, **others)


def left_behind(work, cache):
    return [name for _, folders, files in os.walk(work + "/" + cache) for name in folders + files
            if name != "coman-hil"]


def managed(work):
    """The messages to a service manager, the log and the status."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(work + "/notify")
        manager.settimeout(0.2)
        run = start(work, "managed", stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                    env={"NOTIFY_SOCKET": work + "/notify", "WATCHDOG_USEC": "5000000"})
        heard = []
        while run.poll() is None or heard[-1:] not in ([], [None]):
            try:
                heard.append(manager.recv(4096).decode())
            except socket.timeout:
                heard.append(None)
        return [text for text in heard if text], run.stderr.read().decode(), run.wait()


def on_terminal(work):
    master, slave = pty.openpty()
    run = start(work, "terminal", stdout=subprocess.DEVNULL, stderr=slave)
    os.close(slave)
    shown = b""
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:
            break
        if not part:
            break
        shown += part
    os.close(master)
    run.wait(PATIENCE_S)
    return shown.decode()


def main():
    print("1..5")
    with tempfile.TemporaryDirectory() as work:
        robot_of_our_own(work)
        put_compiler(work, "sleep 5\necho half >$TMPDIR/half.s\nkill -KILL $$\n")
        heard, log, status = managed(work)
        ready = next((i for i, text in enumerate(heard) if "READY=1" in text), len(heard))
        asked = [text for text in heard[:ready] if "EXTEND_TIMEOUT_USEC=" in text]
        check(len(asked) >= 2 and all("WATCHDOG=1" in t and "STATUS=compiling" in t for t in asked),
              "a manager is asked for patience until it is ready",
              f"{len(asked)} times, {heard[:2]}")
        check(log.count("compiling the dynamics of") == 1,
              "a log is told once in the first seconds", log[:300])
        check(status == 0 and "numeric dynamics" in log and "killed by signal 9" in log,
              "with the compiler killed it runs on the numeric code and says why", f"{status}")
        check(not left_behind(work, "managed"), "nothing is left behind",
              left_behind(work, "managed"))

        shown = on_terminal(work)
        seconds = [n for n in range(6) if f": {n} s;" in shown]
        check(len(seconds) >= 4 and "\r\x1b[K" + "dynamics: numeric" in shown,
              "a terminal shows the seconds, in one line that goes", f"{seconds} {shown[-200:]!r}")


main()
