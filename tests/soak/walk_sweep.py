#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: walk_sweep.py COMAN-HIL CASES [SEED [LARGEST_PUSH_N_S]]

How often COMAN falls when it walks at 0.15 m/s with noisy sensors and is pushed, over random cases:
seed of the noise, friction of the ground, a load at the chest, and time, direction and size of the
push (up to 6 N s unless it is given). Prints the share of falls by size and by direction of the
push, each with its Wilson interval (95 %). The figures of docs/walking.md come from here; it judges
nothing.
"""
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
GROUND = """scene:
  materials:
    ground: {{static_friction: {static:.3f}, dynamic_friction: {dynamic:.3f}}}
"""
SCENARIO = """name: {name}
description: a case of the sweep
rig: {name}-rig.yaml
task: walk
seed: {seed}
duration_s: 14.0
cpu_limit_s: 600
stimuli:
  - {{at_s: 2.0, push: {{body: DWYTorso, force_n: [0, 0, {load:.2f}]}}}}
  - {{at_s: {at:.3f}, push: {{body: Waist, force_n: [{x:.2f}, {y:.2f}, 0]}}, for_s: 0.1}}
expectations:
  - {{name: goes on, signal: task.status, between: [0, 0]}}
  - {{name: upright, signal: base.tilt, between: [0.0, 0.6]}}
"""
SIDES = ("forward", "to the left", "backward", "to the right")


def wilson(falls, cases):
    """The interval of 95 % of a share."""
    z, p = 1.96, falls / cases
    middle = p + z * z / (2 * cases)
    half = z * math.sqrt(p * (1 - p) / cases + z * z / (4 * cases * cases))
    return [max(0.0, (middle - half) / (1 + z * z / cases)), (middle + half) / (1 + z * z / cases)]


def make_case(folder, number, source, largest):
    """Writes a case; returns its name, the size of its push in N s, and its direction."""
    name, size = f"case-{number}", source.uniform(0, largest)
    angle, friction = source.uniform(0, 2 * math.pi), source.uniform(0.3, 1.1)
    rig = (ROOT / "config/rigs/walk-sensors.yaml").read_text().replace("extends: ",
                                                                      "extends: config/rigs/")
    (folder / f"{name}-rig.yaml").write_text(
        rig + GROUND.format(static=friction, dynamic=0.8 * friction))
    (folder / f"{name}.yaml").write_text(SCENARIO.format(
        name=name, seed=number + 1, load=-source.uniform(0, 12), at=source.uniform(9.0, 10.5),
        x=10 * size * math.cos(angle), y=10 * size * math.sin(angle)))
    return name, size, SIDES[int((angle / (math.pi / 2) + 0.5) % 4)]


def main():
    program, count = os.path.abspath(sys.argv[1]), int(sys.argv[2])
    source = random.Random(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    largest = float(sys.argv[4]) if len(sys.argv) > 4 else 6
    groups = {}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "config").symlink_to(ROOT / "config")
        cases = [make_case(folder, i, source, largest) for i in range(count)]
        command = [program, "test", "--jobs", "2", "--junit", "results.xml", "--output", "out"]
        subprocess.run(command + [f"{case[0]}.yaml" for case in cases], cwd=folder, check=False,
                       stdout=subprocess.DEVNULL)
        fell = {}
        for test in ElementTree.parse(folder / "results.xml").iter("testcase"):
            fell[test.get("name").split()[0]] = test.find("failure") is not None
            if test.find("error") is not None:
                sys.exit(f"{test.get('name')} did not run")
    for case, size, side in cases:
        for group in ("all", f"{2 * int(size / 2)} to {2 * int(size / 2) + 2} N s", side):
            groups.setdefault(group, []).append(fell[case])
    for group, falls in sorted(groups.items(), key=lambda item: (len(item[0].split()[0]), item)):
        low, high = wilson(sum(falls), len(falls))
        print(f"| {group} | {sum(falls)} of {len(falls)} | {100 * sum(falls) / len(falls):.0f} % "
              f"| {100 * low:.0f} to {100 * high:.0f} % |")


if __name__ == "__main__":
    main()
