#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The example that closes the loop of a spring's torque by frames. It follows slow references, and
with the lag of the drive's filter not fast ones; repeats are equal. Prints TAP."""
import os
import sys

SOURCE = os.environ["HIL_SOURCE_DIR"]
os.environ["COMAN_HIL"] = sys.argv[1]
sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(SOURCE, "python"), os.path.join(SOURCE, "examples", "sea")]

print("1..2")
try:
    import closed_loop
except ImportError as error:
    for number, name in enumerate(("bandwidth", "repeats"), 1):
        print(f"ok {number} - {name} # SKIP not installed: {error.name}")
    sys.exit(0)

# 3 s, to 24 Hz
closed_loop.SWEEP_S, closed_loop.SWEEP_HZ = 3.0, 24.0
rows = [closed_loop.sweep(2.0, 3.0) for _ in range(2)]
gains = {hz: closed_loop.respond(rows[0], hz) for hz in (2, 22)}
good = 0.9 < gains[2] < 1.1 and gains[22] < 0.71
print(f"{'ok' if good else 'not ok'} 1 - gains are those of the lag")
print("#", ", ".join(f"{gain:.3f} at {hz} Hz" for hz, gain in gains.items()))
same = rows[0] == rows[1]
print(f"{'ok' if same else 'not ok'} 2 - repeats are equal")
sys.exit(not (good and same))
