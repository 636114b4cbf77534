# SPDX-License-Identifier: Apache-2.0
"""What the tests of the Python package share. Prints TAP."""
import contextlib
import importlib
import logging
import os
import pathlib
import sys
import traceback

SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
PACKAGE = SOURCE / "python"
RIGS = SOURCE / "config" / "rigs"
KINDS = ("coman", "coman-compact", "coman-fd", "coman-foc")     # one of each protocol and bus
# the robot on a stand that holds its pelvis, nothing held, nothing near
BENCH = {"robot": {"fixed_base": True}, "scene": {"engine": "none"}, "initial": {"hold": "none"}}

sys.dont_write_bytecode = True
sys.path[:0] = [str(PACKAGE), str(SOURCE / "tests" / "service")]
os.environ["COMAN_HIL"] = sys.argv[1]

import tap


def rig(name):
    return str(RIGS / f"{name}.yaml")


@contextlib.contextmanager
def raises(kind, *words):
    """The block ends with this exception, which says these words."""
    try:
        yield
    except kind as error:
        missing = [word for word in words if word not in str(error)]
        assert not missing, f"{missing} missing in: {error}"
    else:
        raise AssertionError(f"no {kind.__name__}")


def main(names):
    """Runs what begins with test_."""
    logging.getLogger("canmatrix").setLevel(logging.CRITICAL)    # formats that it cannot read
    try:
        importlib.import_module("can")
        importlib.import_module("canmatrix")
    except ImportError as error:
        print(f"1..0 # SKIP {error} (Debian packages python3-can, python3-canmatrix)")
        return
    tests = [(name, body) for name, body in names.items() if name.startswith("test_")]
    print(f"1..{len(tests)}")
    for name, body in tests:
        try:
            body()
            tap.result(True, name[5:])
        except Exception:
            tap.result(False, name[5:], traceback.format_exc())
    sys.exit(tap.failed > 0)
