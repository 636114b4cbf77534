# SPDX-License-Identifier: Apache-2.0
"""tools/meshes.py writes the files of config/meshes, and ground of other shapes. Prints TAP."""
import collections
import math
import os
import subprocess
import sys
from pathlib import Path

TREE = Path(os.environ["HIL_SOURCE_DIR"])
DEGREE = math.pi / 180


def run(words):
    return subprocess.run([sys.executable, TREE / "tools/meshes.py", *words.split()],
                          capture_output=True, text=True, timeout=60)


def ground(words):
    """Vertices and faces of a shape. Fails unless the solid is closed."""
    done = run("terrain-mesh " + words)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    vertex = [tuple(map(float, line[1:])) for line in lines if line[0] == "v"]
    face = [tuple(int(v) - 1 for v in line[1:]) for line in lines if line[0] == "f"]
    edges = collections.Counter((f[i], f[(i + 1) % 3]) for f in face for i in range(3))
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in list(edges.items())), words
    return vertex, face


def shipped_meshes_are_what_the_script_writes():
    for path in sorted((TREE / "config/meshes").glob("*.obj")):
        robot, _, side = path.stem.partition("-foot-")
        text = path.read_text()
        words = f"foot-mesh {robot} {side}" if side else text.split("made by: ")[1].split("\n")[0]
        assert run(words).stdout == text, path


def heights_of_bump_and_waves_are_their_formula():
    half = 8 / (3 * math.sqrt(3)) * 0.09 / math.tan(9 * DEGREE)
    vertex, _ = ground("bump --height 0.09 --length 1.6 --side-slope 9 --cell 0.05")
    for x, y, z in vertex:
        s, t = x / 0.8 - 1, y / half
        inside = abs(s) < 1 and abs(t) < 1
        assert z < -0.1 or abs(z - inside * 0.09 * ((1 - s * s) * (1 - t * t)) ** 2) < 1.1e-6
    vertex, _ = ground("waves --height 0.03 --length 2 --count 4 --cell 0.05")
    for x, _, z in vertex:
        wave = (1 - math.cos(4 * math.pi * x)) / 2 if 0 < x < 2 else 0
        assert z < -0.1 or abs(z - 0.03 * wave) < 1.1e-6


def steps_and_ramps_have_the_slopes_that_were_asked_for():
    for words, length, levels in (
            # Three up and three down: five treads of 0.4 m, 2 cm a step; risers lean by 5 mm
            ("steps --height 0.06 --length 2 --count 3", 2, {0.02: 0.79, 0.04: 0.79, 0.06: 0.39}),
            ("ramp --height 0.1 --length 3 --slope 5", 3,
             {0.1: 3 - 2 * 0.1 / math.tan(5 * DEGREE)})):
        vertex, face = ground(words)
        found = collections.Counter()
        for a, b, c in (tuple(vertex[v] for v in f) for f in face):
            plan = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2
            if plan > 1e-9 and a[2] == b[2] == c[2] and 0 < (a[0] + b[0] + c[0]) / 3 < length:
                found[a[2]] += plan / 6  # the plate is 6 m wide
        assert found.keys() == levels.keys(), found
        assert all(abs(found[z] - levels[z]) < 1e-5 for z in levels), found


def a_seed_makes_one_rough_ground():
    first, again, other = (ground(f"waves --rough 0.02 --width 2 --seed {s}") for s in (0, 0, 1))
    assert first == again and first != other
    assert max(z for _, _, z in first[0]) == max(z for _, _, z in other[0]) == 0.03


def numbers_that_make_no_mesh_are_refused_with_their_option():
    for words, text in (
            ("", "usage"), ("foot-mesh coman both", "both"), ("terrain-mesh hill", "hill"),
            ("terrain-mesh bump --heigth 1", "--heigth"),
            ("terrain-mesh bump --height 2", "--height"),
            ("terrain-mesh bump --height 0.3 --side-slope 3", "--side-slope"),
            ("terrain-mesh bump --slope 5", "--slope"),
            ("terrain-mesh ramp --height 0.1 --slope 5", "--length"),
            ("terrain-mesh steps --count 20 --length 0.3", "--length"),
            ("terrain-mesh waves --cell 0.005", "--cell")):
        done = run(words)
        assert done.returncode == 2 and text in done.stderr, (words, done.stderr)


TESTS = (shipped_meshes_are_what_the_script_writes, heights_of_bump_and_waves_are_their_formula,
         steps_and_ramps_have_the_slopes_that_were_asked_for, a_seed_makes_one_rough_ground,
         numbers_that_make_no_mesh_are_refused_with_their_option)
print(f"1..{len(TESTS)}")
for number, test in enumerate(TESTS, 1):
    try:
        test()
        print(f"ok {number} - {test.__name__}")
    except AssertionError as reason:
        print(f"not ok {number} - {test.__name__}\n# {reason}")
