#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""usage: old_files.py COMAN-HIL
Files that were written before formats had versions still load, those of this version too, and one
of a newer version is refused with its place (docs/interfaces.md). Prints TAP."""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

SOURCE = os.environ["HIL_SOURCE_DIR"]
sys.path.insert(0, SOURCE + "/tests/service")
from tap import check  # noqa: E402
import tap  # noqa: E402

PROGRAM = os.path.abspath(sys.argv[1])
OLD = SOURCE + "/tests/old"
WORK = tempfile.TemporaryDirectory(prefix="hil-old-")


def run(*arguments):
    done = subprocess.run([PROGRAM, *arguments], cwd=WORK.name, stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, " | ".join((done.stdout + done.stderr).splitlines())


def replay(recording, rig):
    """Standard error until the recording is served or refused, and the status of a refusal."""
    with subprocess.Popen([PROGRAM, "replay", recording, "--http", "127.0.0.1:0", "--rig", rig],
                          cwd=WORK.name, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, text=True) as player:
        text = ""
        for line in player.stderr:
            text += line
            if line.startswith("page:"):
                player.terminate()
        return player.wait(30), " | ".join(text.splitlines())


# The files that can say their version
YAML = ("rigs/arm.yaml", "rigs/own.yaml", "robots/arm.yaml", "robots/driven.yaml",
        "drives/geared.yaml", "protocols/pair.yaml", "scenarios/stall.yaml",
        "scenarios/swept.yaml", "sweeps/volts.yaml")
JSON = ("recording/summary.json", "sweeps/volts.plan.results/1.json",
        "sweeps/volts.plan.results/2.json")


def set_version(folder, kind, version):
    """The file of a folder says this version."""
    path = os.path.join(folder, kind)
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if kind in YAML:
        text = text.replace("\nname:", f"\nformat_version: {version}\nname:", 1)
    elif kind in JSON:
        text = json.dumps(json.loads(text) | {"format_version": version})
    else:
        text = text.replace('{"plan": 1,', f'{{"plan": {version},', 1)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def copy_with(name, version, *kinds):
    """A copy of the old files, of which these say this version, in a folder of its own."""
    folder = os.path.join(WORK.name, name)
    shutil.copytree(OLD, folder)
    for kind in kinds:
        set_version(folder, kind, version)
    return folder


def test_loads(folder, which):
    status, text = run("check", folder + "/rigs/arm.yaml")
    check(status == 0 and "1 drives" in text, f"a rig and its robot {which} load", text[:300])
    status, text = run("test", folder + "/scenarios/stall.yaml")
    check(status == 0, f"a scenario {which} runs and passes", text[-300:])
    status, text = replay(folder + "/recording", folder + "/rigs/arm.yaml")
    check("recording: 0.0" in text and "page:" in text, f"a recording {which} is played", text)
    status, text = run("run", folder + "/rigs/arm.yaml", "--clock", "free", "--control", "none",
                       "--transport", "local", "--quiet", "--stimulus", folder + "/recording")
    check(status == 0, f"a recording {which} is a stimulus", text[-300:])
    status, text = run("plot", folder + "/recording/signals.csv", "--signal", "q_yaw_rad")
    check(status == 0 and "<svg" in text[:300], f"a recording {which} is drawn")
    status, text = run("check", folder + "/rigs/own.yaml")
    check(status == 0 and "robot       driven" in text, f"a drive and a protocol {which} load",
          text[:300])
    check(f'own.yaml:{4 + (folder != OLD)}:1: found old key "personality", expected "protocol"'
          in text, f"the old key {which} is read with a warning", text[:300])
    status, text = run("run", folder + "/rigs/arm.yaml", "--clock", "free", "--control", "none",
                       "--transport", "local", "--quiet", "--task", "follow", "--duration", "4",
                       "--trajectory", folder + "/trajectories/wave.csv")
    check(status == 0, f"a trajectory {which} is followed", text[-300:])


def test_case():
    """The hash of a case that was planned before is still that of its files."""
    folder = copy_with("case", 1)
    os.remove(folder + "/sweeps/volts.plan.results/1.json")
    status, text = run("test", "--case", "1", folder + "/sweeps/volts.plan")
    check(status == 0 and "case 1 passed" in text, "a case of an old plan runs", text)


def test_sweep(which, *kinds):
    """A plan and its results are merged, and a sweep gives the same plan, whatever they say."""
    folder = copy_with("sweep-" + which.replace(" ", "-"), 1, *kinds)
    status, text = run("test", "--merge", folder + "/sweeps/volts.plan")
    check(status == 0 and "2 passed" in text, f"a plan and its results {which} are merged", text)
    with open(folder + "/sweeps/volts.plan", encoding="utf-8") as file:
        old = [json.loads(line) for line in file]
    status, text = run("test", "--plan", folder + "/sweeps/volts.yaml", "--output",
                       folder + "/sweeps/again.plan")
    with open(folder + "/sweeps/again.plan", encoding="utf-8") as file:
        new = [json.loads(line) for line in file]
    check(status == 0 and [case.get("values") for case in new] ==
          [case.get("values") for case in old], f"a sweep {which} is planned again", text)


# What is run with a file of a newer format, and the place that the refusal names
NEWER = (
    ("rigs/arm.yaml", ("check", "rigs/arm.yaml"), "rigs/arm.yaml:2:17"),
    ("robots/arm.yaml", ("check", "robots/arm.yaml"), "robots/arm.yaml:2:17"),
    ("robots/arm.yaml", ("check", "rigs/arm.yaml"), "robots/arm.yaml:2:17"),
    ("drives/geared.yaml", ("check", "rigs/own.yaml"), "drives/geared.yaml:2:17"),
    ("protocols/pair.yaml", ("check", "rigs/own.yaml"), "protocols/pair.yaml:2:17"),
    ("protocols/pair.yaml", ("protocol", "protocols/pair.yaml"), "protocols/pair.yaml:2:17"),
    ("scenarios/stall.yaml", ("test", "scenarios/stall.yaml"), "scenarios/stall.yaml:2:17"),
    ("sweeps/volts.yaml", ("test", "--plan", "sweeps/volts.yaml", "--output", "new.plan"),
     "sweeps/volts.yaml:2:17"),
    ("sweeps/volts.plan", ("test", "--case", "1", "sweeps/volts.plan"), "sweeps/volts.plan:1"),
    ("sweeps/volts.plan", ("test", "--merge", "sweeps/volts.plan"), "sweeps/volts.plan:1"),
    ("sweeps/volts.plan.results/2.json", ("test", "--merge", "sweeps/volts.plan"),
     "volts.plan.results/2.json:1"),
)


def test_newer():
    for i, (kind, command, place) in enumerate(NEWER):
        folder = copy_with(f"newer-{i}", 2, kind)
        words = [os.path.join(folder, word) if "/" in word or word == "new.plan" else word
                 for word in command]
        status, text = run(*words)
        check(status == 2 and place + ": found" in text and "newer coman-hil" in text,
              f"{command[0]} refuses a newer {kind}", text)
    folder = copy_with("newer-recording", 2, "recording/summary.json")
    status, text = replay(folder + "/recording", folder + "/rigs/arm.yaml")
    check(status == 2 and "the recording is of a newer" in text, "a newer recording is refused",
          text)


def test_wrong(folder):
    with open(folder + "/rigs/none.yaml", "w", encoding="utf-8") as file:
        file.write("format_version: one\nextends: arm.yaml\n")
    status, text = run("check", folder + "/rigs/none.yaml")
    check(status == 2 and "none.yaml:1:17: found" in text and "a whole number" in text,
          "a version that is no number is refused", text)
    with open(folder + "/rigs/none.yaml", "w", encoding="utf-8") as file:
        file.write("format_version: 1\nextends: arm.yaml\nname: arm\n")
    with open(folder + "/rigs/arm.yaml", "a", encoding="utf-8") as file:
        file.write("format_version: 2\n")
    status, text = run("check", folder + "/rigs/none.yaml")
    check(status == 2 and "arm.yaml:" in text and "found format_version 2" in text,
          "an old file does not extend a newer one", text)


print("1..35")
test_loads(OLD, "from before versions")
test_loads(copy_with("first", 1, *YAML, *JSON), "of version 1")
test_sweep("from before versions")
test_case()
test_sweep("of version 1", *YAML, *JSON)
test_newer()
test_wrong(copy_with("wrong", 1))
sys.exit(tap.failed > 0)
