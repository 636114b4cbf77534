# SPDX-License-Identifier: Apache-2.0
"""What can go wrong. Every exception of this package is a SimulatorError."""
from __future__ import annotations

import difflib
from typing import Iterable


class SimulatorError(Exception):
    """Whatever goes wrong with a simulator."""


class ProgramNotFound(SimulatorError):
    """The program coman-hil is neither where it was said to be nor on the PATH."""


class RigError(SimulatorError):
    """The program refuses the rig: there is none of that name, or its file has a mistake. The text
    is the program's own, with file, line and column."""


class SimulatorDied(SimulatorError):
    """The simulator's process has ended by itself.

    status: its exit status; below 0 the number of a signal. log: all that it said."""

    def __init__(self, what: str, status: int, log: str) -> None:
        ended = f"by signal {-status}" if status < 0 else f"with status {status}"
        said = log.strip() or "(nothing)"
        super().__init__(f"{what}: the simulator has ended {ended}; it said:\n{said}")
        self.status, self.log = status, log


class SimulatorTimeout(SimulatorError):
    """The simulator is there, but did not answer in time."""


class SimulatorStopped(SimulatorError):
    """The run is at its end: its duration is over, or somebody has stopped it."""


class GatewayError(SimulatorError):
    """The gateway refuses what was sent, or another client moves this simulator's time."""


class ControlError(SimulatorError):
    """A refusal of the control socket.

    code: input, empty, recording, clock, busy, unavailable, cut, ended or memory; `coman-hil ctl
    --help` explains them."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(f"{text} ({code})")
        self.code = code


class UnknownName(SimulatorError, KeyError):
    """There is no joint, sensor, bus, message or signal of this name."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        names = list(known)
        near = difflib.get_close_matches(name, names, 1, 0.4)
        hint = f"; the nearest is {near[0]!r}" if near else ""
        super().__init__(f"found no {kind} {name!r}, expected one of {len(names)}{hint}")

    def __str__(self) -> str:
        return str(self.args[0])


class NoTelemetry(SimulatorError):
    """The boards have not said this, or cannot: the text says which."""


class BoardError(SimulatorError):
    """A board does not do as it was told."""
