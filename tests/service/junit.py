#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds a JUnit file against the rules of two schemas at once: JUnit.xsd, which Ant's reports
follow, and junit-10.xsd of Jenkins' plugin xUnit. Each rule here is the stricter one. Also checks
the totals. Prints the numbers of tests, failures and errors. First tries its own rules."""
import re
import sys
import xml.etree.ElementTree as tree

COUNT, TEXT = r"\d+", r".*\S.*"
TIME = r"\d{0,3}|\d+\.\d*|\d+"
# an element: its children in their order, whether it may hold text, its attributes
RULES = {
    "testsuites": ("(testsuite )*", False, {}),
    "testsuite": ("properties (testcase )*system-out system-err ", False, {
        "id": COUNT, "package": TEXT, "name": TEXT, "tests": COUNT, "failures": COUNT,
        "errors": COUNT, "time": TIME, "hostname": TEXT,
        "timestamp": r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d"}),
    "properties": ("(property )*", False, {}),
    "property": ("", False, {"name": TEXT, "value": r".*"}),
    "testcase": ("((skipped|error|failure) )?", False, {
        "name": TEXT, "classname": TEXT, "time": TIME}),
    "failure": ("", True, {"type": TEXT, "message": r".*"}),
    "error": ("", True, {"type": TEXT, "message": r".*"}),
    "skipped": ("", True, {}),
    "system-out": ("", True, {}),
    "system-err": ("", True, {}),
}


def faults(element):
    """Yields what is against the rules in an element and below."""
    children, text, attributes = RULES.get(element.tag, ("", True, {}))
    if element.tag not in RULES:
        yield f"element {element.tag}"
    if not re.fullmatch(children, "".join(f"{child.tag} " for child in element)):
        yield f"{element.tag} holds {[child.tag for child in element]}"
    if not text and (element.text or "").strip():
        yield f"{element.tag} holds text"
    for name in attributes.keys() ^ element.attrib.keys():
        yield f"{element.tag} {'without' if name in attributes else 'with'} attribute {name}"
    for name, value in element.attrib.items():
        if not re.fullmatch(attributes.get(name, ".*"), value, re.S):
            yield f'{element.tag} {name}="{value}"'
    for child in element:
        yield from faults(child)


def judge(text):
    """Returns the totals of a file; raises an AssertionError that says what is wrong."""
    root = tree.fromstring(text)
    found = [] if root.tag == "testsuites" else [f"root {root.tag}"]
    found += faults(root)
    assert not found, "; ".join(found[:5])
    totals = [0, 0, 0]
    for number, suite in enumerate(root):
        counts = [len(suite.findall(kind)) for kind in ("testcase", ".//failure", ".//error")]
        assert [int(suite.get(name)) for name in ("tests", "failures", "errors")] == counts, counts
        assert int(suite.get("id")) == number, suite.get("id")
        totals = [a + b for a, b in zip(totals, counts)]
    assert len({suite.get("name") for suite in root}) == len(root), "two suites of a name"
    return totals


GOOD = """<testsuites><testsuite id="0" package="p" name="a" timestamp="2026-01-01T00:00:00"
hostname="h" tests="2" failures="1" errors="0" time="0.2"><properties><property name="n" value=""/>
</properties><testcase classname="c" name="x" time="0.100"/><testcase classname="c" name="y"
time="1"><failure type="t" message="">why</failure></testcase><system-out></system-out>
<system-err></system-err></testsuite></testsuites>"""
# a change of it, and a word of the fault
BAD = (("<testsuites>", '<testsuites tests="2">', "tests"), ('id="0" ', "", "id"),
       ("<system-err></system-err>", "", "holds"), ('type="t" ', "", "type"),
       ('time="0.2"', 'time="-1"', "time"), ('time="0.2"', 'time="nan"', "time"),
       ('name="x"', 'name=" "', "name"), ('errors="0"', 'errors="1"', "[2, 1, 0]"),
       ("T00:00:00", "T00:00:00Z", "timestamp"), ("<properties>", "<properties>x", "text"),
       ('name="x" time="0.100"/>', 'name="x" time="0"><properties/></testcase>', "properties"),
       ("why</failure>", "why</failure><system-out/>", "system-out"))


def self_test():
    assert judge(GOOD) == [2, 1, 0]
    for old, new, word in BAD:
        assert GOOD.count(old) >= 1
        try:
            judge(GOOD.replace(old, new, 1))
        except AssertionError as fault:
            assert word in str(fault), (word, fault)
        else:
            raise SystemExit(f"{new} was let pass")


if __name__ == "__main__":
    self_test()
    with open(sys.argv[1], encoding="utf-8") as file:
        print(*judge(file.read()))
