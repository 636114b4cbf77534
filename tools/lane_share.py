#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints which parts of the program a run's instructions are in, and how many of those in each part
work on packed numbers (SIMD lanes), on single ones, or on none.

    valgrind --tool=callgrind --toggle-collect=loop_run --dump-instr=yes --compress-pos=no \\
        --compress-strings=no --callgrind-out-file=out.%p PROGRAM ...
    tools/lane_share.py out.NUMBER PROGRAM
"""
import collections
import re
import subprocess
import sys

PARTS = [
    ("generated dynamics", "generated/dynamics/|model/symbolic/"),
    ("implicit stages and drives", "model/(implicit|drives)/"),
    ("rest of the model", "model/"),
    ("contact", "contact/"),
    ("boards and buses", "(boards|canbus|faults)/"),
    ("controller and verdict", "(tasks|app)/"),
    ("loop", "(sim|rt|control)/"),
]


def part_of(source):
    """Returns the part that a source belongs to."""
    path = re.sub(r"^.*/\.\./", "", source)
    path = path[path.find("generated/") :] if "generated/" in path else path
    for name, pattern in PARTS:
        if re.match(pattern, path):
            return name
    return "libraries, base"


def kind_of(instruction):
    """Returns what an instruction works on."""
    name, operands = instruction
    if "ymm" in operands or "zmm" in operands or re.search("p[ds]$", name):
        return "packed"
    return "single" if "xmm" in operands and re.search("s[ds]$", name) else "other"


def read_program(program):
    """Returns name and operands of each instruction by its address."""
    text = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", program], check=True, capture_output=True, text=True
    ).stdout
    found = re.findall(r"^\s+([0-9a-f]+):\s+(\S+)[ \t]*(.*)$", text, re.MULTILINE)
    return {int(at, 16): (name, operands) for at, name, operands in found}


def count(profile, program):
    """Returns counts by part and kind; costs behind a line `calls=` are those of what is called."""
    counts = collections.defaultdict(collections.Counter)
    instructions = read_program(program)
    part, called = "", False
    with open(profile, encoding="utf-8") as lines:
        for line in lines:
            cost = re.match(r"0x([0-9a-f]+) \d+ (\d+)$", line)
            if line.startswith("fl="):
                part = part_of(line[3:].strip())
            elif line.startswith("calls="):
                called = True
            elif cost and called:
                called = False
            elif cost:
                kind = kind_of(instructions.get(int(cost[1], 16), ("", "")))
                counts[part][kind] += int(cost[2])
    return counts


def main():
    counts = count(sys.argv[1], sys.argv[2])
    total = sum(sum(kinds.values()) for kinds in counts.values())
    for part, kinds in sorted(counts.items(), key=lambda item: -sum(item[1].values())):
        own = sum(kinds.values())
        print(
            f"{part:28} {100 * own / total:5.1f} %"
            + "".join(f"  {kind} {100 * kinds[kind] / own:3.0f} %" for kind in ("packed", "single"))
        )
    print(f"{total} instructions")


if __name__ == "__main__":
    main()
