#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How the cost of a run grows with what is in it (./dev scaling): makes robots, scenes and benches
of growing size, runs each of them, and writes the tables of docs/scaling.md. A tick's cost is the
CPU time of all threads of a long run less that of a short one; a start's is what the short one
costs before its ticks. The least of the repeats counts: other work on the machine only adds to it.
What is too large keeps the words with which it was refused."""
import argparse
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = ROOT / "build" / "release" / "coman-hil"
PAGE = ROOT / "docs" / "scaling.md"
RIGS = ROOT / "config" / "rigs"
SHORT, LONG = 100, 1100      # ticks
ENOUGH_S = 0.6               # of CPU time in the longer run
SQUAT, HOLD = 15000, 11000   # ticks, less than these tasks take
ENOUGH_BYTES = 10000         # that a client has read when it counts as one
sys.path.insert(0, str(ROOT / "tests" / "service"))
os.environ.setdefault("HIL_BINARY_DIR", str(PROGRAM.parent))
os.environ.setdefault("HIL_SOURCE_DIR", str(ROOT))


class Refused(Exception):
    """Its text says why, without the folder of the files."""


def run(*arguments):
    """Runs the program to its end: CPU seconds, MB of its largest moment."""
    with tempfile.TemporaryFile("w+") as log:
        child = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=log, stderr=log,
                                 stdin=subprocess.DEVNULL)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        log.seek(0)
        text = log.read()
    if child.returncode == 2:
        found = re.search(r"(?:ERROR|error:?) *(.*)", text)
        raise Refused(re.sub(r"\S*/", "", found[1] if found else text.strip().splitlines()[-1]))
    if child.returncode:
        raise SystemExit(f"{arguments}: {text[-2000:]}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def cost(rig, *options, repeats=3, most=100000):
    """Microseconds a tick, milliseconds of start, MB. most: ticks before a task ends."""
    common = ("run", rig, "--clock", "free", "--transport", "local", "--control", "none", "--quiet",
              *options)
    first = run(*common, "--ticks", SHORT)[0]
    guess = max(run(*common, "--ticks", LONG)[0] - first, 0.01) / (LONG - SHORT)
    count = SHORT + min(most, max(LONG, int(ENOUGH_S / guess)))
    runs = [(run(*common, "--ticks", SHORT), run(*common, "--ticks", count))
            for _ in range(repeats)]
    short, long = (min(pair[i][0] for pair in runs) for i in (0, 1))
    tick = (long - short) / (count - SHORT)
    return 1e6 * tick, 1e3 * (short - SHORT * tick), runs[0][1][1]


# ---- robots and scenes of a size ----

def limbs(folder, joints, a_limb):
    """An imported robot of limbs with so many joints each; boards of compact over CAN FD."""
    solid = ('<inertial><origin xyz="0 0 -0.05"/><mass value="1"/><inertia ixx="0.002" '
             'iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>')
    links = [f'<link name="base">{solid}</link>']
    for k in range(joints):
        first = k % a_limb == 0
        place = f"{0.2 * (k // a_limb)} 0 0" if first else "0 0 -0.1"
        links.append(f'<link name="l{k}">{solid}</link><joint name="j{k}" type="revolute">'
                     f'<parent link="{"base" if first else f"l{k - 1}"}"/><child link="l{k}"/>'
                     f'<origin xyz="{place}"/><axis xyz="{["0 0 1", "0 1 0", "1 0 0"][k % 3]}"/>'
                     '<limit lower="-2" upper="2" effort="50" velocity="10"/></joint>')
    file = folder / "limbs.urdf"
    file.write_text(f'<robot name="limbs">{"".join(links)}</robot>')
    run("import", file, "-o", folder, "--protocol", "compact-fd",
        "--force")
    return folder / "rigs" / "limbs.yaml"


def spheres(folder, count):
    """A leg of two joints, and so many free spheres that roll on the ground."""
    rig = limbs(folder, 2, 2)
    lines = [f"  - {{name: ball{k}, mass_kg: 1.0, box_m: [0.1, 0.1, 0.1], "
             f"xyz_m: [{0.3 * (k % 16)}, {1 + 0.3 * (k // 16)}, 0.05]}}" for k in range(count)]
    surfaces = [f"  - {{name: ball{k}, body: ball{k}, shape: sphere, radius_m: 0.05, "
                "material: rubber}" for k in range(count)]
    pairs = [f"  - between: [ground, ball{k}]" for k in range(count)]
    scene = f"""
scene:
  engine: native
  materials:
    rubber: {{young_pa: 1.0e6, thickness_m: 1.0e-2, dissipation_s_per_m: 1.0, static_friction: 0.9,
             dynamic_friction: 0.8, viscous_s_per_m: 0.0}}
  bodies:
{chr(10).join("  " + line for line in lines)}
  surfaces:
    - {{name: ground, body: world, shape: half_space, material: rubber}}
{chr(10).join("  " + line for line in surfaces)}
  pairs:
{chr(10).join("  " + line for line in pairs)}
"""
    rig.write_text(rig.read_text() + (scene if count else ""))
    return rig


def terrain(folder, triangles, cell_m=0.2):
    """COMAN on a ground of so many triangles, two a cell, level in the middle two meters."""
    # A rig may not name files outside of its tree
    shutil.copytree(ROOT / "config", folder / "config")
    side = round((triangles / 2) ** 0.5)
    grid = range(side + 1)
    with open(folder / "config" / "meshes" / "ground.obj", "w") as obj:
        obj.write("v 0 0 -1\n")
        for i in grid:
            x = cell_m * (i - side / 2)
            obj.writelines(f"v {x:.6f} {cell_m * (j - side / 2):.6f} "
                           f"{0.001 * max(0, x * x - 1):.6f}\n" for j in grid)
        for i in grid[:-1]:
            for a in range(i * (side + 1) + 2, (i + 1) * (side + 1) + 1):
                b = a + side + 1
                obj.write(f"f {a} {b} {b + 1}\nf {a} {b + 1} {a + 1}\n")
        # Closed by walls, and a floor as a fan about its middle
        rim = ([(0, j) for j in grid[:-1]] + [(i, side) for i in grid[:-1]] +
               [(side, j) for j in grid[:0:-1]] + [(i, 0) for i in grid[:0:-1]])
        top = [i * (side + 1) + j + 2 for i, j in rim]
        low = range((side + 1) ** 2 + 2, (side + 1) ** 2 + 2 + len(rim))
        obj.writelines(f"v {cell_m * (i - side / 2):.6f} {cell_m * (j - side / 2):.6f} -1\n"
                       for i, j in rim)
        for a, b, c, d in zip(top, top[1:] + top[:1], low, [*low[1:], low[0]]):
            obj.write(f"f {a} {b} {d}\nf {a} {d} {c}\nf 1 {c} {d}\n")
    rig = folder / "config" / "rigs" / "terrain.yaml"
    rig.write_text("""extends: coman.yaml
name: terrain
scene:
  surfaces:
    - {name: ground, body: world, shape: mesh, mesh: ../meshes/ground.obj, material: ground}
    - {name: right_foot, body: RFoot, shape: mesh, material: foot,
       mesh: ../meshes/coman-foot-right.obj}
    - {name: left_foot, body: LFoot, shape: mesh, material: foot,
       mesh: ../meshes/coman-foot-left.obj}
""")
    return rig


def benches(folder, nbus, a_bus):
    """Limbs of one joint, so many motor boards on each of so many buses."""
    rig = limbs(folder, nbus * a_bus, 1)
    text = rig.read_text()
    head, _, rest = text.partition("\nbuses:\n")
    buses = "".join(
        f"  - name: bus{b}\n    interface: can{b}\n    boards:\n" + "".join(
            f"      - {{kind: motor, address: {k + 1}, axes: [j{b * a_bus + k}]}}\n"
            for k in range(a_bus)) for b in range(nbus))
    rig.write_text(f"{head}\nbuses:\n{buses}\n{rest[rest.index('tasks:'):]}")
    return rig


# ---- clients ----

class Crowd:
    """So many clients of a run in real time, each with an address of its own, that read all they
    get; inside is how many of them got something to read."""

    def __init__(self, count, enter):
        self.inside = 0
        self.threads = [threading.Thread(target=self.read, args=(enter, k), daemon=True)
                        for k in range(count)]

    def read(self, enter, number):
        try:
            connection = enter(f"127.0.1.{number + 1}")
            got = 0
            while part := connection.recv(1 << 16):
                self.inside += got <= ENOUGH_BYTES < got + len(part)
                got += len(part)
        except (OSError, EOFError, AssertionError, KeyError, TypeError):
            pass      # a page that is refused has no greeting


def crowd_cost(kind, count):
    """CPU time of the simulator a tick of the squat, with clients of the gateway or of the page."""
    def once(ticks):
        folder = pathlib.Path(tempfile.mkdtemp(dir=WORK.name))
        ready = folder / "ready"
        option = {"gateway": "--gateway", "page": "--http"}[kind]
        child = subprocess.Popen(
            [PROGRAM, "run", RIGS / "coman.yaml", "--task", "squat", "--clock", "real",
             "--transport", "local", "--control", "none", "--http-linger", "0", "--token-file",
             "none", "--quiet", option, "0", "--ready", ready, "--ticks", str(ticks)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        places = wait_until_ready(str(ready), child, 30, lambda: "")
        if kind == "gateway":
            enter = lambda source: gateway_client(places["gateway_port"], source)
        else:
            enter = lambda source: page_client(places["page_view"], source)
        crowd = Crowd(count, enter)
        for thread in crowd.threads:
            thread.start()
        _, _, used = os.wait4(child.pid, 0)
        child.returncode = 0
        inside.append(crowd.inside)
        return used.ru_utime + used.ru_stime
    short, long, inside = 1000, 4000, []
    tick = 1e6 * min(once(long) - once(short) for _ in range(2)) / (long - short)
    most = max(inside)
    return tick, None, None, count if most == count else f"{count}, of whom {most} got in"


def gateway_client(port, source):
    connection = socket.create_connection(("127.0.0.1", int(port)), 10, (source, 0))
    connection.settimeout(20)
    for line in ("< open can1 >", "< rawmode >"):
        connection.sendall(line.encode())
    return connection


def page_client(address, source):
    from page_client import Page
    page = Page(int(re.search(r":(\d+)/", address)[1]), address, source=source)
    page.ask("watch", rate_hz=60)
    return page.connection


# ---- tables ----

def growth(values, costs):
    """The exponent between the last two sizes: 1 is linear."""
    from math import log
    pairs = [(v, c) for v, c in zip(values, costs) if isinstance(v, int) and v and c > 0]
    if len(pairs) < 2:
        return ""
    (a, x), (b, y) = pairs[-2:]
    return f"{log(y / x) / log(b / a):.1f}"


def table(title, sizes, measure):
    """Rows of size, microseconds a tick, milliseconds of start, MB, growth from the row before."""
    lines = [f"| {title} | µs a tick | start ms | MB | grows with the power |",
             "|--:|--:|--:|--:|--:|"]
    seen = []
    for size in sizes:
        with tempfile.TemporaryDirectory(dir=WORK.name) as folder:
            try:
                tick, start, memory, *words = measure(pathlib.Path(folder), size)
            except Refused as refused:
                lines.append(f"| {size} | {refused} | | | |")
                print(lines[-1], flush=True)
                continue
        seen.append((size, tick))
        power = growth(*zip(*seen)) if len(seen) > 1 else ""
        start, memory = (f"{value:.0f}" if value is not None else "" for value in (start, memory))
        shown = words[0] if words else size
        lines.append(f"| {shown} | {tick:.1f} | {start} | {memory} | {power} |")
        print(lines[-1], flush=True)
    return lines


def recordings(folder, how):
    record = ("--record", folder / "recording", "--force")
    options = {"off": (), "csv, 10 ms": record,
               "csv, 1 ms": (*record, "--record-period", 1),
               "mcap, 1 ms": (*record, "--record-period", 1, "--record-format", "mcap")}[how]
    return cost(RIGS / "coman.yaml", "--task", "squat", *options, most=SQUAT)


JOINTS = (6, 12, 24, 48, 96, 120, 132)
SERIES = {
    "limbs": lambda: table("joints, in limbs of 6", JOINTS,
                           lambda f, n: cost(limbs(f, n, 6), "--task", "hold", most=HOLD)),
    "chain": lambda: table("joints, in one chain", JOINTS,
                           lambda f, n: cost(limbs(f, n, n), "--task", "hold", most=HOLD)),
    "contacts": lambda: table("spheres on the ground", (0, 1, 3, 10, 30, 100, 200),
                              lambda f, n: cost(spheres(f, n))),
    "triangles": lambda: table("triangles of the ground, in cells of 20 cm",
                               (1000, 10000, 50000, 200000, 1000000),
                               lambda f, n: cost(terrain(f, n), "--task", "squat", repeats=2,
                                              most=SQUAT)),
    "cells": lambda: table("cells a meter, of the same ground", (2, 5, 10, 20, 40),
                           lambda f, n: cost(terrain(f, 2 * (6 * n) ** 2, 1 / n), "--task",
                                             "squat", repeats=2, most=SQUAT)),
    "boards": lambda: table("motor boards on one bus", (1, 2, 4, 8, 16, 31, 32),
                            lambda f, n: cost(benches(f, 1, n), "--task", "hold", most=HOLD)),
    "buses": lambda: table("buses of two boards", (1, 2, 4, 8, 16, 32, 64),
                           lambda f, n: cost(benches(f, n, 2), "--task", "hold", most=HOLD)),
    "recording": lambda: table("recording", ("off", "csv, 10 ms", "csv, 1 ms", "mcap, 1 ms"),
                               recordings),
    "gateway": lambda: table("clients of the gateway", (0, 1, 4, 16, 64),
                             lambda f, n: crowd_cost("gateway", n)),
    "page": lambda: table("viewers of the page", (0, 1, 4, 16, 64),
                          lambda f, n: crowd_cost("page", n)),
}


def write(name, lines):
    """Puts a table between its marks."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    text = PAGE.read_text()
    at, to = text.index(begin) + len(begin), text.index(end)
    PAGE.write_text(text[:at] + "\n".join(lines) + "\n" + text[to:])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("series", nargs="*", choices=[[], *SERIES],
                        help="of these; all without one")
    WORK = tempfile.TemporaryDirectory()
    from ready import wait_until_ready
    for series in parser.parse_args().series or SERIES:
        print(f"---- {series}", flush=True)
        write(series, SERIES[series]())
