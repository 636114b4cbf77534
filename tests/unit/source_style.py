#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The style of the sources, so far as a program can judge it: layout as clang-format makes it,
lines of 100 columns, a license line in every file, names of functions that can be searched,
RT-safety in every public header. Prints TAP."""
import collections
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(os.environ.get("HIL_SOURCE_DIR") or pathlib.Path(__file__).parents[2])
# folders of C sources
ROOMS = sorted({path.parts[-2] for path in ROOT.glob("*/CMakeLists.txt")}
               - {"docs", "systemd", "tests"})
CODE = {".c", ".h", ".cpp"}
SCRIPTS = {".py", ".sh", ".cmake"}
COLUMNS = 100
# Static functions of one file with the same name in another make a profile ambiguous.
STATIC = re.compile(r"^(?:static|LOOP_PHASE) (?:[^;={}()]|\([^;={}()]*\) )*?"
                    r"\b(\w+)\([^;{}]*\)\s*\{", re.M)


def files(folders, suffixes):
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*")):
            named = (path.suffix in suffixes
                     or ".cmake" in suffixes and path.name == "CMakeLists.txt")
            if named and not {"corpus", "node_modules"} & set(path.parts):
                yield path


def everything():
    return [*files((*ROOMS, "tests", "examples", "python", "systemd", "docs"), CODE | SCRIPTS),
            ROOT / "CMakeLists.txt", ROOT / "dev"]


def named(path, text=""):
    return f"{path.relative_to(ROOT)}{text}"


def long_lines():
    return [named(path, f":{number}: {len(line)} columns")
            for path in everything()
            for number, line in enumerate(path.read_text().splitlines(), 1) if len(line) > COLUMNS]


def unlicensed():
    license_line = "SPDX-License-Identifier: Apache-2.0"
    return [named(path) for path in everything()
            if license_line not in "\n".join(path.read_text().splitlines()[:3])]


def unformatted():
    paths = [str(path) for path in files((*ROOMS, "tests"), CODE)]
    check = subprocess.run(["clang-format", "--dry-run", "-Werror", *paths],
                           capture_output=True, text=True)
    places = re.findall(r"^(\S+:\d+):\d+: error: code should be clang-formatted",
                        check.stderr, re.M)
    if check.returncode and not places:
        return [check.stderr]
    return [place.replace(f"{ROOT}/", "") for place in places]


def statics():
    """The static functions of the product by name, with the files that define them."""
    found = collections.defaultdict(set)
    for path in files(ROOMS, {".c"}):
        for name in STATIC.findall(path.read_text()):
            found[name].add(named(path))
    return found


def one_word_names():
    return [f"{name} in {', '.join(sorted(where))}" for name, where in sorted(statics().items())
            if "_" not in name]


def ambiguous_names():
    return [f"{name} in {', '.join(sorted(where))}" for name, where in sorted(statics().items())
            if len(where) > 1]


def silent_headers():
    """Public headers that do not say whether their calls may be made in the loop."""
    return [named(path) for path in files(ROOMS, {".h"})
            if not path.stem.endswith("private") and "RT-safe" not in path.read_text()]


number = failures = 0


def format_version():
    """The major version of clang-format, or 0."""
    if not shutil.which("clang-format"):
        return 0
    text = subprocess.run(["clang-format", "--version"], capture_output=True, text=True).stdout
    return int(re.search(r"version (\d+)", text)[1])


def result(name, findings):
    global number, failures
    number += 1
    failures += bool(findings)
    print(f"{'not ok' if findings else 'ok'} {number} - {name}")
    for line in findings[:200]:
        print(f"# {line}")


def main():
    print("1..6")
    result("lines_have_100_columns", long_lines())
    result("every_file_names_its_license", unlicensed())
    result("static_functions_are_named_by_object_and_verb", one_word_names())
    result("no_two_static_functions_have_one_name", ambiguous_names())
    result("public_headers_say_whether_they_are_rt_safe", silent_headers())
    if format_version() == 14:  # others break some lines elsewhere
        result("sources_are_formatted", unformatted())
    else:
        print("ok 6 - sources_are_formatted # SKIP clang-format 14 is not installed")
    return failures > 0


sys.exit(main())
