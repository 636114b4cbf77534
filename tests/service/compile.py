#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: compile.py COMAN-HIL
A start that has to compile the dynamics of a robot that is not built in, with a compiler that takes
long. One that waits: the service manager is asked for patience, a log and a terminal are told,
nothing is left behind, and when the compiler is killed the run begins with the numeric code. One
with the real clock: it is ready and runs on the numeric code while a process that has nothing of
the run's compiles for the next start, which says how that ended. Prints TAP."""
import os
import pty
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from tap import check

PROGRAM = sys.argv[1]
PATIENCE_S = 60


def robot_of_our_own(work):
    """COMAN whose first joint is a millimetre ahead."""
    shutil.copytree(os.environ["HIL_SOURCE_DIR"] + "/config", work + "/config")
    path = work + "/config/robots/coman.yaml"
    with open(path) as file:
        text = file.read()
    before, origin, after = text.partition("origin: {xyz_m: [0.0,")
    with open(path, "w") as file:
        file.write(before + origin.replace("0.0", "0.001") + after)


def put_compiler(work, script):
    os.makedirs(work + "/tools", exist_ok=True)
    with open(work + "/tools/cc", "w") as file:
        file.write("#!/bin/sh\n" + script)
    os.chmod(work + "/tools/cc", 0o700)


def start(work, cache, options=("--clock", "free", "--ticks", "50"), **others):
    environment = dict(os.environ, PATH=work + "/tools:" + os.environ["PATH"],
                       XDG_CACHE_HOME=work + "/" + cache)
    environment.pop("CACHE_DIRECTORY", None)
    environment.update(others.pop("env", {}))
    return subprocess.Popen(
        [PROGRAM, "run", work + "/config/rigs/coman.yaml", "--transport", "local", "--control",
         "none", *options],
        env=environment, stdin=subprocess.DEVNULL, **others)


def left_behind(work, cache):
    return sorted(name for _, folders, files in os.walk(work + "/" + cache)
                  for name in folders + files if name != "coman-hil")


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


# ---- in the background ----

# Says that it is there, and goes on when it may.
SLOW_COMPILER = """
touch "$NOTES/$$.said" # by another process: this one opens nothing
while [ ! -e "$NOTES/go" ]; do sleep 0.1; done
PATH=${PATH#*:}
"""
REAL = ("--clock", "real", "--duration", "1", "--quiet")


class Folder:
    """A compiler, what it has noted, a cache."""

    def __init__(self, work, name, end):
        self.work, self.cache, self.notes = work, name, f"{work}/{name}-notes"
        os.mkdir(self.notes)
        put_compiler(work, f"NOTES={self.notes}\n" + SLOW_COMPILER + end)

    def begin(self, *more, **others):
        return start(self.work, self.cache, [*REAL, *more], stdout=subprocess.DEVNULL,
                     stderr=subprocess.PIPE, text=True, **others)

    def run(self, *more, **others):
        """Its log and status."""
        run = self.begin(*more, **others)
        log = run.communicate(timeout=PATIENCE_S)[1]
        return log, run.returncode

    def said(self):
        return [name for name in os.listdir(self.notes) if name.endswith(".said")]

    def compiler(self):
        """The process of the first one that was started, as long as it may not go on."""
        return "/proc/" + wait_for(self.said)[0].removesuffix(".said") + "/"

    def go(self):
        with open(self.notes + "/go", "w"):
            pass

    def left(self):
        return left_behind(self.work, self.cache)

    def wait(self, end):
        """Until the cache has nothing but a file of that kind."""
        return wait_for(lambda: len(self.left()) == 1 and self.left()[0].endswith(end))


def wait_for(found):
    until = time.monotonic() + PATIENCE_S
    while not found() and time.monotonic() < until:
        time.sleep(0.05)
    return found()


def read(path):
    with open(path) as file:
        return file.read()


def signals_kept(process):
    """Which signals it ignores or blocks, but 32 and 33, the C library's own."""
    status = dict(line.split(":", 1) for line in read(process + "status").splitlines())
    return (int(status["SigIgn"], 16) | int(status["SigBlk"], 16)) & ~0x180000000


def judge_process(process):
    """What the compiler inherits of a run in real time: nothing."""
    stat = read(process + "stat").rpartition(")")[2].split()
    session, nice, policy = int(stat[3]), int(stat[16]), int(stat[38])
    check(policy == os.SCHED_IDLE and nice == 19 and int(read(process + "oom_score_adj")) == 1000,
          "its compiler has the lowest priority", f"policy {policy}, nice {nice}")
    # a shell blocks all signals while it starts its next sleep: what is blocked always counts
    until = time.monotonic() + PATIENCE_S
    while (signals := signals_kept(process)) and time.monotonic() < until:
        time.sleep(0.01)
    check(session != os.getsid(0) and signals == 0, "a session and signals of its own",
          f"{session}, {signals:x}")
    # the shell holds the script that it reads
    files = {number: os.readlink(f"{process}fd/{number}") for number in os.listdir(process + "fd")}
    inherited = [files[number] for number in sorted(files) if "/tools/" not in files[number]]
    check(len(inherited) == 3 and inherited[0] == "/dev/null"
          and all(name.endswith(".building") for name in inherited[1:]),
          "and no file but the cache's", inherited)


def two_starts(work):
    folder = Folder(work, "two", 'exec cc "$@"\n')
    runs = [folder.begin() for _ in range(2)]
    logs = [run.communicate(timeout=PATIENCE_S)[1] for run in runs]
    text = sorted("another start is compiling" in log for log in logs)
    check([run.returncode for run in runs] == [0, 0]
          and all("dynamics: numeric" in log for log in logs),
          "two starts run on the numeric code while a compiler stands still", logs)
    process = folder.compiler()
    check(text == [False, True] and len(folder.said()) == 1,
          "one of them compiles, after its end too", f"{text}, {folder.said()}")
    judge_process(process)
    folder.go()
    check(folder.wait(".so"), "the module is all that remains", folder.left())
    log, status = folder.run()
    check(status == 0 and "dynamics: generated dynamics" in log and "found in" in log,
          "the next start takes it", log)
    log, status = folder.run("--compile", "never")
    check(status == 0 and "dynamics: numeric" in log, "but not one that must not", log)


def ready_at_once(work):
    """A service with a compiler that stands still, which is then killed."""
    folder = Folder(work, "failing", "echo half >$TMPDIR/half.s\necho trouble\nkill -KILL $$\n")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(work + "/notify-real")
        manager.settimeout(PATIENCE_S)
        run = folder.begin(env={"NOTIFY_SOCKET": work + "/notify-real"})
        heard = [manager.recv(4096).decode()]
        while "READY=1" not in heard[-1]:
            heard.append(manager.recv(4096).decode())
        log = run.communicate(timeout=PATIENCE_S)[1]
    check("READY=1" in heard[-1] and not any("EXTEND" in text for text in heard)
          and "in the background" in log, "a service is ready without asking for patience",
          heard[:3])
    folder.compiler()
    folder.go()
    check(folder.wait(".failed"), "of a compiler that is killed a note remains", folder.left())
    log, status = folder.run()
    check(status == 0 and "numeric" in log and "killed by signal 9" in log
          and folder.left()[0] in log, "the next start says so", log)
    check("\ntrouble\n" in read(f"{work}/{folder.cache}/coman-hil/{folder.left()[0]}"),
          "with what the compiler has said")
    check(len(folder.said()) == 1, "and does not try again", folder.said())
    doctor = subprocess.run([PROGRAM, "doctor", work + "/config/rigs/coman.yaml", "--local",
                             "--measure", "0"], capture_output=True, text=True,
                            env=dict(os.environ, PATH=work + "/tools:" + os.environ["PATH"],
                                     XDG_CACHE_HOME=work + "/" + folder.cache)).stdout
    check("killed by signal 9" in doctor, "doctor says it too", doctor.splitlines()[-1:])


def main():
    print("1..19")
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
        two_starts(work)
        ready_at_once(work)


main()
