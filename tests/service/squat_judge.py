#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Judges a recorded squat of COMAN from its signals: squat_judge.py RECORD FIRST_NUMBER [PREFIX].

Prints five TAP lines, numbered from FIRST_NUMBER on."""
import csv
import math
import sys

import tap

WEIGHT_N = 28.3574 * 9.81

record = sys.argv[1]
tap.begin(int(sys.argv[2]))
prefix = sys.argv[3] + ": " if len(sys.argv) > 3 else ""


def check(good, name, found):
    tap.check(good, prefix + name, found)


def times_down(depth):
    """How often it goes below 9 cm and comes back above 2 cm."""
    count, low = 0, False
    for d in depth:
        if d > 0.09 and not low:
            low, count = True, count + 1
        elif d < 0.02:
            low = False
    return count


def lean(row):
    return math.asin(2 * (row["base_qw"] * row["base_qy"] - row["base_qx"] * row["base_qz"]))


with open(record + "/signals.csv") as file:
    rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
depth = [rows[len(rows) // 50]["base_z_m"] - r["base_z_m"] for r in rows]
bottoms = times_down(depth)
check(bottoms == 4, "the base sinks by more than 9 cm four times and comes back each time",
      f"{bottoms} times")
check(abs(max(depth) - 0.1) < 0.003, "it sinks by 10 cm within 3 mm", f"{100 * max(depth):.2f} cm")
sway = max(abs(lean(r) - lean(rows[0])) for r in rows)
# 20 mrad: what the springs of ankles, knees and hips give way by in a squat (11 mrad), and what the
# servo gives way by beside, which damps the sway of a robot whose feet stick
check(sway < 0.025, "the trunk keeps its lean within 0.025 rad",
      f"{sway:.3f} rad about {lean(rows[0]):.3f}")

# from when it was let go until the end the momentum changes by nothing: the feet carry the weight,
# by Newton's second law
force = [r["fz_LFoot_n"] + r["fz_RFoot_n"] for r in rows]
free = next((i for i, f in enumerate(force) if f > WEIGHT_N / 2), 0)
mean = sum(force[free:]) / len(force[free:])
check(abs(mean / WEIGHT_N - 1) < 0.002, "on average the feet carry the weight within 0.2 %",
      f"{mean:.2f} N of {WEIGHT_N:.2f} N")
slip = max(math.hypot(r["base_x_m"] - rows[0]["base_x_m"], r["base_y_m"] - rows[0]["base_y_m"])
           for r in rows)
check(slip < 0.02, "the base stays within 2 cm of its place", f"{100 * slip:.2f} cm")
