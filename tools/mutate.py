#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the suite against small faults (./dev mutate): changes one thing in a C file, builds what
depends on it, and runs tests until one fails, the mirrored one first. What no test notices is
printed as a survivor: a test is missing, or the change changes nothing.

All of it happens in a copy of the tree (build/mutate/source). Builds and tests of mutants, which
may write or remove anything, see a read-only machine without a network, with a /tmp of their own.

An object file that does not change tells that a mutant is equivalent; others that are must be
named, with the reason, in tests/equivalent_mutants.txt. What the compiler refuses, as it does a
number for a pointer, is no mutant. A mutant that takes too much CPU time is killed; one that does
not end for a limit of wall-clock time that no load makes up for is killed by time, which the table
shows apart. The table also tells kills by the mirrored test from those by other tests, and from
those by the hashes of service_same_bits alone, which runs last. Fails when a room's tests kill
fewer than nine of ten."""
import argparse
import collections
import hashlib
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import subprocess
import sys
import time

import release

ROOT = pathlib.Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "mutate"
SOURCE = WORK / "source"
BUILD = SOURCE / "build" / "release"
LAUNCHER = WORK / "launch.sh"
RESULTS, COSTS = WORK / "results.json", WORK / "costs.json"
EQUIVALENT = "tests/equivalent_mutants.txt"
ROOMS = tuple(sorted({path.parts[-2] for path in ROOT.glob("*/CMakeLists.txt")}
                     - {"docs", "systemd", "tests", "tools"}))
BUILD_LIMIT_S = 900
# how many times its seconds a test may take: of CPU time, of wall-clock time on a loaded machine
PATIENCE_CPU, PATIENCE = 6, 20
# tests that wait for the others of their rank
LONG_S = 4
# what every compiler of the product refuses; other warnings are let pass
REFUSED = ("int-conversion", "incompatible-pointer-types", "implicit-function-declaration")
# percent of a room's mutants that its tests have to kill
ENOUGH = 90
MEMORY = 12 << 30

Mutant = collections.namedtuple("Mutant", "line operator old new")
# by: the test that failed; how: one of KILLERS
Verdict = collections.namedtuple("Verdict", "word by how", defaults=("", ""))
# the mirrored test, another test, or the hashes of runs when every other test passed
KILLERS = ("own test", "others", "same_bits alone")
SAME_BITS = "service_same_bits"


# ---- mutants of a text ----

def blank(match):
    return re.sub(r"[^\n]", " ", match.group())


def code_of(text):
    """The text with comments, strings, characters and preprocessor lines blanked, as long as it."""
    text = re.sub(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', blank, text,
                  flags=re.S)
    return re.sub(r"^[ \t]*#(?:\\\n|[^\n])*", blank, text, flags=re.M)


FLIPPED = {"<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "==", "&&": "||",
           "||": "&&"}
NEXT = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
SIGN = {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=",
        "++": "--", "--": "++"}
# operands of which a comparison is likely one of whole numbers: of doubles, < and <= are as good
WHOLE = (r"(?:\b[i-n]|\b\w*(?:count|size|length|number|capacity|max|end|used|ticks?|index"
         r"|\bn[a-z]?))")
DECLARED = re.compile(r"\s*(?:static |const |unsigned |struct |enum |volatile |_Atomic )*\w+ "
                      r"(?:\*|const )*\w+(?:\[[^\]]*\])*(?:[;,]| =)")
STATEMENT = re.compile(r"\s+(?:[\w.\[\]()*+\->]+ [-+*/|&^]?= [^;{]*|[\w.\->]+\(.*\)"
                       r"|[\w.\->]+(?:\+\+|--));$")
SIGNED = re.compile(r"(?<=[\w)\]] )(\+=|-=|\*=|/=|[-+*/])(?= )|(?<=[\w\])])(\+\+|--)")
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?f?|\d+e[-+]?\d+|\d+)(?![\w.])")
# functions of which it does not matter which argument comes first
EVEN = re.compile(r"(?:str|strn|mem)cmp|calloc|arena_alloc|fm(?:in|ax)|vec3_dot|hypot")
TYPED = re.compile(r"(?:struct|const|void|int|double|char|enum|size_t|u?int\d+_t) ")
# what only a sanitizer notices, or nobody should
KEPT = re.compile(r"\s*(?:return|break|continue|goto|case|default|free|f?close|\(void\)|assert|"
                  r"static_assert|_Static_assert)\b")


def spans(line):
    """Yields (operator, start, end, replacement) of a line of code."""
    for match in re.finditer(r"(?<= )(<=|>=|==|!=|<|>|&&|\|\|)(?= |$)", line):
        yield "comparison", *match.span(), FLIPPED[match[0]]
        if match[0] in NEXT and (re.search(WHOLE + r" $", line[:match.start()])
                                 or re.match(r" (?:\d+\b(?!\.)|" + WHOLE + r"\b)",
                                             line[match.end():])):
            yield "off by one", *match.span(), NEXT[match[0]]
    for match in re.finditer(r"(?<=[ (])!(?=[\w(])", line):
        yield "comparison", *match.span(), ""
    for match in SIGNED.finditer(line):
        yield "sign", *match.span(), SIGN[match[0]]
    for match in re.finditer(r"(?:(?<=[(=,?:+*] )|(?<=[(\[])|(?<=return ))-(?=[\w(])", line):
        yield "sign", *match.span(), ""
    array = DECLARED.match(line) and "=" not in line
    for match in NUMBER.finditer(line):
        number = match[0]
        # -1 says that there is none, as any number below 0 does; nobody notices more memory
        if re.search(r"(?:[=(,?:] |\(|return )-$|alloc\([^()]*$", line[:match.start()]):
            continue
        if re.fullmatch(r"\d+", number):
            sized = line[:match.start()].endswith("[") \
                and re.match(r"\] = |\];", line[match.end():])
            if not array and not (sized and DECLARED.match(line)):
                yield "off by one", *match.span(), str(int(number) + 1)
        else:
            yield "constant", *match.span(), "1.0" if float(number.rstrip("f")) == 0 \
                else f"(1.5 * {number})"
    for match in re.finditer(r"(?<=\w\()[^()]*(?=\))", line):
        if EVEN.fullmatch(re.search(r"\w+(?=\($)", line[:match.start()])[0]):
            continue
        arguments = match[0].split(", ")
        for k in range(len(arguments) - 1):
            if arguments[k].strip() and arguments[k] != arguments[k + 1] \
                    and not TYPED.match(arguments[k]):
                swapped = [*arguments[:k], arguments[k + 1], arguments[k], *arguments[k + 2:]]
                yield "swapped argument", *match.span(), ", ".join(swapped)


def mutants_of(text):
    """All mutants of a C text."""
    found = []
    code = code_of(text).split("\n")
    before = "{"
    for number, (line, full) in enumerate(zip(code, text.split("\n")), 1):
        if not line.strip():
            continue
        inside = line.startswith((" ", "\t"))
        if inside and not re.match(r"\s*(?:static_|_Static_)?assert\b", line):
            for operator, start, end, new in spans(line):
                # an argument that is a string is blank in `line`
                if operator == "swapped argument" and full[start:end] != line[start:end]:
                    continue
                found.append(Mutant(number, operator, full.strip(),
                                    (full[:start] + new + full[end:]).strip()))
        if inside and before.rstrip().endswith((";", "{", "}", ":")) and STATEMENT.match(line) \
                and not DECLARED.match(line) and not KEPT.match(line):
            found.append(Mutant(number, "dropped statement", full.strip(), ";"))
        before = line
    return [mutant for mutant in dict.fromkeys(found) if mutant.old != mutant.new]


def mutated(text, mutant):
    lines = text.split("\n")
    line = lines[mutant.line - 1]
    lines[mutant.line - 1] = line[:len(line) - len(line.lstrip())] + mutant.new
    return "\n".join(lines)


# ---- the copy and the sandbox ----

def run(command, **options):
    return subprocess.run(command, capture_output=True, text=True, **options)


def copy_tree():
    """Brings the copy to the tree's state; what did not change keeps its time."""
    names = run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT,
                check=True).stdout.split("\n")
    names = {name for name in names if name and (ROOT / name).is_file()}
    for name in names:
        new, old = ROOT / name, SOURCE / name
        if not old.exists() or new.read_bytes() != old.read_bytes():
            old.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(new, old)
    for old in SOURCE.rglob("*"):
        name = old.relative_to(SOURCE)
        if name.parts[0] != "build" and old.is_file() and str(name) not in names:
            old.unlink()


# How the copy is compiled: by ccache where there is one. Mutants only read its cache, in which most
# of what they make anew is found (a generator that is linked again writes the same text); what
# fails is tried again without -Werror.
LAUNCH = """#!/bin/sh
if command -v ccache >/dev/null; then cached=ccache; fi
if [ -z "$HIL_MUTANT" ]; then exec $cached "$@"; fi
export CCACHE_READONLY=1 CCACHE_DIR={cache} CCACHE_TEMPDIR=/tmp
$cached "$@" || exec "$@" -Wno-error
"""
INSIDE = """
set -e
mount --make-rprivate /
mount --bind {work} {work}
mount -o remount,bind,ro /
mount -t tmpfs -o size=4g tmpfs /tmp
mount -t tmpfs -o size=1g tmpfs /dev/shm
ip link set lo up
ulimit -v {memory}
ulimit -t {cpu}
cd {build}
export HOME=/tmp HIL_MUTANT=1
exec {command}
"""


def inside(command, limit, cpu="unlimited"):
    """Runs a command in the sandbox; its status is 124 when it took longer than `limit`. cpu:
    limit of each process's CPU time, s."""
    own = [] if os.getuid() == 0 else ["--user", "--map-root-user"]
    script = INSIDE.format(work=shlex.quote(str(WORK)), build=shlex.quote(str(BUILD)),
                           memory=MEMORY >> 10, cpu=cpu, command=shlex.join(command))
    return subprocess.run(
        ["timeout", "-k", "5", str(limit), "unshare", *own, "--mount", "--pid", "--net", "--ipc",
         "--fork", "--kill-child", "--mount-proc", "sh", "-c", script],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", check=False)


# ---- tests of a file ----

# scripts that test what a room sends or prints
SCRIPTS = {"boards": ("cli_protocol",), "rig": ("service_dbc",),
           "viewer": ("service_page", "page_recording")}
Test = collections.namedtuple("Test", "name program rank seconds")


def names_of(paths):
    """What matches the names of the tests that mirror files: a/b/c.c has a_c, a_b_c, b_c or c."""
    names = set()
    for path in paths:
        parts = [part for part in path.parts[:-1] if part not in ("tests", "unit")]
        names |= {"_".join((*some, path.stem))
                  for some in ((), parts, parts[:1], parts[1:], parts[-1:])}
    return re.compile("(?:" + "|".join(map(re.escape, sorted(names, reverse=True))) + ")(?:_|$)")


class Suite:
    """The tests of the copy, and which of them can notice what."""

    def __init__(self):
        shown = run(["ctest", "--test-dir", str(BUILD), "--show-only=json-v1"], check=True)
        # the seconds that they took in the tree itself, and here where they passed
        self.costs = {}
        data = ROOT / "build" / "release" / "Testing" / "Temporary" / "CTestCostData.txt"
        for line in data.read_text().split("\n") if data.exists() else ():
            words = line.split()
            if len(words) == 3 and int(words[1]) > 0:
                self.costs[words[0]] = float(words[2])
        if COSTS.exists():
            self.costs |= json.loads(COSTS.read_text())
        self.tests = []
        for test in json.loads(shown.stdout)["tests"]:
            # a program that is not built yet has no command
            unbuilt = BUILD / "tests" / f"test_{test['name']}"
            program = pathlib.Path(test.get("command", [unbuilt])[0])
            program = str(program.relative_to(BUILD)) if program.is_relative_to(BUILD) \
                else "coman-hil"
            self.tests.append((test["name"], program))
            limit = next((item["value"] for item in test["properties"]
                          if item["name"] == "TIMEOUT"), 60)
            self.costs.setdefault(test["name"], 3.0 if limit <= 180 else LONG_S + 1.0)
        self.inputs = {}
        self.sick = set()
        self.healthy = set()

    def depends(self, program, path):
        if program not in self.inputs:
            listed = run(["ninja", "-C", str(BUILD), "-t", "inputs", program])
            self.inputs[program] = set(listed.stdout.split("\n"))
        return str(SOURCE / path) in self.inputs[program]

    def of(self, path, seconds):
        """Tests that depend on a file: all of the file (rank 0), and as many as take so long
        together of its folder and of what includes its header (1), of the folders of these (2),
        others (3), scripts (4), service_same_bits (5)."""
        header = f'"{path.with_suffix(".h")}"'
        users = [user.relative_to(SOURCE) for folder in (*ROOMS, "tests")
                 for user in (SOURCE / folder).rglob("*.c") if header in user.read_text()]
        own, used = names_of([path]), names_of(users)
        near = tuple(f"{user.parts[-2]}_" for user in [path, *users]) + (f"{path.parts[0]}_",)
        folder = (f"{path.parts[-2]}_", "_".join((*path.parts[:-1], "")))
        found = []
        for name, program in self.tests:
            if name in self.sick or not self.depends(program, path):
                continue
            if own.match(name):
                rank = 0
            elif name == SAME_BITS:
                rank = 5
            elif program == "coman-hil":
                rank = 1 if name in SCRIPTS.get(path.parts[0], ()) else 4
            elif used.match(name) or name.startswith(folder):
                rank = 1
            else:
                rank = 2 if name.startswith(near) else 3
            found.append(Test(name, program, rank, self.costs[name]))
        found.sort(key=lambda test: (test.rank, test.seconds))
        total, chosen = 0.0, []
        for test in found:
            cost = test.seconds if test.rank > 0 else 0.0
            if total + cost <= seconds:
                total += cost
                chosen.append(test)
        return chosen

    def run(self, tests):
        """Runs tests, two at a time, until one fails; returns the verdict."""
        names = "|".join(re.escape(test.name) for test in tests)
        done = inside(["ctest", "-j2", "--stop-on-failure", "-R", f"^({names})$"],
                      60 + PATIENCE * sum(test.seconds for test in tests),
                      20 + PATIENCE_CPU * int(1 + max(test.seconds for test in tests)))
        for name, seconds in re.findall(r"Test +#\d+: (\w+) \.* +Passed +([\d.]+) sec",
                                        done.stdout):
            self.costs[name] = float(seconds)
        COSTS.write_text(json.dumps(self.costs, indent=1) + "\n")
        if done.returncode == 0:
            return Verdict("survived")
        failed = re.search(r"Test +#\d+: (\w+) \.*(\*\*\*Timeout)?", "".join(
            line for line in done.stdout.split("\n") if "***" in line))
        return Verdict("killed by time" if done.returncode == 124 or failed is None or failed[2]
                       else "killed", failed[1] if failed else "")

    def passes(self, name):
        """Whether a test passes here on what is not mutated."""
        if name not in self.healthy | self.sick:
            program = dict(self.tests)[name]
            inside(["ninja", program], BUILD_LIMIT_S)
            good = self.run([Test(name, program, 0, 60.0)]).word == "survived"
            (self.healthy if good else self.sick).add(name)
            if not good:
                print(f"    without {name}, which fails in the copy", flush=True)
        return name in self.healthy


# ---- verdicts ----

def object_of(path, entry, out):
    """Compiles a file to `out`; returns its hash, or nothing when it does not compile."""
    words = shlex.split(entry["command"])
    words[words.index("-o") + 1] = str(out)
    words = [word for word in words if word not in ("-g", "-MD")] + [
        "-g0", "-Wno-error", *(f"-Werror={warning}" for warning in REFUSED)]
    words = words[words[0] == str(LAUNCHER):]
    done = subprocess.run(words, cwd=entry["directory"], capture_output=True, check=False)
    return hashlib.sha256(out.read_bytes()).hexdigest() if done.returncode == 0 else None


def verdict_of(suite, tests):
    """Builds and runs tests, rank by rank and short ones first, until one fails."""
    for key in sorted({(test.rank, test.seconds > LONG_S) for test in tests}):
        some = [test for test in tests if (test.rank, test.seconds > LONG_S) == key]
        if not some:
            continue
        built = inside(["ninja", "-k1", *sorted({test.program for test in some})], BUILD_LIMIT_S)
        if re.search(r"^FAILED: .*\bgenerated/", built.stdout, re.M):
            return Verdict("killed")  # a generator that fails, or writes what does not compile
        if built.returncode != 0:  # it compiles, so something else is wrong
            raise SystemExit(built.stdout)
        verdict = suite.run(some)
        if verdict.word != "survived":
            return verdict
    return Verdict("survived")


def killer_of(verdict, tests):
    """Which of KILLERS a verdict is of; nothing for what survived."""
    ranks = {test.name: test.rank for test in tests}
    if verdict.word == "survived":
        return ""
    return KILLERS[0 if ranks.get(verdict.by) == 0 else 2 if verdict.by == SAME_BITS else 1]


def try_mutant(path, text, mutant, suite, options):
    """Returns the verdict of a change that the compiler takes; tests that fail without it too are
    left out."""
    while True:
        tests = suite.of(path, options.seconds)
        (SOURCE / path).write_text(mutated(text, mutant))
        try:
            verdict = verdict_of(suite, tests)
        finally:
            (SOURCE / path).write_text(text)
        if not verdict.by or suite.passes(verdict.by):
            return verdict._replace(how=killer_of(verdict, tests))


def compiled(path, entry, text, mutant):
    """Returns the hash of a mutant's object file, None when the compiler refuses it."""
    (SOURCE / path).write_text(mutated(text, mutant))
    try:
        return object_of(path, entry, WORK / "mutant.o")
    finally:
        (SOURCE / path).write_text(text)


def try_file(name, suite, options, equivalent, before):
    """Yields the result of a file, mutant after mutant. before: its result of an earlier run, of
    which only what survived is tried again."""
    path = pathlib.Path(name)
    text = (SOURCE / path).read_text()
    entries = [entry for entry in json.loads((BUILD / "compile_commands.json").read_text())
               if entry["file"] == str(SOURCE / path)]
    if not entries:
        raise SystemExit(f"{name}: found no command that compiles it")
    mutants = mutants_of(text)
    random.Random(f"{options.seed}:{name}").shuffle(mutants)
    known = {Mutant(*mutant): Verdict(*verdict) for mutant, verdict in before["verdicts"]
             if verdict[0] != "survived"} if before else {}
    tests = suite.of(path, options.seconds)
    print(f"{name}: {len(mutants)} mutants, {len(tests)} tests "
          f"({', '.join(test.name for test in tests[:4])}{', ...' if len(tests) > 4 else ''})",
          flush=True)
    verdicts = []
    result = {"text": hashlib.sha256(text.encode()).hexdigest(), "verdicts": verdicts}
    original = object_of(path, entries[0], WORK / "mutant.o")
    for mutant in mutants:
        if options.mutants and len(verdicts) == options.mutants:
            break
        start = time.monotonic()
        verdict = known.get(mutant)
        if (name, mutant.old, mutant.new) in equivalent:
            verdict = Verdict("equivalent", "listed")
        elif not verdict:
            changed = compiled(path, entries[0], text, mutant)
            if changed is None:
                continue
            verdict = Verdict("equivalent") if changed == original \
                else try_mutant(path, text, mutant, suite, options)
        verdicts.append((mutant, verdict))
        if verdict.word == "survived":
            print(f"    {name}:{mutant.line}: {mutant.operator} survived\n"
                  f"        - {mutant.old}\n        + {mutant.new}", flush=True)
        elif options.verbose:
            print(f"    {name}:{mutant.line}: {mutant.operator} {verdict.word} {verdict.by} "
                  f"{time.monotonic() - start:.1f} s", flush=True)
        yield result


def read_equivalent(text):
    """Entries of the list: a file, the line before (-), after (+), and the reason (indented #)."""
    listed = set()
    for match in re.finditer(r"^(\S+\.c)\n {4}- (.*)\n {4}\+ (.*)\n {4}# \S", text, re.M):
        listed.add(match.groups())
    return listed


def killed_share(counts):
    """Percent of the mutants that can be killed and were; all, when there was none."""
    killed = counts["killed"] + counts["killed by time"]
    tried = killed + counts["survived"]
    return 100 * killed / tried if tried else 100


def counts_of_rooms(results):
    rooms = collections.defaultdict(collections.Counter)
    for name, result in sorted(results.items()):
        for key in (name.split("/")[0], "all"):
            for _, verdict in result["verdicts"]:
                rooms[key].update(Verdict(*verdict)[::2])
            rooms[key]["files"] += 1
    return rooms


def table_of(rooms):
    """Counts by room, as Markdown."""
    heads = ("room", "files", "mutants tried", "equivalent", "killed",
             *(f"by {killer}" for killer in KILLERS), "by time", "survived", "killed %")
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for room in sorted(rooms, key=lambda key: (key == "all", key)):
        counts = rooms[room]
        killed, late = counts["killed"] + counts["killed by time"], counts["killed by time"]
        survived, equivalent = counts["survived"], counts["equivalent"]
        lines.append(f"| {room} | {counts['files']} | {killed + survived + equivalent} "
                     f"| {equivalent} | {killed} "
                     f"| {' | '.join(str(counts[killer]) for killer in KILLERS)} | {late} "
                     f"| {survived} "
                     f"| {killed_share(counts):.0f} |")
    return "\n".join(lines)


def report(table):
    """Writes the table to the report's end."""
    head = release.REPORT.read_text().partition(release.MUTANTS)[0]
    command = shlex.join(word for word in sys.argv[1:] if word not in ("--report", "--again"))
    release.REPORT.write_text(f"{head}{release.MUTANTS}\n\n`./dev mutate {command}` on commit "
                      f"{release.commit()}:\n\n{table}\n")


def main():
    parser = argparse.ArgumentParser(prog="./dev mutate", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="*", help="C files of the product")
    parser.add_argument("--draw", type=int, default=0, metavar="N",
                        help="and N files of each room at random")
    parser.add_argument("--mutants", type=int, default=20, metavar="N",
                        help="of a file, drawn at random (20); 0: all")
    parser.add_argument("--seconds", type=float, default=40, metavar="S",
                        help="of tests beside the file's own for a mutant that survives (40)")
    parser.add_argument("--seed", default="1", help="of all drawings (1)")
    parser.add_argument("--again", action="store_true",
                        help="keep what the last run found of files that did not change, but for "
                             "what survived, which is tried again")
    parser.add_argument("--report", action="store_true",
                        help="write the table to docs/release-report.md too")
    parser.add_argument("--list", action="store_true", help="print the mutants and try none")
    parser.add_argument("--verbose", action="store_true",
                        help="print also what was killed, and by what")
    options = parser.parse_args()
    product = sorted(name for name in run(["git", "ls-files", "*.c"], cwd=ROOT,
                                          check=True).stdout.split() if name.startswith(ROOMS))
    names = [str(pathlib.Path(name).resolve().relative_to(ROOT)) for name in options.file]
    for name in names:
        if name not in product:
            parser.error(f"found {name}, expected a C file in {', '.join(ROOMS)}")
    if options.draw:
        # by a hash of each name: a new file changes no more of a draw than its own place in it
        for room in ROOMS:
            rest = [name for name in product if name.startswith(room + "/") and name not in names]
            names += sorted(rest, key=lambda name: hashlib.sha256(
                f"{options.seed}:{name}".encode()).digest())[:options.draw]
    if not names:
        parser.error("expected a file, or --draw N")
    if options.list:
        for name in names:
            for mutant in mutants_of((ROOT / name).read_text()):
                print(f"{name}:{mutant.line}: {mutant.operator}\n    - {mutant.old}\n"
                      f"    + {mutant.new}")
        return 0

    copy_tree()
    made = BUILD / "CMakeCache.txt"
    if made.exists() and f"CMAKE_HOME_DIRECTORY:INTERNAL={SOURCE}\n" not in made.read_text():
        shutil.rmtree(BUILD)  # of the tree that this one is a copy of
    cache = run(["ccache", "-k", "cache_dir"]).stdout.strip() if shutil.which("ccache") else ""
    LAUNCHER.write_text(LAUNCH.format(cache=shlex.quote(cache)))
    LAUNCHER.chmod(0o755)
    for command in (["cmake", "--preset", "release", "-DBUILD_TESTING=ON",
                     *(f"-DCMAKE_{language}_COMPILER_LAUNCHER={LAUNCHER}"
                       for language in ("C", "CXX"))],
                    ["cmake", "--build", "--preset", "release", "--target", "coman-hil", "--",
                     "--quiet"]):
        built = subprocess.run(command, cwd=SOURCE, stdout=subprocess.DEVNULL, check=False)
        if built.returncode != 0:
            return 1
    suite = Suite()
    listed = SOURCE / EQUIVALENT
    equivalent = read_equivalent(listed.read_text()) if listed.exists() else set()
    before = json.loads(RESULTS.read_text()) if options.again and RESULTS.exists() else {}
    results = {}
    for name in names:
        text = hashlib.sha256((SOURCE / name).read_bytes()).hexdigest()
        old = before.get(name)
        for result in try_file(name, suite, options, equivalent,
                               old if old and old["text"] == text else None):
            results[name] = result
            RESULTS.write_text(json.dumps(before | results, indent=1) + "\n")
    rooms = counts_of_rooms(results)
    table = table_of(rooms)
    print("\n" + table)
    if options.report:
        report(table)
    return 0 if all(killed_share(counts) >= ENOUGH for counts in rooms.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
