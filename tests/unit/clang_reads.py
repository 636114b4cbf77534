#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Another compiler reads the product and the fuzz targets without a warning.

What fuzzes the product is built with clang (./dev fuzz), which nothing else uses: without this test
a source that it refuses is found by whoever fuzzes next. Compiles nothing, and takes the commands
of the build that it is told (HIL_BINARY_DIR). Prints TAP.
"""
import concurrent.futures
import json
import os
import pathlib
import shlex
import shutil
import subprocess

BUILD = pathlib.Path(os.environ["HIL_BINARY_DIR"])
SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
ROOMS = {path.parts[-2] for path in SOURCE.glob("*/CMakeLists.txt")} - {"docs", "systemd", "tests"}


def is_read(path):
    parts = path.relative_to(SOURCE).parts if path.is_relative_to(SOURCE) else ("build",)
    return path.suffix == ".c" and (parts[0] in ROOMS or parts[:2] == ("tests", "fuzz"))


def command_of(entry):
    """What clang is to do: the definitions, folders and warnings of gcc's command but one, which
    takes the C library's own NAN for a fault."""
    words = shlex.split(entry["command"])
    kept = [word for before, word in zip(words, words[1:])
            if before == "-isystem" or word.startswith(("-D", "-I", "-isystem", "-std=", "-W"))
            and word != "-Wdouble-promotion"]
    return ["clang", "-fsyntax-only", *kept, entry["file"]]


def complaint(entry):
    done = subprocess.run(command_of(entry), cwd=entry["directory"], capture_output=True, text=True,
                          check=False)
    return done.stderr if done.returncode else ""


def main():
    print("1..1")
    if not shutil.which("clang"):
        print("ok 1 - clang_reads_all_sources # SKIP no clang; ./dev setup --checks installs it")
        return
    entries = {entry["file"]: entry
               for entry in json.loads((BUILD / "compile_commands.json").read_text())
               if is_read(pathlib.Path(entry["file"]))}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        complaints = [text for text in pool.map(complaint, entries.values()) if text]
    for text in complaints:
        print("# " + text.strip().replace("\n", "\n# "))
    print(f"# read {len(entries)} sources")
    print(("not ok" if complaints or not entries else "ok") + " 1 - clang_reads_all_sources")


main()
