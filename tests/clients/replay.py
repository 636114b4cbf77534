#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Replays what unmodified clients say to boards, and judges every answer: tests/clients/frames.
Prints TAP.

replay.py PROGRAM SCRIPT..."""
import os
import pathlib
import sys

SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
sys.path[:0] = [str(SOURCE / "python"), str(SOURCE / "tests" / "service")]

import frame_script  # noqa: E402
from tap import result  # noqa: E402
import tap  # noqa: E402

paths = [pathlib.Path(name) for name in sys.argv[2:]]
print(f"1..{len(paths)}")
for path in paths:
    try:
        frame_script.play(path, sys.argv[1])
        result(True, path.name)
    except Exception as error:  # whatever it is, the other scripts are played
        result(False, path.name, f"{type(error).__name__}: {error}")
sys.exit(tap.failed > 0)
