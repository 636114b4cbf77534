#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The plugin for pytest: marks add up, each test has a simulator of its own, a failure shows what
it said. Prints TAP.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

import area
from area import rig

CONFTEST = 'pytest_plugins = ["coman_hil.pytest"]\n'


def pytest_of(text, *options, default="coman-fd"):
    """What pytest makes of a file of tests."""
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "conftest.py").write_text(CONFTEST)
        pathlib.Path(folder, "test_it.py").write_text("import pytest\n" + text)
        env = dict(os.environ, PYTHONPATH=str(area.PACKAGE), COMAN_HIL_RIG=rig(default))
        done = subprocess.run([sys.executable, "-m", "pytest", "-q", "--strict-markers",
                               "-p", "no:cacheprovider", "-p", "no:warnings", *options, folder],
                              env=env, text=True, capture_output=True, timeout=100)
    return done.returncode, done.stdout


def test_each_test_has_its_own_simulator():
    status, out = pytest_of("""
pids = set()
@pytest.mark.parametrize("number", range(3))
def test_it(simulator, number):
    simulator.step(number + 1)
    assert simulator.tick == number + 1 and simulator.pid not in pids
    pids.add(simulator.pid)
""")
    assert status == 0 and "3 passed" in out, out


def test_marks_add_up_and_the_nearest_wins():
    status, out = pytest_of(f"""
pytestmark = pytest.mark.simulator(hold="none", seed=7, timeout_s=9)

@pytest.mark.simulator({rig("coman-compact")!r}, hold="always")
def test_it(simulator):
    assert simulator.buses.rig == "coman-compact" and len(simulator.buses.buses) == 9
    assert simulator._options == ["--hold", "always", "--seed", "7"]
    assert simulator.control.timeout_s == 9

def test_other(simulator):
    assert simulator.buses.rig == "coman-fd"
    assert simulator._options == ["--hold", "none", "--seed", "7"]
""")
    assert status == 0 and "2 passed" in out, out


def test_a_failure_shows_what_the_simulator_said():
    status, out = pytest_of("""
def test_it(simulator):
    simulator.step(5)
    assert simulator.tick == 6

def test_passes(simulator):
    pass
""")
    assert status == 1 and "1 failed, 1 passed" in out, out
    assert "- coman-hil -" in out and out.count("gateway: 127.0.0.1 port") == 1, out


def test_a_simulator_that_dies_fails_the_test():
    status, out = pytest_of("""
import os, signal
def test_it(simulator):
    os.kill(simulator.pid, signal.SIGKILL)

@pytest.mark.simulator("nobody")
def test_rig(simulator):
    pass
""")
    assert status == 1 and "1 passed, 2 errors" in out, out
    assert "SimulatorDied: end: the simulator has ended by signal 9" in out, out
    assert "RigError" in out and "nobody" in out, out


if subprocess.run([sys.executable, "-c", "import pytest"], stderr=subprocess.DEVNULL).returncode:
    print("1..0 # SKIP pytest is not installed (Debian package python3-pytest)")
else:
    area.main(globals())
