#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The main job: COMAN squats four times, driven over its five CAN buses in lockstep, and stays up.
# Judged from the recording, not from what the controller says. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

timeout -k 5 280 "$HIL_BINARY_DIR/rt/coman-hil" run "$HIL_SOURCE_DIR/config/rigs/coman.yaml" \
    --transport local --clock lockstep --task squat --quiet --record "$work/squat" \
    >"$work/out" 2>"$work/err" </dev/null
echo $? >"$work/status"

python3 - "$work" <<'END'
import csv, math, sys

work = sys.argv[1]
number = 0


def check(good, name, found):
    global number
    number += 1
    print(f"{'ok' if good else 'not ok'} {number} - {name}\n# {found}", flush=True)


print("1..6")
status = open(work + "/status").read().strip()
errors = open(work + "/err").read().strip().splitlines()[-1:]
check(status == "0", "the run ends with status 0, the task done", f"status {status} {errors}")
try:
    rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(open(work + "/squat/signals.csv"))]
except OSError:
    rows = []
if not rows:
    sys.exit("no recording")

height = [r["base_z_m"] for r in rows]
start = height[len(height) // 50]
depth = [start - z for z in height]
bottoms = 0
low = False
for d in depth:
    if d > 0.09 and not low:
        low, bottoms = True, bottoms + 1
    elif d < 0.02:
        low = False
check(bottoms == 4, "the base sinks by more than 9 cm four times and comes back each time", f"{bottoms} times")
check(0.09 < max(depth) < 0.12, "about 10 cm deep", f"{100 * max(depth):.2f} cm")
lean = [math.asin(2 * (r["base_qw"] * r["base_qy"] - r["base_qx"] * r["base_qz"])) for r in rows]
sway = max(abs(angle - lean[0]) for angle in lean)
check(sway < 0.05, "the trunk keeps its lean within 0.05 rad", f"{sway:.3f} rad about {lean[0]:.3f}")

# over the whole run the momentum changes by nothing: the feet carry the weight, by Newton's second law
weight = 28.3574 * 9.81
mean = sum(r["fz_LFoot_n"] + r["fz_RFoot_n"] for r in rows) / len(rows)
check(abs(mean / weight - 1) < 0.01, "on average the feet carry the weight within 1 %", f"{mean:.2f} N of {weight:.2f} N")
slip = max(math.hypot(r["base_x_m"] - rows[0]["base_x_m"], r["base_y_m"] - rows[0]["base_y_m"]) for r in rows)
check(slip < 0.05, "the base stays within 5 cm of its place", f"{100 * slip:.2f} cm")
END
