#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps the figures of the docs true (./dev figures).

docs/figures.csv has the figures: a name, its value, and the test that measures it. Where the docs
say one stands in docs/figures.txt, as a text with {NAME:FORMAT} in it. Tests hold what they
measure against the table (tests/figure.h, and hold() here), and a unit test holds the docs against
it (--check). Without --check this runs the tests, writes the table, and puts what changed into the
docs."""
import argparse
import csv
import math
import os
import pathlib
import re
import string
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "figures.csv"
TEXTS = ROOT / "docs" / "figures.txt"
TOLERANCE = 1e-3  # relative; less than the docs' digits show


def read_table():
    """{name: (value, test)}"""
    with TABLE.open(newline="") as file:
        return {row["name"]: (float(row["value"]), row["test"]) for row in csv.DictReader(file)}


def read_texts():
    """[(document, text)]; a line without a document goes on with that of the line before."""
    found, document = [], None
    for line in TEXTS.read_text().splitlines():
        if line and not line.startswith("#"):
            if not line.startswith(" "):
                document, line = line.split(":", 1)
            found.append((document, line.strip()))
    return found


def hold(name, value):
    """Prints a figure that a test has measured; whether it is the table's."""
    expected = read_table().get(name, (math.nan,))[0]
    print(f"# figure {name} {value:.9g}", flush=True)
    return os.environ.get("HIL_FIGURES") == "measure" \
        or abs(value - expected) <= TOLERANCE * abs(expected)


def names_in(text):
    return [field for _, field, _, _ in string.Formatter().parse(text) if field]


def filled(text, values):
    """The text with its figures, exponents without a leading zero."""
    return re.sub(r"(\de[-+]?)0+(?=\d)", r"\1", text.format(**values))


def spaced(text):
    """The text as a pattern in which any white space may stand for a space."""
    return r"\s+".join(re.escape(word) for word in text.split(" "))


def check():
    """Returns what is wrong with the docs or the table."""
    values = {name: value for name, (value, _) in read_table().items()}
    wrong, used = [], set()
    for document, text in read_texts():
        used.update(names_in(text))
        unknown = [name for name in names_in(text) if name not in values]
        if unknown:
            wrong.append(f"docs/figures.txt: found {', '.join(unknown)}, not in docs/figures.csv")
            continue
        expected = filled(text, values)
        if not re.search(spaced(expected), (ROOT / document).read_text()):
            wrong.append(f"{document}: expected \"{expected}\"")
    wrong += [f"docs/figures.csv: {name} stands nowhere in docs/figures.txt"
              for name in values if name not in used]
    return wrong


def measure(preset):
    """Runs the tests that measure figures; returns the table with what they printed."""
    table = read_table()
    tests = "|".join(sorted({test for _, test in table.values()}))
    done = subprocess.run(["ctest", "--test-dir", str(ROOT / "build" / preset), "-R",
                           f"^({tests})$", "--verbose", "-j", str(os.cpu_count())],
                          env={**os.environ, "HIL_FIGURES": "measure"}, text=True,
                          stdout=subprocess.PIPE, check=False)
    tests = {}
    for line in done.stdout.splitlines():
        started = re.match(r" +Start +(\d+): (\w+)", line)
        found = re.match(r"(\d+): # figure (\w+) (\S+)$", line)
        if started:
            tests[started[1]] = started[2]
        elif found:
            table[found[2]] = (float(found[3]), tests[found[1]])
    return table


def pattern_of(text):
    """A pattern of what a text may have been: any number in the place of a figure."""
    parts = []
    for literal, field, _, _ in string.Formatter().parse(text):
        parts.append(spaced(literal) if literal else "")
        if field:
            parts.append(r"[-+]?[\d.,]*\d(?:e[-+]?\d+)?")
    return "".join(parts)


def write(table):
    """Writes the table, and its figures into the docs."""
    with TABLE.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["name", "value", "test"])
        rows.writerows([name, f"{value:.9g}", test]
                       for name, (value, test) in sorted(table.items()))
    values = {name: value for name, (value, _) in table.items()}
    for document, text in read_texts():
        path = ROOT / document
        before = path.read_text()
        new = filled(text, values)
        after = re.sub(pattern_of(text), lambda _, new=new: new, before)
        if after != before and not re.search(spaced(new), before):
            path.write_text(after)
            print(f"{document}: {new}")


def main():
    parser = argparse.ArgumentParser(prog="./dev figures", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="only hold the docs against the table")
    options = parser.parse_args()
    if not options.check:
        write(measure("release"))
    wrong = check()
    print("\n".join(wrong) or "the docs say what docs/figures.csv does")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
