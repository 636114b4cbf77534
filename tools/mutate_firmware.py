#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the scenarios of examples/firmware against small faults (./dev mutate --firmware): draws
mutants of the firmware's C files, builds each, and runs the scenarios in QEMU until one fails. What
no scenario notices is printed as a survivor: a scenario is missing, or the change changes nothing.

A firmware of the same bytes tells that a mutant is equivalent; others that are must be named, with
the reason, in examples/firmware/equivalent_mutants.txt."""
import argparse
import collections
import concurrent.futures
import hashlib
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import threading

import mutate

EXAMPLE = pathlib.Path("examples/firmware")
FILES = ("boards.c", "can.c", "control.c", "leg.c", "machine.c", "main.c")
EQUIVALENT = EXAMPLE / "equivalent_mutants.txt"
FIRST = ("moves_the_leg", "waits_for_every_board")  # they notice most
BUILD_LIMIT_S = 600
LIMIT = "a limit of time"  # who noticed a firmware that does not go on

Failure = collections.namedtuple("Failure", "scenario why")
Verdict = collections.namedtuple("Verdict", "word by why", defaults=("", ""))


def build(folder):
    """Builds the firmware of a folder into it; returns the hash of its image, None when it does
    not compile."""
    out = folder / "out"
    done = mutate.run(["sh", str(folder / "build.sh"), str(out)], timeout=BUILD_LIMIT_S)
    if done.returncode != 0:
        return None
    image = out / "firmware.bin"
    prefix = os.environ.get("CROSS_COMPILE", "aarch64-linux-gnu-")
    mutate.run([f"{prefix}objcopy", "-O", "binary", str(out / "firmware.elf"), str(image)],
               check=True)
    return hashlib.sha256(image.read_bytes()).hexdigest()


def first_failure(folder, scenarios, options):
    """Runs scenarios, `options.runs` at a time, until one fails; returns it, or None. A firmware
    that takes no more steps ends by the scenario's own limit, one that is started again and again
    by its watchdog by that of the options."""
    paths = [str(folder / "scenarios" / f"firmware_{name}.yaml") for name in scenarios]
    program = f"sh '{folder}/run.sh' '{folder}/out/firmware.elf'"
    limit = options.limit * -(-len(paths) // options.runs)
    with subprocess.Popen([options.program, "test", "--jobs", str(options.runs), "--program",
                           program, "--output", str(folder / "results"), *paths],
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, errors="replace",
                          start_new_session=True) as process:
        timer = threading.Timer(limit, os.killpg, (process.pid, signal.SIGKILL))
        timer.start()
        failed = None
        why = ""
        for line in process.stdout:
            match = re.match(r"(FAIL|ERROR) +firmware_(\w+)", line)
            if match:
                failed = match[2] if match[1] == "FAIL" else LIMIT
                why = next(process.stdout, "")
                os.killpg(process.pid, signal.SIGTERM)
                break
        for _ in process.stdout:
            pass
        status = process.wait()
        timer.cancel()
    if not failed and status != 0:
        failed = LIMIT
    return failed and Failure(failed, why.strip())


def judge(number, name, mutant, original, equivalent, options):
    """Builds a mutant and runs the scenarios against it."""
    folder = options.work / str(number)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(options.work / "original", folder,
                    ignore=shutil.ignore_patterns("results"))
    source = folder / name
    source.write_text(mutate.mutated(source.read_text(), mutant))
    image = build(folder)
    if image is None:
        verdict = Verdict("not compiled")
    elif image == original:
        verdict = Verdict("equivalent")
    elif (name, mutant.old, mutant.new) in equivalent:
        verdict = Verdict("equivalent", "listed")
    else:
        rest = [scenario for scenario in options.scenarios if scenario not in FIRST]
        by = first_failure(folder, FIRST, options) or first_failure(folder, rest, options)
        verdict = Verdict("killed", *by) if by else Verdict("survived")
    shutil.rmtree(folder)
    return verdict


def draw(options):
    """Mutants of all files, in the order of the files."""
    mutants = [(name, mutant) for name in options.file or FILES
               for mutant in mutate.mutants_of((mutate.ROOT / EXAMPLE / name).read_text())]
    if options.mutants and len(mutants) > options.mutants:
        mutants = sorted(random.Random(options.seed).sample(mutants, options.mutants))
    return mutants


def show(name, mutant, verdict, verbose):
    if verdict.word == "survived":
        print(f"    {name}:{mutant.line}: {mutant.operator} survived\n        - {mutant.old}\n"
              f"        + {mutant.new}", flush=True)
    elif verbose:
        print(f"    {name}:{mutant.line}: {mutant.operator} {verdict.word} {verdict.by}: "
              f"{verdict.why}", flush=True)


def summarize(verdicts):
    """Prints who noticed how many, and the share."""
    counts = collections.Counter(verdict.word for verdict in verdicts)
    by = collections.Counter(verdict.by for verdict in verdicts if verdict.word == "killed")
    for name, count in by.most_common():
        print(f"{count:5}  {name}")
    killed, survived = counts["killed"], counts["survived"]
    share = f", {100 * killed / (killed + survived):.0f} % killed" if killed + survived else ""
    print(f"{len(verdicts)} mutants: {killed} killed, {survived} survived, "
          f"{counts['equivalent']} equivalent, {counts['not compiled']} not compiled{share}")
    return survived


def read_options():
    parser = argparse.ArgumentParser(prog="./dev mutate --firmware", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="*", choices=[[], *FILES], metavar="FILE",
                        help=f"of {', '.join(FILES)}; all")
    parser.add_argument("--mutants", type=int, default=30, metavar="N",
                        help="drawn at random (30); 0: all")
    parser.add_argument("--seed", default="1", help="of the drawing (1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N",
                        help="mutants at a time (one a processor)")
    parser.add_argument("--runs", type=int, default=1, metavar="N",
                        help="scenarios at a time for each of them (1)")
    parser.add_argument("--limit", type=float, default=120, metavar="S",
                        help="of a scenario, by the wall clock (120); on a busy machine more, as "
                        "one that ends by it counts as killed")
    parser.add_argument("--program", default=str(mutate.ROOT / "build/release/coman-hil"),
                        help="coman-hil (that of build/release)")
    parser.add_argument("--list", action="store_true", help="print the mutants and try none")
    parser.add_argument("--verbose", action="store_true",
                        help="print also what was killed, and by what")
    options = parser.parse_args()
    options.work = mutate.WORK / f"firmware-{options.seed}"
    options.scenarios = sorted(path.stem.removeprefix("firmware_") for path in
                               (mutate.ROOT / EXAMPLE / "scenarios").glob("firmware_*.yaml"))
    return options


def main():
    options = read_options()
    mutants = draw(options)
    if options.list:
        for name, mutant in mutants:
            print(f"{name}:{mutant.line}: {mutant.operator}\n    - {mutant.old}\n"
                  f"    + {mutant.new}")
        return 0

    # Without a change every scenario must pass
    original = options.work / "original"
    shutil.rmtree(original, ignore_errors=True)
    shutil.copytree(mutate.ROOT / EXAMPLE, original)
    image = build(original)
    failed = image and first_failure(original, options.scenarios, options)
    if not image or failed:
        print("the firmware without a change: "
              f"{': '.join(failed) if failed else 'the build fails'}", file=sys.stderr)
        return 1
    equivalent = mutate.read_equivalent((mutate.ROOT / EQUIVALENT).read_text())
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        running = {pool.submit(judge, number, name, mutant, image, equivalent, options):
                   (name, mutant) for number, (name, mutant) in enumerate(mutants)}
        for done in concurrent.futures.as_completed(running):
            show(*running[done], done.result(), options.verbose)
    return 0 if summarize([done.result() for done in running]) == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
