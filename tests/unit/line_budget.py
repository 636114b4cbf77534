#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds each room to its number of code lines in line_budget.txt. A code line is neither blank nor
comment only, in *.c, *.h and *.cpp outside docs/ and examples/. A room that exceeds its row fails,
and so does a row with more than SLACK lines to spare: `line_budget.py --lower` lowers the rows to
the count, after a cut. Raise a row by hand, together with lowering another one: the rows may not
sum to more than the row `product`. Prints the whole table, then TAP."""
import collections
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(os.environ.get("HIL_SOURCE_DIR") or pathlib.Path(__file__).parents[2])
BUDGET = ROOT / "tests/unit/line_budget.txt"
SLACK = 100
SHORT = 40  # a product file with fewer lines, of any kind, counts in the row `short files`


def sources():
    """Paths of the sources, relative to ROOT: those of git, or all in a tree without git."""
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True)
    paths = listed.stdout.split("\n") if listed.returncode == 0 else [
        str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.is_file()]
    return sorted(path for path in paths if re.search(r"\.(c|h|cpp)$", path)
                  and not re.match(r"(docs|examples|build)/", path) and (ROOT / path).exists())


def code_lines(text):
    """The number of lines that are neither blank nor comment only."""
    count, comment = 0, False
    for line in map(str.strip, text.split("\n")):
        if comment or line.startswith("/*"):
            comment = "*/" not in line
        elif line and not line.startswith("//"):
            count += 1
    return count


def count_rooms():
    """Code lines by room, with the rows `product`, `tests` and `short files`."""
    lines = collections.Counter()
    for path in sources():
        parts = path.split("/")
        room = "/".join(parts[:2]) if parts[0] == "app" and len(parts) > 2 else parts[0]
        text = (ROOT / path).read_text(errors="replace")
        count = code_lines(text)
        lines[room] += count
        if room != "tests":
            lines["product"] += count
            lines["short files"] += text.count("\n") < SHORT
    return lines


def read_budget():
    rows = (line.split("#")[0].rsplit(None, 1) for line in BUDGET.read_text().split("\n"))
    return {row[0]: int(row[1]) for row in rows if len(row) == 2}


def lower(budget, lines):
    """Writes the counts that are below their rows."""
    def row(match):
        return match[1] + str(min(int(match[2]), lines[match[1].strip()])).rjust(len(match[2]))
    BUDGET.write_text(re.sub(r"^([a-z][\w/ ]*? +)(\d+)$", row, BUDGET.read_text(), flags=re.M))


def main():
    budget, lines = read_budget(), count_rooms()
    if sys.argv[1:] == ["--lower"]:
        lower(budget, lines)
        return 0
    problems = {"rooms_keep_to_their_rows": [], "rows_are_lowered_after_a_cut": []}
    for room in sorted(set(lines) | set(budget)):
        print(f"# {room:16} {lines[room]:7,} of {budget.get(room, 0):7,}")
        if lines[room] > budget.get(room, 0):
            problems["rooms_keep_to_their_rows"].append(
                f"{room} has {lines[room]} code lines, expected at most {budget.get(room, 0)}: "
                "remove lines, or lower another row and raise this one")
        elif budget[room] - lines[room] > SLACK:
            problems["rows_are_lowered_after_a_cut"].append(
                f"{room} has {lines[room]} code lines and its row {budget[room]}: "
                "run tests/unit/line_budget.py --lower")
    print(f"1..{len(problems)}")
    for number, (name, found) in enumerate(problems.items(), 1):
        print(f"{'not ' if found else ''}ok {number} - {name}")
        print("".join(f"# {line}\n" for line in found), end="")
    return any(problems.values())


if __name__ == "__main__":
    sys.exit(main())
