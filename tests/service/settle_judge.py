#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Judges two recordings, one from the rig's start and one settled: settle_judge.py RIG SETTLED
NUMBER.

The weight is the sum of the robot file's masses times gravity; F/T frames are decoded here."""
import csv
import json
import math
import re
import sys

import tap

WEIGHT = 28.3574 * 9.81  # N
FULL_SCALE = (2000.0, 40.0)  # N, N m, of the legs' boards
SENSOR_Z = -0.065  # m, in the foot's frame
FEET = {("can1", "3D"): "LFoot", ("can2", "3E"): "RFoot"}

tap.begin(int(sys.argv[3]))


def rows(folder):
    with open(folder + "/signals.csv", encoding="ascii") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def carried(row):
    return row["fz_RFoot_n"] + row["fz_LFoot_n"]


def peak(table):
    """Largest deviation from the weight within 0.3 s after the links are let go."""
    time = next(iter(table[0]))
    free = next(i for i, row in enumerate(table)
                if row["q_RKneeSag_rad"] != table[0]["q_RKneeSag_rad"])
    end = table[free][time] + 0.3
    return max(abs(carried(row) - WEIGHT) for row in table[free:] if row[time] < end)


def frames(folder):
    """F/T frames as (ns, foot, three components, whether they are torques)."""
    pattern = re.compile(r"\((\d+)\.(\d+)\) (can\d) (3[DE])([AB])#([0-9A-F]{12})$")
    with open(folder + "/candump.log", encoding="ascii") as file:
        for line in file:
            match = pattern.match(line.strip())
            if match and match.group(3, 4) in FEET:
                s, us, bus, address, kind, data = match.groups()
                counts = [int(data[i + 2:i + 4] + data[i:i + 2], 16) for i in (0, 4, 8)]
                torque = kind == "B"
                scale = FULL_SCALE[torque] / 0x8000
                yield (int(s) * 10**6 + int(us), FEET[bus, address],
                       [(c - 0x8000) * scale for c in counts], torque)


before, after = rows(sys.argv[1]), rows(sys.argv[2])
clock = next(iter(after[0]))
transient, settled = peak(before), peak(after)
tap.check(abs(carried(after[0]) - WEIGHT) < 1e-3, "the feet carry the weight at the first tick",
        "%.6f N of %.6f N" % (carried(after[0]), WEIGHT))
tap.check(transient > 0.2 * WEIGHT and settled < 0.01 * WEIGHT,
        "the controller takes over without a jolt",
        "largest deviation within 0.3 s of letting go: %.2f N, from the rig's start %.1f N"
        % (settled, transient))

# moments are about the foot's origin; feet are flat within a milliradian or so
at = {round(row[clock] * 1e6): row for row in after}
worst, count = [0.0, 0.0], 0
for time, foot, value, torque in frames(sys.argv[2]):
    row = at[time]
    force = [row["f%s_%s_n" % (x, foot)] for x in "xyz"]
    moment = [row["m%s_%s_nm" % (x, foot)] for x in "xyz"]
    moment[0] += SENSOR_Z * force[1]
    moment[1] -= SENSOR_Z * force[0]
    wanted = moment if torque else force
    worst[torque] = max([worst[torque]] + [abs(a - b) for a, b in zip(value, wanted)])
    count += 1
tap.check(count > 2000 and worst[0] < 0.5 and worst[1] < 0.05,
        "F/T frames say what the contacts exert",
        "%d frames, worst %.3f N and %.4f N m" % (count, worst[0], worst[1]))

for folder, start in ((sys.argv[1], "rig's"), (sys.argv[2], "settled")):
    with open(folder + "/summary.json", encoding="utf-8") as file:
        energy = json.load(file)["energy"]
    part = abs(energy["balance_j"]) / energy["turnover_j"]
    tap.check(math.isfinite(part) and part < 0.01,
            "the energy balances within the integrator's order from the %s start" % start,
            "%.1e of %.1f J" % (part, energy["turnover_j"]))
