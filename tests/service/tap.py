# SPDX-License-Identifier: Apache-2.0
"""Numbered lines of TAP for tests in Python (tap.sh is for those in shell)."""
number = failed = 0


def begin(first):
    """Numbers go on from first, after those of another program."""
    global number
    number = first - 1


def check(good, name, found=None):
    """A test with what was found, which is shown in any case."""
    global number, failed
    number += 1
    failed += not good
    print(f"{'ok' if good else 'not ok'} {number} - {name}", flush=True)
    if found is not None:
        print(f"# {found}", flush=True)


def result(good, name, why=""):
    """A test with the reason, which is shown when it fails: its last lines."""
    check(good, name)
    for line in [] if good else str(why).splitlines()[-40:]:
        print(f"# {line}", flush=True)
