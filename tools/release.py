#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The release check-list as one command (./dev release): runs checks, one after the other, and
writes their verdicts to docs/release-report.md with the commit and the processor that each was seen
on. What was not run keeps its row of before. The output of a check is in build/release-check/."""
import argparse
import collections
import os
import pathlib
import re
import shlex
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
REPORT = ROOT / "docs" / "release-report.md"
MUTANTS = "## Mutants by room"
LOGS = ROOT / "build" / "release-check"

# `short` stands in the place of `command` with --short, where it is given; minutes are a limit
Check = collections.namedtuple("Check", "name proves command short minutes")
CHECKS = [
    Check("suite", "every test passes; only tests of tests/allowed_skips.txt are skipped",
          "./dev test --strict", None, 60),
    Check("sanitize", "no invalid memory access, leak or undefined behavior", "./dev sanitize",
          "./dev sanitize --short", 180),
    Check("tsan", "no data races between threads", "./dev tsan", None, 60),
    Check("fresh", "a clone with ./dev alone passes its tests in a minimal Debian 12",
          "./dev fresh", "./dev fresh base_ cli_", 120),
    Check("fresh-trixie", "the same on Debian 13", "./dev fresh --suite trixie",
          "./dev fresh --suite trixie base_ cli_", 120),
    Check("container", "both images work without privileges",
          "./dev fresh --suite trixie --container", None, 60),
    Check("pip", "the wheel installs without a network",
          "ctest --test-dir build/release -V -R ^python_wheel$ | sh tests/summary.sh", None, 10),
    Check("job", "a copy of examples/ci passes",
          "ctest --test-dir build/release -V -R ^service_user_job$ | sh tests/summary.sh", None,
          10),
    Check("soak", "an hour of random faults breaks no rule, twice with one hash; wake-ups as good "
          "as cyclictest's", "./dev soak",
          "SOAK=600 ./dev soak soak_lockstep", 90),
    Check("falls", "1,000 falls of a limp COMAN, 125 of WALK-MAN: no part in the ground, no energy "
          "gained", "HIL_FALLS=1000 ./dev test ^falls$",
          "HIL_FALLS=200 ./dev test ^falls$", 60),
    Check("drives", "10,000 (--short: 100) passive drives with friction make no energy in 10 s",
          "HIL_PASSIVE_DRIVES=10000 build/release/tests/test_passive_drives",
          "HIL_PASSIVE_DRIVES=100 build/release/tests/test_passive_drives", 240),
    Check("fuzz", "libFuzzer finds nothing",
          "./dev fuzz all 600", "./dev fuzz all 60", 400),
    Check("imports", "2,000 generated robot files mean here what they mean in MuJoCo 3",
          "HIL_IMPORTS=2000 ./dev test --strict ^import_generated$", None, 30),
    Check("scenarios", "all pass, and each expectation can fail",
          "build/release/coman-hil test config/scenarios/*.yaml --mutate", None, 60),
    Check("bits-x86", "the same bits with SSE2, AVX2 and AVX-512",
          "./dev test --strict service_same_bits", None, 30),
    Check("bits-arm", "the same on 64-bit ARM, under QEMU",
          "./dev build aarch64 && HIL_SOURCE_DIR=$PWD HIL_LIMIT_S=3000 "
          "bash tests/aarch64/emulate.sh bits",
          "./dev test --strict aarch64_same_bits", 300),
    Check("controllers", "bit rates, states, restarts of CAN controllers, in QEMU",
          "./dev test --strict canbus_qemu", None, 15),
    Check("latency", "boards of each protocol answer a request; the table beside two bare sockets "
          "is in the output", "build/release/coman-hil-bench latency --answers | tee /dev/stderr | "
          "awk '/gateway|slcan/ && $NF == 0 {n++} END {exit n != 10}'", None, 10),
    Check("package", "it installs, runs and leaves nothing behind",
          "./dev package && bash tests/fresh.sh build/fresh-package "
          "--package build/packages/coman-hil_*.deb", None, 30),
]


def output_of(*command):
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.strip()


def commit():
    changed = output_of("git", "status", "--porcelain", "--untracked-files=no", "--", ".",
                        f":!{REPORT.relative_to(ROOT)}")
    return output_of("git", "rev-parse", "--short", "HEAD") + ("+changes" if changed else "")


def processor():
    """The processor's name and its widest vectors, of which results may depend."""
    text = pathlib.Path("/proc/cpuinfo").read_text()
    model = re.search(r"^model name\s*: (.*)$", text, re.M)
    flags = re.search(r"^flags\s*: (.*)$", text, re.M)
    flags = flags.group(1).split() if flags else []
    widest = [name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags]
    name = model.group(1) if model else os.uname().machine
    return ", ".join([f"{os.cpu_count()} x {name}", *widest[:1]])


def command_cell(command):
    """A command as a cell of the table."""
    return f"`{command}`".replace("|", "\\|")


def closing_line(log):
    """What a suite says at its end, or nothing."""
    lines = re.findall(r"^\d+ passed, \d+ failed, \d+ skipped$", log.read_text(errors="replace"),
                       re.M)
    return lines[-1] if lines else ""


def run(check, short):
    """Returns the row of a check that was made now."""
    command = check.short if short and check.short else check.command
    LOGS.mkdir(parents=True, exist_ok=True)
    log = LOGS / f"{check.name}.log"
    print(f"{check.name}: {command}", flush=True)
    start = time.monotonic()
    with log.open("w") as file:
        try:
            status = subprocess.run(
                ["timeout", "-k", "30", f"{check.minutes}m", "bash", "-c", command], cwd=ROOT,
                stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT).returncode
        except KeyboardInterrupt:
            sys.exit(130)
    minutes = (time.monotonic() - start) / 60
    verdict = "passed" if status == 0 else f"**no end in {check.minutes} min**" if status == 124 \
        else "**failed**"
    closing = closing_line(log)
    print(f"    {verdict} in {minutes:.1f} min  {closing}  (see {log.relative_to(ROOT)})",
          flush=True)
    return {"check": check.name, "proves": check.proves,
            "command": command_cell(command),
            "verdict": verdict + (f": {closing}" if closing else ""),
            "minutes": f"{minutes:.1f}", "commit": commit(), "processor": processor()}


COLUMNS = ("check", "proves", "command", "verdict", "minutes", "commit", "processor")


def rows_of(text):
    """The rows of a report by the name of their check."""
    rows = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == len(COLUMNS) and cells[0] != "check" and set(cells[0]) != {"-"}:
            rows[cells[0]] = dict(zip(COLUMNS, cells))
    return rows


def report(rows, mutants):
    """The text of the report; `mutants` is its last section, which `./dev mutate` writes."""
    lines = ["# Release report", "",
             "`./dev release` made each row by its command. [CONTRIBUTING.md]"
             "(../CONTRIBUTING.md#release) says what else a", "release takes.",
             "", "| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for check in CHECKS:
        row = {"check": check.name, "command": command_cell(check.command),
               "verdict": "not yet run"}
        row |= rows.get(check.name, {}) | {"proves": check.proves}
        lines.append("| " + " | ".join(row.get(column, "") for column in COLUMNS) + " |")
    return "\n".join([*lines, "", MUTANTS]) + mutants


def main():
    parser = argparse.ArgumentParser(prog="./dev release", description=__doc__)
    parser.add_argument("check", nargs="*", help="of these: " + " ".join(c.name for c in CHECKS))
    parser.add_argument("--short", action="store_true", help="shorter forms of the long ones")
    parser.add_argument("--list", action="store_true", help="print the commands and run nothing")
    arguments = parser.parse_args()
    names = [check.name for check in CHECKS]
    unknown = [name for name in arguments.check if name not in names]
    if unknown:
        parser.error(f"found the check {shlex.quote(unknown[0])}, expected one of "
                     + ", ".join(names))
    chosen = [check for check in CHECKS if not arguments.check or check.name in arguments.check]
    if arguments.list:
        for check in chosen:
            command = check.short if arguments.short and check.short else check.command
            print(f"{check.name:12} {command}")
        return 0
    before = REPORT.read_text()
    rows, mutants = rows_of(before), before.partition(MUTANTS)[2]
    good = True
    for check in chosen:
        rows[check.name] = run(check, arguments.short)
        good = good and rows[check.name]["verdict"].startswith("passed")
        REPORT.write_text(report(rows, mutants))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
