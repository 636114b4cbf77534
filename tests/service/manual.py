#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The manual tells the truth: its pages name every key and option, and its commands run.

manual.py SOURCE BUILD      on the machine of the build
manual.py SOURCE guest      on one where the package is installed and everything is allowed

On the first the project is installed into a scratch folder, and every fenced block of the guides in
docs/ and of the manual pages is tried there, in order, one folder a document:

    ```yaml, ```python, ```c    written to the file that their first line, a comment, names
    ```sh                 run by bash -eu, expected to end with 0
    ```sh guest           needs root, systemd or kernel CAN: left to the second, which runs no other
    ```xml FILE           that file of examples/icub
    ```sh root            changes the machine for good (kernel, boot loader): its syntax is checked

Prints TAP.
"""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

import tap
from tap import result

SOURCE, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
GUEST = sys.argv[2] == "guest"
PATIENCE_S = 60
SCRATCH = pathlib.Path(tempfile.mkdtemp())
PREFIX = SCRATCH / "prefix"
PAGES = SOURCE / "docs" / "man"
GUIDES = [SOURCE / "docs" / name for name in ("lab-pc.md", "controller.md", "gateway.md",
                                               "icub-software.md", "python.md",
                                               "install.md", "raspberry-pi.md", "recording.md")]


def coman_hil(*arguments, program="coman-hil"):
    return subprocess.run([PREFIX / "bin" / program, *arguments], capture_output=True, text=True,
                          timeout=PATIENCE_S).stdout


# ---- pages against tables ----

def keys_of(*sources):
    """The keys of the schema tables of a YAML file."""
    table = r'\{"(\w+)",\s*(?:\.type = )?YAML_|\b[A-Z_]+\("(\w+)"'
    return {key for source in sources
            for keys in re.findall(table, (SOURCE / source).read_text()) for key in keys if key}


def bold_of(page):
    text = (PAGES / page).read_text()
    return {word for bold in re.findall(r"\*([^*\n]+)\*", text)
            for word in re.findall(r"\w+", bold)} | \
        {word for heading in re.findall(r"^# (\w+)$", text, re.M) for word in [heading]}


def check_keys(page, *sources):
    missing = keys_of(*sources) - bold_of(page)
    result(not missing, f"{page} has every key of the file",
           "missing: " + ", ".join(sorted(missing)))


def check_pages():
    pages = {path.name.removesuffix(".gz") for path in (PREFIX / "share" / "man").glob("man*/*.gz")}
    table = coman_hil("--help").split("coman-hil COMMAND --help")[0]  # topics of help follow
    commands = set(re.findall(r"^  (\w+)  ", table, re.M)) - {"help", "version"}
    benches = set(re.findall(r"^  (\w+)  ", coman_hil("--help", program="coman-hil-bench"), re.M))
    expected = {f"coman-hil-{c}.1" for c in commands} | \
        {f"coman-hil-bench-{b}.1" for b in benches} | \
        {"coman-hil.1", "coman-hil-rig.5", "coman-hil-robot.5", "coman-hil-scenario.5"}
    result(pages == expected, "there is a page for every command", str(sorted(pages ^ expected)))
    for path in sorted((PREFIX / "share" / "man").glob("man*/*.gz")):
        lint = subprocess.run(["mandoc", "-Tlint", "-Wunsupp", path], capture_output=True,
                              text=True)
        text = subprocess.run(["mandoc", "-Tutf8", path], capture_output=True, text=True).stdout
        text = re.sub(r".\b", "", text)
        named = re.findall(r"\b(coman-hil[\w-]*)\((\d)\)", text)
        lost = {f"{name}.{section}" for name, section in named} - pages
        result(lint.returncode == 0 and len(text) > 500 and not lost,
             f"{path.name} renders, and what it refers to is there", lint.stdout + str(lost))


# ---- what the manual tells people to type ----

def blocks_of(path):
    """(info, text, line) of every fenced block."""
    found, fence = [], None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.startswith("```"):
            if fence is not None:
                fence[1].append(line)
        elif fence is None:
            fence = (line[3:].strip(), [], number)
        else:
            found.append((fence[0], "\n".join(fence[1]) + "\n", fence[2]))
            fence = None
    assert fence is None, f"{path}: a block without an end"
    return found


def write_file(folder, text):
    name = re.match(r"(?:#|//) (\S+)\n", text)
    assert name, "the first line is no comment with the name of the file"
    path = folder / name[1]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def run(folder, text, name):
    """What to tell of a block: whether it ended with 0, its name, and why not."""
    environment = dict(os.environ, PATH=f"{PREFIX}/bin:{os.environ['PATH']}",
                       PYTHONDONTWRITEBYTECODE="1",
                       PKG_CONFIG_PATH=":".join(map(str, PREFIX.rglob("pkgconfig"))),
                       PYTHONPATH=str(PREFIX / "lib" / "python3" / "dist-packages"),
                       XDG_RUNTIME_DIR=str(folder))
    process = subprocess.Popen(["bash", "-eu", "-o", "pipefail", "-c", text], cwd=folder,
                               env=environment,
                               stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT,
                               text=True, start_new_session=True)
    try:
        output, _ = process.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return False, name, f"{text}\nstill runs after {PATIENCE_S} s\n{process.communicate()[0]}"
    return process.returncode == 0, name, f"{text}\nended with {process.returncode}\n{output}"


def try_guide(path):
    folder = SCRATCH / path.stem
    folder.mkdir()
    shutil.copytree(SOURCE / "examples", folder / "examples")
    for info, text, line in blocks_of(path):
        name = f"{path.name}:{line}: {text.splitlines()[0]}"
        if info in ("yaml", "python", "c"):
            write_file(folder, text)
        elif info == ("sh guest" if GUEST else "sh"):
            result(*run(folder, text, name))
        elif GUEST or info == "sh guest":
            continue
        elif info.startswith("xml "):
            file = SOURCE / "examples" / "icub" / info[4:]
            result(text == file.read_text(), f"{path.name}:{line} is {file.name}")
        elif info == "sh root":
            good = subprocess.run(["bash", "-n"], input=text, capture_output=True, text=True)
            result(good.returncode == 0, name + " (syntax)", good.stderr)
        else:
            result(False, name, f'found a block of "{info}"')


def try_pages():
    """The examples: shell commands, a rig, a scenario."""
    folder = SCRATCH / "pages"
    (folder / "rigs").mkdir(parents=True)
    commands = {"coman-hil.1.scd": None, "coman-hil-rig.5.scd": "coman-hil check {}",
                "coman-hil-robot.5.scd": "coman-hil check --robot {}",
                "coman-hil-scenario.5.scd": "coman-hil test {} --mutate"}
    for page, command in commands.items():
        for _, text, line in blocks_of(PAGES / page):
            file = folder / "rigs" / f"{page}.yaml"
            if command:
                file.write_text(text)
            result(*run(folder, command.format(file) if command else text,
                        f"{page}:{line}: {text.splitlines()[0]}"))


def check_words():
    """Commands of ./dev and of the program that README, CONTRIBUTING and guides name are there."""
    table = coman_hil("--help")
    usage = subprocess.run([SOURCE / "dev", "--help"], capture_output=True, text=True).stdout
    for path in [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md",
                 *sorted((SOURCE / "docs").glob("*.md"))]:
        text = path.read_text()
        lost = {word for word in re.findall(r"`\./dev (\w+)", text)
                if f"\n  {word} " not in usage} | \
            {word for word in re.findall(r"(?:`|    )coman-hil ([a-z]+)", text)
             if f"\n  {word} " not in table}
        result(not lost, f"{path.name} names commands that are there", str(lost))


def check_build():
    subprocess.run(["cmake", "--install", BUILD, "--prefix", PREFIX], check=True,
                   stdout=subprocess.DEVNULL)
    (PREFIX / "bin" / "python3").symlink_to("/usr/bin/python3")  # the one of the Debian packages
    check_keys("coman-hil-rig.5.scd", "rig/schema.c", "rig/sensors.c")
    check_keys("coman-hil-robot.5.scd", "model/description/schema.c")
    check_keys("coman-hil-scenario.5.scd", "app/scenario/schema.c")
    check_pages()
    check_words()
    try_pages()


def main():
    if not GUEST:
        check_build()
    for guide in GUIDES:
        try_guide(guide)
    print(f"1..{tap.number}")
    return tap.failed > 0


try:
    sys.exit(main())
finally:
    shutil.rmtree(SCRATCH)
