# SPDX-License-Identifier: Apache-2.0
"""The program under overload, for overload.py and overload_vcan.py: runs of it, its summary and its
recording as counts, and the books that have to close. Virtual time and counts, never wall time."""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback

from ready import wait_until_ready

PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
CONFIG = os.path.join(os.environ["HIL_SOURCE_DIR"], "config")
RIG = os.path.join(CONFIG, "rigs", "coman.yaml")
WORK = tempfile.TemporaryDirectory()
PATIENCE_S = 180    # in a guest on a busy machine a tick may take 50 ms, a start 20 s


def changed_rig(name, changes):
    """A copy of the rig with some lines changed: (regular expression, what takes its place)."""
    folder = os.path.join(WORK.name, "config")
    path = os.path.join(folder, "rigs", name + ".yaml")
    if not os.path.exists(folder):
        os.makedirs(os.path.join(folder, "rigs"))
        for part in ("robots", "meshes"):
            shutil.copytree(os.path.join(CONFIG, part), os.path.join(folder, part))
    with open(RIG) as file:
        text = file.read()
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text, flags=re.M)
        assert count == 1, pattern
    with open(path, "w") as file:
        file.write(text)
    return path


NORMAL = (r"^( +priority:) 80$", r"\1 0")    # without real-time priority


class Starved(Exception):
    """A machine so busy that the controller of a real-time run was too late for its robot."""


class Run:
    """One run of the program in the background, recording into a directory of its own."""

    count = 0

    def __init__(self, *arguments, rig=RIG, record=True, prefix=(), prepare=None, before=None):
        Run.count += 1
        self.directory = os.path.join(WORK.name, "run%d" % Run.count)
        self.out, self.err = self.directory + ".out", self.directory + ".err"
        if before:
            before(self.directory)
        recording = ["--record", self.directory] + (["--force"] if before else []) if record else []
        self.control, self.ready = self.directory + ".control", self.directory + ".ready"
        self.process = subprocess.Popen(
            [*prefix, PROGRAM, "run", rig, *recording, "--control", self.control,
             "--ready", self.ready, *arguments],
            stdin=subprocess.DEVNULL, stdout=open(self.out, "w"), stderr=open(self.err, "w"),
            preexec_fn=prepare)

    def path(self, name):
        return os.path.join(self.directory, name)

    def text(self):
        with open(self.out) as out, open(self.err) as err:
            return err.read() + out.read()

    def says(self, pattern):
        """Waits until it has written a line that fits; the match."""
        end = time.monotonic() + PATIENCE_S
        while not (found := re.search(pattern, self.text(), re.M)):
            assert self.process.poll() is None and time.monotonic() < end, \
                "never said %s:\n%s" % (pattern, self.text()[-2000:])
            time.sleep(0.02)
        return found

    def port(self):
        """The gateway's, once it is there."""
        places = wait_until_ready(self.ready, self.process, PATIENCE_S, self.text)
        return int(places["gateway_port"])

    def wrote(self, name, size=1):
        """Waits until a file of its recording has so many bytes."""
        end = time.monotonic() + PATIENCE_S
        while not os.path.exists(self.path(name)) or os.stat(self.path(name)).st_size < size:
            assert self.process.poll() is None and time.monotonic() < end, self.text()[-2000:]
            time.sleep(0.01)

    def passes(self, ticks):
        """Waits until so many more ticks have run."""
        def ctl(*words):
            answer = subprocess.run([PROGRAM, "ctl", "--socket", self.control, "--json", *words],
                                    check=True, stdout=subprocess.PIPE, timeout=PATIENCE_S)
            return json.loads(answer.stdout)

        ctl("wait", "tick=%d" % (ctl("status")["tick"] + ticks))

    def end(self, status=0, timeout=PATIENCE_S):
        """Waits for its end; the summary, None when there is none."""
        try:
            found = self.process.wait(timeout)
        finally:
            self.process.kill()
        if found == 1 and status != 1 and "task squat failed" in self.text():
            raise Starved
        assert found == status, "status %s, expected %d:\n%s" % (found, status, self.text()[-3000:])
        if not os.path.exists(self.path("summary.json")):
            return None
        with open(self.path("summary.json")) as file:
            return json.load(file)

    def kill(self):
        self.process.kill()
        self.process.wait()


def lines(path):
    """The lines of a file, every one of them whole."""
    with open(path, "rb") as file:
        data = file.read()
    assert not data or data.endswith(b"\n"), "half a line at the end of %s: %r" % (path, data[-80:])
    return data.count(b"\n")


def log(path):
    """(time in us, bus, identifier, data) of each frame of a candump log."""
    frames = []
    with open(path) as file:
        for line in file:
            found = re.fullmatch(r"\((\d+)\.(\d{6})\) (\S+) ([0-9A-F]+)#(\S*)\n", line)
            assert found, line
            frames.append((int(found[1]) * 1000000 + int(found[2]), found[3], int(found[4], 16),
                           found[5]))
    return frames


def check_clock(summary, policy="skip", tick_s=0.001):
    """The books of the real clock (rt/loop.h)."""
    accounted = summary["ticks"] + summary["dropped_deadlines"] + summary["pause_ticks"]
    left = accounted * tick_s - summary["wall_s"]
    if policy == "slip":
        assert -1.0 <= left < tick_s, left
        assert summary["dropped_deadlines"] == 0
    else:
        assert -1e-8 <= left < tick_s + 1e-8, left
        assert summary["late_ticks"] == 0
    assert abs(summary["virtual_s"] - summary["ticks"] * tick_s) < 1e-8
    overruns = dict(summary["overruns"])
    assert overruns.pop("total") == sum(overruns.values())


def check_recording(run, summary):
    """The books of the recorder (rt/recording/recorder.h)."""
    recorder = summary["recorder"]
    written = recorder["frames"] - recorder["frames_unwritten"]
    assert lines(run.path("candump.log")) == written, recorder
    rows = recorder["rows"] - recorder["rows_unwritten"]
    assert lines(run.path("signals.csv")) == 1 + rows, recorder


def check_grid(frames, ticks):
    """Time stamps lie on the grid of virtual time and never go back."""
    last = 0
    for stamp, *_ in frames:
        assert last <= stamp <= ticks * 1000 and stamp % 1000 == 0, (last, stamp)
        last = stamp


def check_telemetry(frames, bus, identifier, period_us):
    """Once it has begun, a periodic frame misses no period of virtual time."""
    stamps = [stamp for stamp, where, what, _ in frames if where == bus and what == identifier]
    assert len(stamps) > 10, (bus, hex(identifier), len(stamps))
    gaps = {b - a for a, b in zip(stamps, stamps[1:])}
    assert gaps == {period_us}, gaps


def attempt(body, tries=3):
    """What the test returns; where the machine starves it each time, why it is skipped."""
    for _ in range(tries):
        try:
            return body()
        except Starved:
            print("# the machine was too busy for a controller in real time")
    return "%d times the machine was too busy for a controller in real time" % tries


def main(tests, names=None):
    """Runs test_... functions; those of which the name is given, or all. Prints TAP."""
    chosen = [(name[5:], body) for name, body in tests.items()
              if name.startswith("test_") and (not names or name[5:] in names)]
    failed = 0
    print("1..%d" % len(chosen))
    for number, (name, body) in enumerate(chosen, 1):
        begin = time.monotonic()
        try:
            skipped = attempt(body)
            print("ok %d - %s%s" % (number, name, " # SKIP " + skipped if skipped else ""))
        except Exception:
            failed += 1
            print("not ok %d - %s" % (number, name))
            print("".join("# %s\n" % line for line in traceback.format_exc().splitlines()), end="")
        print("#   %.1f s" % (time.monotonic() - begin))
        sys.stdout.flush()
    return failed
