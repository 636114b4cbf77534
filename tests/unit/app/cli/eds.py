#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: eds.py COMAN-HIL
EDS files of the rig coman-cia402, read by Python's configparser and held against the rules of CiA
306 that a configuration tool relies on. Prints TAP."""
import configparser
import os
import pathlib
import re
import subprocess
import sys
import tempfile

PROGRAM = sys.argv[1]
SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
sys.path.insert(0, str(SOURCE / "tests/service"))
import tap  # noqa: E402

RIG = str(SOURCE / "config/rigs/coman-cia402.yaml")
# DataType: bits, signed
TYPES = {2: (8, True), 3: (16, True), 4: (32, True), 5: (8, False), 6: (16, False), 7: (32, False)}
LISTS = {"MandatoryObjects": lambda i: i in (0x1000, 0x1001, 0x1018),
         "OptionalObjects": lambda i: 0x1000 <= i < 0x2000 or 0x6000 <= i <= 0x9fff,
         "ManufacturerObjects": lambda i: 0x2000 <= i < 0x6000}


def run(*words, **options):
    return subprocess.run([PROGRAM, "eds", *words], stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def read(path):
    parser = configparser.ConfigParser(interpolation=None, strict=True)
    parser.optionxform = str
    parser.read(path, encoding="ascii")
    return parser


def number(text, node=0):
    relative = text.startswith("$NODEID+")
    return int(text.removeprefix("$NODEID+"), 0) + (node if relative else 0)


def check_variable(where, keys):
    """Errors of a variable or sub-index."""
    if keys["ObjectType"] != "0x7" or keys["AccessType"] not in ("ro", "wo", "rw", "rwr", "rww",
                                                                 "const"):
        yield f"{where}: type or access"
    if keys["PDOMapping"] not in ("0", "1"):
        yield f"{where}: PDOMapping"
    kind = int(keys["DataType"], 16)
    if kind in (9, 15):
        return
    bits, signed = TYPES[kind]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    low = max(low, number(keys.get("LowLimit", str(low))))
    high = min(high, number(keys.get("HighLimit", str(high))))
    if not low <= number(keys["DefaultValue"], 1) <= high:
        yield f"{where}: default {keys['DefaultValue']} outside {low} to {high}"


def check_file(path):
    """Every rule that a file breaks."""
    eds = read(path)
    known = {"FileInfo", "DeviceInfo", "DummyUsage", "Comments", *LISTS}
    if eds["FileInfo"]["FileName"] != path.name or "\r" in path.read_text(encoding="ascii"):
        yield "FileName"
    listed = []
    for name, belongs in LISTS.items():
        count = int(eds[name]["SupportedObjects"])
        indices = [int(eds[name][str(i + 1)], 16) for i in range(count)]
        listed += indices
        if len(eds[name]) != count + 1 or indices != sorted(set(indices)) or not all(
                map(belongs, indices)):
            yield f"{name}: not a list of its objects in order"
    for index in listed:
        section = f"{index:X}"
        known.add(section)
        keys = eds[section]
        if "SubNumber" not in keys:
            yield from check_variable(section, keys)
            continue
        subs = [s for s in eds.sections() if re.fullmatch(section + "sub[0-9A-F]+", s)]
        known.update(subs)
        if keys["ObjectType"] not in ("0x8", "0x9") or int(keys["SubNumber"]) != len(subs):
            yield f"{section}: {len(subs)} sub-indices, ObjectType {keys['ObjectType']}"
        for sub in subs:
            yield from check_variable(sub, eds[sub])
        highest = max(int(s.split("sub")[1], 16) for s in subs)
        # of mappings and of the history sub-index 0 is what is in use
        if not (0x1600 <= index < 0x1800 or 0x1a00 <= index < 0x1c00 or index == 0x1003) and int(
                eds[section + "sub0"]["DefaultValue"], 0) != highest:
            yield f"{section}: sub-index 0 is not the highest"
    if set(eds.sections()) != known:
        yield f"sections that no list has: {sorted(set(eds.sections()) - known)[:3]}"
    yield from check_mappings(eds)


def check_mappings(eds):
    """Factory mappings are of objects that may be mapped, with their bits, into 64 at most."""
    for section in [s for s in eds.sections() if re.fullmatch("1[6A][0-9A-F]{2}", s)]:
        bits = 0
        for i in range(int(eds[section + "sub0"]["DefaultValue"], 0)):
            entry = int(eds[f"{section}sub{i + 1:X}"]["DefaultValue"], 0)
            index, sub = entry >> 16, entry >> 8 & 0xff
            name = f"{index:X}" if f"{index:X}sub{sub:X}" not in eds else f"{index:X}sub{sub:X}"
            bits += entry & 0xff
            if eds[name]["PDOMapping"] != "1" or TYPES[int(eds[name]["DataType"], 16)][
                    0] != entry & 0xff:
                yield f"{section}: {entry:#010x} cannot be mapped"
        if bits > 64:
            yield f"{section}: {bits} bits"


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        done = run(RIG, "-o", str(folder))
        files = sorted(folder.glob("*.eds"))
        print("1..7", flush=True)
        tap.result(done.returncode == 0 and len(files) == 11, "a file for each of 11 nodes",
                   done.stderr)
        broken = [f"{f.name}: {e}" for f in files for e in check_file(f)]
        tap.result(not broken, "each file obeys the rules of CiA 306", "\n".join(broken))

        drive = read(folder / "coman-cia402-left_arm_0x01.eds")
        tap.result(
            [drive["DeviceInfo"][k] for k in ("NrOfRXPDO", "NrOfTXPDO")] == ["16", "16"]
            and drive["1000"]["DefaultValue"] == "0xFFFF0192"
            and all(drive[f"{0x67ff + 0x800 * k:X}"]["DefaultValue"] == "0x20192" for k in range(4))
            and drive["1800sub1"]["DefaultValue"] == "$NODEID+0x180"
            and drive["1014"]["DefaultValue"] == "$NODEID+0x80"
            and all(f"{0x6040 + 0x800 * k:X}" in drive for k in range(4))
            and "8041" not in read(folder / "coman-cia402-torso_0x01.eds"),
            "a drive of four axes has the objects of four axes, one of three has not")
        sensor = read(folder / "coman-cia402-wrists_0x02.eds")
        tap.result(sensor["1000"]["DefaultValue"] == "0x20194" and "6040" not in sensor
                   and sensor["7130"]["SubNumber"] == "7", "a force-torque node has six channels")
        one = run(RIG, "left_arm/0x01")
        tap.result(one.stdout == (folder / "coman-cia402-left_arm_0x01.eds").read_text(),
                   "one node to standard output is the same file", one.stderr)
        none = run(RIG, "left_arm/0x02")
        tap.result(none.returncode == 2 and 'found "left_arm/0x02"' in none.stderr,
                   "a node that the rig has not is refused", none.stderr)
        other = run(str(SOURCE / "config/rigs/coman.yaml"), "-o", str(folder))
        tap.result(other.returncode == 2 and "no bus with protocol cia402" in other.stderr,
                   "a rig without such nodes is refused", other.stderr)
    return tap.failed > 0


sys.exit(main())
