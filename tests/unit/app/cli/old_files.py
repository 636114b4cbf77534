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


def copy_with(version):
    """A copy of the old files that say this version, in a folder of its own."""
    folder = os.path.join(WORK.name, f"v{version}")
    shutil.copytree(OLD, folder)
    for kind in ("rigs/arm.yaml", "robots/arm.yaml", "scenarios/stall.yaml"):
        with open(os.path.join(folder, kind), encoding="utf-8") as file:
            text = file.read()
        with open(os.path.join(folder, kind), "w", encoding="utf-8") as file:
            file.write(text.replace("\nname:", f"\nformat_version: {version}\nname:", 1))
    path = os.path.join(folder, "recording/summary.json")
    with open(path, encoding="utf-8") as file:
        summary = json.load(file)
    with open(path, "w", encoding="utf-8") as file:
        json.dump(summary | {"format_version": version}, file)
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


def test_newer(folder, whole):
    place = r"arm\.yaml:2:17: found format_version 2, expected 1 at most: the file is for a newer"
    status, text = run("check", folder + "/rigs/arm.yaml")
    check(status == 2 and re.search("rigs/" + place, text), "a newer rig is refused", text)
    status, text = run("check", folder + "/robots/arm.yaml")
    check(status == 2 and re.search("robots/" + place, text), "a newer robot is refused", text)
    shutil.copytree(whole + "/rigs", folder + "/rigs", dirs_exist_ok=True)
    status, text = run("test", folder + "/scenarios/stall.yaml")
    check(status == 2 and "stall.yaml:2:17: found format_version 2" in text,
          "a newer scenario is refused", text)
    status, text = replay(folder + "/recording", whole + "/rigs/arm.yaml")
    check(status == 2 and "the recording is of a newer" in text, "a newer recording is refused",
          text)
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


print("1..16")
test_loads(OLD, "from before versions")
first = copy_with(1)
test_loads(first, "of version 1")
test_newer(copy_with(2), OLD)
sys.exit(tap.failed > 0)
