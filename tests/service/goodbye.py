#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: goodbye.py COMAN-HIL
Whoever watches a run goes away: the terminal closes (SIGHUP), nobody reads its standard error or
output any more (SIGPIPE). The run ends as an interrupted one does, with its summary and whole logs.
Prints TAP."""
import json
import os
import signal
import subprocess
import sys
import tempfile
import time

from tap import check

PROGRAM = sys.argv[1]
RIG = os.environ["HIL_SOURCE_DIR"] + "/config/rigs/coman.yaml"
PATIENCE_S = 60


class Run:
    def __init__(self, folder, *arguments, hangup=signal.SIG_DFL, out=None, err=None):
        self.folder = folder
        self.process = subprocess.Popen(
            [PROGRAM, "run", RIG, "--transport", "local", "--record", folder, *arguments],
            stdin=subprocess.DEVNULL, stdout=out or subprocess.DEVNULL,
            stderr=err or subprocess.DEVNULL,
            preexec_fn=lambda: signal.signal(signal.SIGHUP, hangup))

    def rows(self):
        try:
            with open(self.folder + "/signals.csv") as file:
                return len(file.readlines())
        except OSError:
            return 0

    def wait_for_rows(self, count):
        end = time.monotonic() + PATIENCE_S
        while self.rows() < count and self.process.poll() is None and time.monotonic() < end:
            time.sleep(0.02)

    def end(self):
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def in_order(self):
        """Stopped by request, with a summary, and files whose last line is whole."""
        try:
            with open(self.folder + "/summary.json") as file:
                stopped = json.load(file)["end"] == "stopped"
        except (OSError, ValueError):
            return False
        for name in ("/candump.log", "/signals.csv"):
            with open(self.folder + name, "rb") as file:
                text = file.read()
            stopped = stopped and (text.endswith(b"\n") or not text)
        return stopped


def main():
    print("1..5")
    with tempfile.TemporaryDirectory() as work:
        run = Run(work + "/hangup", "--task", "squat", "--clock", "real")
        run.wait_for_rows(200)
        run.process.send_signal(signal.SIGHUP)
        run.process.send_signal(signal.SIGHUP)
        status = run.end()
        check(status == 0 and run.in_order(), "a terminal that closes ends a run in order",
              f"status {status}")

        run = Run(work + "/nohup", "--clock", "real", hangup=signal.SIG_IGN)
        run.wait_for_rows(10)
        run.process.send_signal(signal.SIGHUP)
        before = run.rows()
        run.wait_for_rows(before + 30)
        goes_on = run.process.poll() is None and run.rows() >= before + 30
        run.process.terminate()
        check(run.end() == 0 and goes_on and run.in_order(), "under nohup it goes on")

        # each begin and end of a fault is a line
        faults = [a for n in range(1, 31) for a in
                  ("--fault", f"motor LKneeSag jam {n / 10}..{n / 10 + 0.05:.2f}")]
        reading, writing = os.pipe()
        run = Run(work + "/stderr", "--clock", "real", *faults, err=writing, out=subprocess.PIPE)
        os.close(writing)
        run.wait_for_rows(10)
        os.close(reading)
        out = run.process.stdout.read().decode()
        status = run.end()
        check(status == 0 and run.in_order() and "state hash" in out,
              "a pipe at standard error that nobody reads ends a run in order",
              f"status {status}")

        reading, writing = os.pipe()
        run = Run(work + "/both", "--clock", "real", *faults, err=writing, out=writing)
        os.close(writing)
        run.wait_for_rows(10)
        os.close(reading)
        status = run.end()
        check(status == 3 and run.in_order(),
              "with standard output too the summary is in its file, and the status says the rest",
              f"status {status}")

        reading, writing = os.pipe()
        os.close(reading)
        run = Run(work + "/dead", "--clock", "free", "--ticks", "300", out=writing)
        os.close(writing)
        status = run.end()
        with open(run.folder + "/summary.json") as file:
            end = json.load(file)["end"]
        check(status == 3 and end == "ran its length",
              "standard output that was never read costs the printed summary only",
              f"status {status}, {end}")


main()
