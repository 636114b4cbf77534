# SPDX-License-Identifier: Apache-2.0
"""A plugin for pytest: a simulator for each test. In conftest.py:

    pytest_plugins = ["coman_hil.pytest"]

    @pytest.mark.simulator(hold="always", faults=["jam: motor LElbj jam manual"])
    def test_my_controller(simulator):
        simulator.enable()

The mark has the arguments of coman_hil.Simulator; several add up, the nearest to the test wins. The
rig is otherwise that of the environment variable COMAN_HIL_RIG, else coman; the program that of
COMAN_HIL, else coman-hil of the PATH. A test that fails shows what its simulator said.
"""
from __future__ import annotations

import os
from typing import Any, Iterator

import pytest

from .simulator import Simulator

KEY = pytest.StashKey[Simulator]()


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "simulator(rig, **keys): how the fixture simulator starts "
                            "one: the arguments of coman_hil.Simulator")


def simulator_arguments(item: pytest.Item) -> dict[str, Any]:
    """What the marks of a test say."""
    arguments: dict[str, Any] = {"rig": os.environ.get("COMAN_HIL_RIG", "coman")}
    for mark in reversed(list(item.iter_markers("simulator"))):
        arguments.update(zip(("rig",), mark.args), **mark.kwargs)
    return arguments


@pytest.fixture
def simulator(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    """A simulator in lockstep at tick 0, for this test alone."""
    sim = Simulator(**simulator_arguments(request.node))
    request.node.stash[KEY] = sim
    with sim:
        yield sim


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """What the simulator said belongs to a failure."""
    report = (yield).get_result()
    sim = item.stash.get(KEY, None)
    if report.failed and sim and sim.log:
        report.sections.append(("coman-hil", sim.log))
