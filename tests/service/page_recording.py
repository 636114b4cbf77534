#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A recording played back by the page's server: what it tells is what the files have, at the time
that each client has chosen, and what is no recording of the rig is refused. Prints TAP."""
import csv
import math
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile

from page_client import PROGRAM, RIGS, WORK, Page, ask_http, header, token
from ready import wait_until_ready
from tap import check

SERIES = struct.Struct("<BBHIIIQ")


def record(directory, *arguments):
    subprocess.run([PROGRAM, "run", os.path.join(RIGS, "coman.yaml"), "--transport", "local",
                    "--clock", "free", "--task", "squat", "--duration", "5", "--control", "none",
                    "--quiet", "--record", directory, *arguments], check=True, capture_output=True,
                   timeout=60)


def read_rows(directory, name):
    with open(os.path.join(directory, name)) as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


class Replay:
    """`coman-hil replay DIR --http 0 ...`, until the end of the with."""

    def __init__(self, directory, *arguments):
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name)
        ready = tempfile.mktemp(dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "replay", directory, "--http", "0", "--ready", ready, *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        self.address = wait_until_ready(ready, self.process, 30,
                                        lambda: open(self.log.name).read())["page_view"]
        self.port = int(re.search(r":(\d+)/", self.address)[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.status = self.process.wait(30)


def at_time(page, wanted_s):
    """The state of a moment, after a jump to it."""
    page.ask("seek", time_s=wanted_s)
    while abs((state := page.state()) and header(state)["time_ns"] * 1e-9 - wanted_s) > 1e-6:
        pass
    return state


def ask_series(page, **keys):
    page.number += 1
    page.send({"cmd": "series", "id": page.number, **keys})
    while not isinstance(message := page.receive(), bytes) or message[0] != 3:
        if isinstance(message, dict) and message.get("id") == page.number:
            return message
    _, version, nsignal, number, count, rows, _ = SERIES.unpack_from(message)
    assert version == 1 and number == page.number
    times = struct.unpack_from(f"<{count}d", message, SERIES.size)
    columns = [struct.unpack_from(f"<{count}f", message, SERIES.size + 8 * count + 4 * k * count)
               for k in range(nsignal)]
    return times, columns, rows


def judge_moments(page, poses, signals):
    page.ask("pause")
    page.ask("watch", rate_hz=60, signals=["torque_RKneeSag_nm", "sensed_q_RKneeSag_rad"])
    bodies = [body["name"] for body in page.hello["scene"]["bodies"]]
    worst = 0
    for k in (300, 40, 499, 0):
        state = at_time(page, poses[k]["time_s"])
        for i, name in enumerate(bodies):
            pose = struct.unpack_from("<7f", state, 80 + 28 * i)
            recorded = [poses[k][f"{name}_{part}"]
                        for part in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")]
            worst = max(worst, *(abs(a - b) for a, b in zip(pose, recorded)))
        values = struct.unpack_from("<2f", state, len(state) - 8)
        worst = max(worst, abs(values[0] - signals[k]["torque_RKneeSag_nm"]) / 20,
                    abs(values[1] - signals[k]["sensed_q_RKneeSag_rad"]))
    check(worst < 1e-6, "every moment has the poses and signals of its row", worst)
    state = at_time(page, poses[300]["time_s"])
    found = header(state)
    at = 80 + 28 * found["nbody"] + 8 * found["njoint"]
    forces = sorted(struct.unpack_from("<f", state, at + 28 * i + 12)[0]
                    for i in range(found["ncontact"]))
    recorded = sorted((signals[300]["fz_LFoot_n"], signals[300]["fz_RFoot_n"]))
    check(len(forces) == 2 and all(abs(a - b) < 1e-4 for a, b in zip(forces, recorded)),
          "and its contact forces", forces)
    check(found["nboard"] == 0 and found["nfault"] == 0 and found["flags"] & 1,
          "what was not recorded is not told")


def judge_play(page):
    page.ask("seek", time_s=1)
    page.ask("speed", factor=4)
    page.ask("resume")
    first = header(page.state())
    while header(last := page.state())["time_ns"] - first["time_ns"] < 1_000_000_000:
        pass
    last = header(last)
    took = (last["sent_ns"] - first["sent_ns"]) * 1e-9
    pace = (last["time_ns"] - first["time_ns"]) * 1e-9 / took
    check(3 < pace < 5 and last["speed"] == 4, "it plays at the speed that is asked for", pace)
    while not header(last := page.state())["flags"] & 1:
        pass
    check(header(last)["time_ns"] == 5_000_000_000, "and pauses at its end",
          header(last)["time_ns"])
    page.ask("resume")
    check(header(page.state())["time_ns"] < 4_000_000_000, "from where it begins anew")
    page.ask("pause")
    before = header(page.state())["time_ns"]
    page.ask("step", count=3)
    check(header(page.state())["time_ns"] - before == 30_000_000, "a step is a row")


def judge_series(page, signals):
    name = "torque_RKneeSag_nm"
    times, (values,), rows = ask_series(page, signals=[name], from_s=0, to_s=99, points=8000)
    worst = max(abs(t - row["time_s"]) + abs(v - row[name]) / 20
                for t, v, row in zip(times, values, signals))
    check(len(times) == rows == len(signals) and worst < 1e-6, "a series has every row",
          (rows, worst))
    times, columns, rows = ask_series(page, signals=[name, "q_RKneeSag_rad"], from_s=0, to_s=99,
                                      points=40)
    truth = [[row[key] for row in signals] for key in (name, "q_RKneeSag_rad")]
    check(len(times) <= 40 and rows == len(signals) and list(times) == sorted(times)
          and all(abs(min(c) - min(t)) + abs(max(c) - max(t)) < 1e-5
                  for c, t in zip(columns, truth)),
          "fewer points keep the extremes of each signal", len(times))
    times, _, _ = ask_series(page, signals=[name], from_s=2, to_s=2.5, points=8000)
    check(len(times) in (51, 52, 53) and times[0] <= 2 and times[-1] >= 2.5 - 1e-9,
          "a part has that part", (times[0], times[-1]))
    found = ask_series(page, signals=["q_Nobody_rad"], from_s=0, to_s=1, points=10)
    check(found.get("code") == "input", "a signal that there is not is told", found.get("error"))


def judge_frames(page, directory):
    """Frames of a jump are those of the fifth of a second before it."""
    page.ask("pause")
    page.ask("watch", rate_hz=60, trace=True)
    page.ask("seek", time_s=2.2)
    told = []
    while not told or told[-1][0] < 2_100_000:
        trace = page.state(kind=2)
        count, lost = struct.unpack_from("<II", trace, 4)
        told, at = [], 12
        for _ in range(count):
            time_ns, frame_id, bus, _, length = struct.unpack_from("<qIBBB", trace, at)
            told.append((round(time_ns / 1000), bus, frame_id,
                         trace[at + 16:at + 16 + length].hex()))
            at += 16 + (length + 3 & ~3)
    recorded = []
    for line in open(os.path.join(directory, "candump.log")):
        stamp, bus, frame = line.split()[:3]
        frame_id, data = frame.split("#")
        recorded.append((round(float(stamp[1:-1]) * 1e6), int(bus[3:]), int(frame_id, 16),
                         data.lower()))
    window = [frame for frame in recorded if 2_000_000 <= frame[0] <= 2_200_000]
    check(told == window and lost == 0 and len(told) > 1000,
          "frames are those of the log", (len(told), lost, len(window)))
    state = at_time(page, 2.2)
    found = header(state)
    at = 80 + 28 * found["nbody"] + 8 * found["njoint"] + 28 * found["ncontact"]
    frames, _, _, _, load, _ = struct.unpack_from("<IIIIfI", state, at)
    count = sum(frame[1] == 0 and frame[0] <= 2_200_000 for frame in recorded)
    check(abs(frames - count) <= 0.1 * count / 2.2 and 0.1 < load < 0.5,
          "the buses have carried what the log has up to then", (frames, count, load))


def judge_rights(replay, page):
    found = [page.ask(cmd, **keys).get("code") for cmd, keys in (
        ("push", {"body": "Waist", "force_n": [500, 0, 0]}), ("stop", {}), ("reset", {}),
        ("send", {"bus": "torso", "frame_id": 1, "data": ""}), ("status", {}))]
    check(found == ["unavailable"] * 5, "nobody changes a recording", found)
    events = ask_http(replay.port, "/events.log",
                      headers=[f"Authorization: Bearer {token(replay.address)}"])
    check(events[0] == 200 and b"the robot is released" in events[1], "events are there to read")
    check(ask_http(replay.port, "/events.log")[0] == 401, "with a token")


def judge_comparison(directory):
    """The rows of the recording of --with are served as they were written, to who has the token."""
    with Replay(directory, "--with", directory) as replay:
        page = Page(replay.port, replay.address)
        key = [f"Authorization: Bearer {token(replay.address)}"]
        same = []
        for name in ("signals.csv", "poses.csv"):
            with open(os.path.join(directory, name), "rb") as file:
                same.append(ask_http(replay.port, f"/with/{name}", headers=key)[:2]
                            == (200, file.read()))
        check(page.hello["run"]["replay"]["with"] == directory and same == [True, True],
              "the rows to compare with are there to read", same)
        check([ask_http(replay.port, "/with/signals.csv")[0],
               ask_http(replay.port, "/with/events.log", headers=key)[0],
               ask_http(replay.port, "/with/../signals.csv", headers=key)[0]] == [401, 404, 404],
              "with a token, and no other file")


def judge_refusals(directory):
    def fail(*arguments):
        done = subprocess.run([PROGRAM, "replay", *arguments], capture_output=True, text=True,
                              timeout=60, stdin=subprocess.DEVNULL)
        return done.returncode, done.stderr

    copy = os.path.join(WORK.name, "copy")
    shutil.copytree(directory, copy)
    walkman = os.path.join(RIGS, "walkman.yaml")
    for arguments, text, name in (
            ((directory, "--http", "0", "--rig", walkman), "expected a recording of the rig",
             "another rig's recording"),
            ((directory, "--http", "0", "--onto", "can0"), "expected one",
             "a page beside an interface"),
            ((directory, "--http", "0", "--from", "7"), "expected a part of",
             "a part that is not there"),
            ((WORK.name, "--http", "0"), "expected --rig", "a directory without a summary"),
            ((directory, "--http", "0", "--with", WORK.name), "signals.csv",
             "to compare with no recording"),
            ((directory, "--with", directory, "--onto", "can0"), "--with without --http",
             "to compare without a page"),
            ((WORK.name, "--http", "0", "--rig", "coman"), "signals.csv", "no recording")):
        status, said = fail(*arguments)
        check(status == 2 and text in said, f"{name} is refused", said)
    with open(os.path.join(copy, "signals.csv"), "r+") as file:
        text = file.read().splitlines(True)
        text[7] = "x" + text[7]
        file.seek(0)
        file.writelines(text)
    status, said = fail(copy, "--http", "0")
    check(status == 2 and "signals.csv:8:" in said, "a row that is none is told by its line", said)

    # A run that was killed has no summary, and half a line at the end
    os.remove(os.path.join(copy, "summary.json"))
    with open(os.path.join(copy, "signals.csv"), "w") as file:
        file.writelines([*text[:7], text[8], text[9][:40]])
    with Replay(copy, "--rig", "coman") as replay:
        page = Page(replay.port, replay.address)
        found = page.hello["run"]["replay"]
    check(abs(found["to_s"] - 0.08) < 1e-9 and replay.status == 0,
          "of a run that was killed the whole rows are shown", found)


def main():
    print("1..29")
    directory = os.path.join(WORK.name, "recording")
    record(directory)
    poses, signals = read_rows(directory, "poses.csv"), read_rows(directory, "signals.csv")
    with Replay(directory) as replay:
        page = Page(replay.port, replay.address)
        run = page.hello["run"]
        check(run["clock"] == "recorded" and run["rig"] == "coman" and math.isclose(
            run["replay"]["to_s"], signals[-1]["time_s"]), "the recording is described", run)
        judge_moments(page, poses, signals)
        judge_play(page)
        judge_series(page, signals)
        judge_frames(page, directory)
        judge_rights(replay, page)
    check(replay.status == 0, "it ends when it is told to")
    judge_comparison(directory)
    judge_refusals(directory)
    return 0


sys.exit(main())
