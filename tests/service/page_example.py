#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The example of a client draws a curve of what a run does. Prints TAP."""
import os
import re
import subprocess
import sys

from page_client import Simulator
from tap import check

EXAMPLE = os.path.join(os.environ["HIL_SOURCE_DIR"], "examples", "page", "plot.py")


def main():
    print("1..2")
    try:
        import websocket  # noqa: F401
    except ImportError:
        for _ in range(2):
            check(True, "a plot # SKIP python3-websocket is not installed")
        return
    with Simulator("coman", "--clock", "real", "--task", "squat") as run:
        done = subprocess.run([sys.executable, EXAMPLE, run.look, "1.5", "q_*KneeSag_rad"],
                              capture_output=True, text=True, timeout=30, check=False)
    curves = re.findall(r'points="([^"]*)"', done.stdout)
    check(done.returncode == 0 and len(curves) == 2, "two curves are drawn", done.stderr[-300:])
    check(all(len(curve.split()) > 40 for curve in curves) and "rad</text>" in done.stdout,
          "of many points, with their units", [len(curve.split()) for curve in curves])


main()
