#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: recording.py COMAN-HIL
What a recorded run leaves behind: events, poses and signals, and the same in an MCAP file, read by
a reader of our own (mcap_read.py) and, where npm has it, by @mcap/core. Prints TAP."""
import csv
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
from xml.etree import ElementTree

import mcap_read
import tap

PROGRAM = sys.argv[1]
HERE = pathlib.Path(__file__).parent
EXAMPLES = HERE.parent.parent / "examples"
WORK = pathlib.Path(tempfile.mkdtemp(prefix="coman-recording-"))
MODULES = ("@mcap/core@2.2.2", "fzstd@0.1.1")


def run(name, *options):
    directory = WORK / name
    done = subprocess.run([PROGRAM, "run", "coman", "--transport", "local", "--task", "squat",
                           "--control", "none", "--record", str(directory), *options],
                          capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return directory, done.stdout


def hash_of(text):
    return text.split("state hash ")[1].split()[0]


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


# ---- the run ----

def check_events(directory):
    lines = (directory / "events.log").read_text().splitlines()
    times = [float(line.split()[0]) for line in lines]
    words = {line.split()[1] for line in lines}
    text = "\n".join(lines)
    tap.result(times == sorted(times) and len(times) > 40 and words <= {"info", "notice", "warning",
                                                                        "error"} and
               "fault 1 begins" in text and "fault 1 ends" in text and
               text.count("to voltage mode") >= 23,
               "events are all there, in the order of virtual time", text)


def check_poses(directory):
    titles, rows = table(directory / "poses.csv")
    _, signals = table(directory / "signals.csv")
    first = titles.index("Waist_x_m")
    base = table(directory / "signals.csv")[0].index("base_x_m")
    norms = [math.sqrt(sum(float(row[i]) ** 2 for i in range(at + 3, at + 7)))
             for row in rows for at in range(1, len(titles), 7)]
    # The base's quaternion may have the other sign
    same = all(abs(float(p[first + k]) - float(s[base + k])) < 1e-8
               for p, s in zip(rows, signals) for k in range(3))
    # The task stands for two seconds, then bends the knees
    height = [float(row[titles.index("DWYTorso_z_m")]) for row in rows]
    tap.result(len(rows) == len(signals) and same and max(abs(n - 1) for n in norms) < 1e-8 and
               (len(titles) - 1) % 7 == 0 and height[-1] < height[len(height) // 2] - 0.02,
               "poses of all bodies stand beside the signals",
               (same, max(abs(n - 1) for n in norms), height[-1]))


def check_sensed(directory):
    titles, rows = table(directory / "signals.csv")
    at = {title: i for i, title in enumerate(titles)}
    true, seen = at["torque_LKneeSag_nm"], at["sensed_torque_LKneeSag_nm"]
    apart = [abs(float(row[true]) - float(row[seen])) for row in rows]
    before = [d for row, d in zip(rows, apart) if float(row[0]) <= 0.5]
    during = [d for row, d in zip(rows, apart) if 0.51 < float(row[0]) <= 1.0]
    weight = [float(row[at["ft_fz_l_leg_ft_n"]]) for row in rows[-20:]]
    tap.result(max(before) == 0 and min(during) > 4 and 50 < sum(weight) / 20 < 400 and
               all(row[at["sensed_ft_fz_l_leg_ft_n"]] for row in rows),
               "what the boards see stands beside the truth", (max(before), min(during), weight))


# ---- the MCAP file ----

def equal(signals, directory, places=9):
    """The messages of /signals against the CSV file: a row each, each value to its last digit."""
    titles, rows = table(directory / "signals.csv")
    if len(signals) != len(rows):
        return f"{len(signals)} messages, {len(rows)} rows"
    for (time, content), row in zip(signals, rows):
        if list(content) != titles[1:] or f"{time * 1e-9:.6f}" != row[0]:
            return f"titles or time at {row[0]}"
        for title, text in zip(titles[1:], row[1:]):
            if f"{content[title]:.{places}g}" != text:
                return f"{title} at {row[0]}: {content[title]} and {text}"
    return None


def check_contents(directory, file):
    topics = {channel[0] for channel in file.channels.values()}
    by_topic = {topic: [(t, m) for topic_of, t, m in file.messages if topic_of == topic]
                for topic in topics}
    why = equal(by_topic["/signals"], directory)
    tap.result(why is None, "its signals are those of signals.csv, digit for digit", why)

    titles, rows = table(directory / "poses.csv")
    bodies = [title[:-4] for title in titles[1::7]]
    good = len(rows) == len(by_topic["/transforms"])
    for (time, message), row in zip(by_topic["/transforms"], rows):
        for body, t, at in zip(bodies, message["transforms"], range(1, len(row), 7)):
            stamp = t["timestamp"]["sec"] * 10**9 + t["timestamp"]["nsec"]
            numbers = [t["translation"][k] for k in "xyz"] + [t["rotation"][k] for k in "wxyz"]
            good = good and (t["parent_frame_id"], t["child_frame_id"]) == ("world", body)
            good = good and stamp == time and [f"{n:.9g}" for n in numbers] == row[at:at + 7]
    tap.result(good, "its transforms are those of poses.csv")

    frames = {topic[5:]: iter(messages) for topic, messages in by_topic.items()
              if topic.startswith("/can/")}
    good, count = True, 0
    for line in (directory / "candump.log").read_text().splitlines():
        stamp, bus, frame = line.split()
        time, message = next(frames[bus])
        count += 1
        micros = time // 1000
        good = good and f"({micros // 10**6:010d}.{micros % 10**6:06d})" == stamp and \
            message["bus"] == bus and \
            f"{message['id']:03X}#{message['data']}" == frame and \
            2 * message["length"] == len(message["data"])
    left = sum(len(list(rest)) for rest in frames.values())
    tap.result(good and count > 10000 and left == 0, "its frames are those of candump.log",
               (count, left))

    log = [f"{t / 1e9:.6f} {['', '', 'info', 'warning', 'error'][m['level']]} {m['message']}"
           for t, m in by_topic["/events"]]
    lines = [line.replace(" notice ", " info ", 1)
             for line in (directory / "events.log").read_text().splitlines()]
    tap.result(log == lines, "its events are those of events.log", "\n".join(log[:3] + lines[:3]))

    check_contacts(directory, by_topic["/contacts"])
    scene = by_topic["/scene"][0][1]["entities"]
    names = {entity["frame_id"] for entity in scene}
    solids = {e["frame_id"]: sum(len(e[k]) for k in ("cubes", "spheres", "cylinders", "triangles"))
              for e in scene}
    tap.result(names == {"world", *bodies} and all(solids.values()) and
               all(max(t["indices"]) == len(t["points"]) - 1
                   for e in scene for t in e["triangles"]),
               "its scene shows every body in a frame that the transforms move", solids)


def pressure_center(wrench, pose):
    """Of a wrench about a body's origin, on the floor z = 0: where its moment has no x and y."""
    (fx, fy, fz, mx, my, _), (x, y, z) = wrench, pose
    return [x - (my + z * fx) / fz, y + (mx - z * fy) / fz, 0.0]


def check_contacts(directory, messages):
    """Arrows and balls, of two feet that stand, against the wrenches and poses of the CSV files."""
    titles, rows = table(directory / "signals.csv")
    bodies, poses = table(directory / "poses.csv")
    at = [titles.index(f"fx_{side}Foot_n") for side in "RL"]
    pose_at = [bodies.index(f"{side}Foot_x_m") for side in "RL"]
    found, worst, scales = dict(messages), [0.0, 0.0], []
    for row, pose in zip(rows, poses):
        message = found.get(round(float(row[0]) * 1e9))
        entity = message["entities"][0] if message else {"arrows": [], "spheres": []}
        if len(entity["arrows"]) != 2 or len(entity["spheres"]) != 2:
            continue
        for i, (f, p) in enumerate(zip(at, pose_at)):
            wrench, origin = [[float(t) for t in r[k:k + n]]
                              for r, k, n in ((row, f, 6), (pose, p, 3))]
            force = math.hypot(*wrench[:3])
            arrow, ball = entity["arrows"][i], entity["spheres"][i]["pose"]["position"]
            x, y, z, w = (arrow["pose"]["orientation"][k] for k in "xyzw")
            points = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
            scales.append((arrow["shaft_length"] + arrow["head_length"]) / force)
            center = pressure_center(wrench, origin)
            worst[0] = max(worst[0], *(abs(points[k] - wrench[k] / force) for k in range(3)))
            worst[1] = max(worst[1], *(abs(there[k] - center[i])
                                       for there in (arrow["pose"]["position"], ball)
                                       for i, k in enumerate("xyz")))
    spread = max(scales) / min(scales) - 1
    tap.result(len(scales) > 500 and max(worst) < 1e-4 and spread < 1e-4 and
               abs(scales[0] * 31.2 * 9.81 - 0.42) < 0.05,
               "its arrows are the contact forces, from their centers of pressure",
               (len(scales), worst, spread, scales[0]))


def check_layouts(signals):
    """The layouts for PlotJuggler name signals as its readers of MCAP and of JSON over UDP do."""
    found = {}
    for name, prefix in (("squat-mcap", "/signals/"), ("squat-live", "/")):
        root = ElementTree.parse(EXAMPLES / "plotjuggler" / f"{name}.xml").getroot()
        curves = [curve.get("name") for curve in root.iter("curve")]
        found[name] = [c for c in curves if c.removeprefix(prefix) not in signals] or len(curves)
    tap.result(list(found.values()) == [7, 7],
               "the layouts for PlotJuggler name signals that there are", found)


def check_mcap(directory):
    data = (directory / "recording.mcap").read_bytes()
    try:
        file = mcap_read.read(data)
    except mcap_read.Broken as error:
        tap.result(False, "the file is whole: checksums, indexes, summary", error)
        return
    tap.result(True, "the file is whole: checksums, indexes, summary")
    check_contents(directory, file)
    check_layouts(next(m for topic, _, m in file.messages if topic == "/signals"))

    # A flipped bit in the middle does not pass, so the checks above are not empty
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    try:
        mcap_read.read(bytes(broken))
        tap.result(False, "a flipped bit is noticed")
    except (mcap_read.Broken, ValueError):
        tap.result(True, "a flipped bit is noticed")
    check_recovery(data, file)


def check_recovery(data, file):
    """Cut anywhere, all chunks before the cut are there."""
    good, why = True, None
    for share in (0.1, 0.64, 0.999):
        cut = int(file.chunks[-1]["until"] * share)
        part = mcap_read.recover(data[:cut])
        whole = sum(chunk["start"] + chunk["length"] <= cut for chunk in file.chunks)
        if len(part.chunks) != whole or part.messages != file.messages[:len(part.messages)]:
            good, why = False, f"cut at {share}: {len(part.chunks)} of {whole} chunks"
    tap.result(good, "a file that was cut keeps every chunk before the cut", why)


def check_killed():
    """A run that is killed leaves a file whose chunks are whole."""
    directory = WORK / "killed"
    process = subprocess.Popen([PROGRAM, "run", "coman", "--transport", "local", "--task", "squat",
                                "--clock", "free", "--duration", "100", "--control", "none",
                                "--quiet", "--record", str(directory), "--record-format", "mcap"],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    path = directory / "recording.mcap"
    for _ in range(600):
        if path.exists() and path.stat().st_size > 2000000 or process.poll() is not None:
            break
        try:
            process.wait(0.05)
        except subprocess.TimeoutExpired:
            pass
    process.kill()
    process.wait()
    file = mcap_read.recover(path.read_bytes())
    signals = [m for topic, _, m in file.messages if topic == "/signals"]
    tap.result(len(file.chunks) > 5 and len(signals) > 20 and
               not (directory / "signals.csv").exists() and
               (directory / "candump.log").stat().st_size > 100000,
               "a run that was killed leaves all chunks that it wrote", len(file.chunks))
    return path


# ---- the reader of others ----

def modules():
    """The folder with @mcap/core, or None with a reason."""
    folder = pathlib.Path(os.environ.get("HIL_BINARY_DIR", WORK)) / "npm-mcap"
    if not shutil.which("npm") or not shutil.which("node"):
        return None, "no npm and node here"
    if not (folder / "node_modules/@mcap/core").is_dir():
        folder.mkdir(exist_ok=True)
        (folder / "package.json").write_text('{"private": true}')
        try:
            subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--ignore-scripts",
                            *MODULES], cwd=folder, check=True, capture_output=True, timeout=60)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
            return None, "npm cannot fetch @mcap/core"
    return folder, None


def check_core(directory, killed):
    names = ("@mcap/core reads it with every checksum, and the same signals",
             "@mcap/core reads what was killed up to its last chunk",
             "@mcap/core reads the arrows of contact")
    folder, why = modules()
    if not folder:
        for name in names:
            tap.check(True, f"{name} # SKIP {why}")
        return
    found = []
    for path in (directory / "recording.mcap", killed):
        done = subprocess.run(["node", str(HERE / "mcap_read.mjs"), str(folder), str(path)],
                              capture_output=True, text=True, timeout=60)
        found.append(json.loads(done.stdout) if done.returncode == 0 else done.stderr)
    whole, part = found
    good = isinstance(whole, dict) and whole["streamed"]["ended"] and \
        whole["by_index"]["count"] == whole["streamed"]["count"]
    why = equal(whole["by_index"]["signals"], directory) if good else str(whole)[:500]
    tap.result(good and why is None, names[0], why)
    ours = mcap_read.recover(killed.read_bytes())
    tap.result(isinstance(part, dict) and not part["streamed"]["ended"] and
               sum(part["streamed"]["count"].values()) == len(ours.messages), names[1], part)
    arrows = [[t, m] for topic, t, m in mcap_read.read(
        (directory / "recording.mcap").read_bytes()).messages if topic == "/contacts"]
    tap.result(good and len(arrows) > 200 and whole["by_index"]["contacts"] == arrows, names[2])


def main():
    print("1..18")
    options = ("--clock", "lockstep", "--duration", "3",
               "--fault", "sensor LKneeSag.torque wrong offset=5 0.5..1")
    directory, text = run("both", *options, "--record-format", "both")
    plain, again = run("csv", *options)
    check_events(directory)
    check_poses(directory)
    check_sensed(directory)
    names = ("candump.log", "signals.csv", "poses.csv", "events.log")
    tap.result(hash_of(text) == hash_of(again) and not (plain / "recording.mcap").exists() and
               all((plain / n).read_bytes() == (directory / n).read_bytes() for n in names),
               "the format changes neither the run nor the other files")
    check_mcap(directory)
    check_core(directory, check_killed())


try:
    main()
finally:
    shutil.rmtree(WORK, ignore_errors=True)
sys.exit(tap.failed > 0)
