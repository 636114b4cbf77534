#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a version (./dev tag): writes it to every file that names it, gives the changes in
CHANGELOG.md that are not yet released its heading, commits, and tags the commit. Without a version:
whether all files name the same one."""
import argparse
import datetime
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
UNRELEASED = "## [Unreleased]\n"
# file: what stands before the version; the first place counts
PLACES = {
    "CMakeLists.txt": r"project\(coman-hil VERSION ",
    "python/pyproject.toml": r'\nversion = "',
    "examples/ros2_control/package.xml": r"<version>",
    "systemd/debian/changelog": r"^coman-hil \(",
    "CHANGELOG.md": r"\n## \[(?=\d)",
}
VERSION = r"\d+\.\d+\.\d+"


def versions():
    found = {}
    for name, before in PLACES.items():
        place = re.search(f"(?:{before})({VERSION})", (ROOT / name).read_text())
        found[name] = place[1] if place else "none"
    return found


def write(version, now):
    day, moment = now.strftime("%Y-%m-%d"), now.strftime("%a, %d %b %Y %H:%M:%S +0000")
    for name, before in PLACES.items():
        path = ROOT / name
        text = path.read_text()
        if name == "CHANGELOG.md":
            text = text.replace(UNRELEASED, f"{UNRELEASED}\n## [{version}] - {day}\n", 1)
        elif name == "systemd/debian/changelog":
            author = re.search(r"^ -- (.*>)  ", text, re.M)[1]
            text = (f"coman-hil ({version}) unstable; urgency=medium\n\n  * CHANGELOG.md has the "
                    f"changes.\n\n -- {author}  {moment}\n\n") + text
        else:
            text = re.sub(f"({before}){VERSION}", rf"\g<1>{version}", text, count=1)
        path.write_text(text)


def parts(version):
    return [int(part) for part in version.split(".")]


def git(*words):
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"tag: git {words[0]}: {done.stderr.strip()}")
    return done.stdout.strip()


def main():
    parser = argparse.ArgumentParser(prog="./dev tag", description=__doc__)
    parser.add_argument("version", nargs="?", help="the new one, for example 0.2.0")
    parser.add_argument("--unsigned", action="store_true", help="a tag without a signature")
    arguments = parser.parse_args()
    found = versions()
    if len(set(found.values())) != 1:
        sys.exit("tag: the files name different versions: "
                 + ", ".join(f"{name} {version}" for name, version in found.items()))
    old = found["CMakeLists.txt"]
    if not arguments.version:
        print(old)
        return
    new = arguments.version
    if not re.fullmatch(VERSION, new) or parts(new) <= parts(old):
        sys.exit(f"tag: found the version {new}, expected three numbers and more than {old}")
    changes = (ROOT / "CHANGELOG.md").read_text().partition(UNRELEASED)[2].partition("\n## [")[0]
    if not changes.strip():
        sys.exit("tag: CHANGELOG.md has no changes below [Unreleased]")
    if git("status", "--porcelain", "--untracked-files=no"):
        sys.exit("tag: the work tree has changes that are not committed")
    write(new, datetime.datetime.now(datetime.timezone.utc))
    git("commit", "--all", "--message", f"release: make version {new}")
    git("tag", "--annotate" if arguments.unsigned else "--sign", f"v{new}", "--message",
        f"coman-hil {new}\n{changes}")
    print(f"v{new}: push it with git push --follow-tags")


main()
