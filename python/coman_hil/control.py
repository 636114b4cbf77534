# SPDX-License-Identifier: Apache-2.0
"""The control socket of a run, what `coman-hil ctl` speaks: state, faults, pushes, checkpoints."""
from __future__ import annotations

import json
import socket
import time
from collections import deque
from typing import Any, Sequence

from .errors import ControlError, SimulatorError, SimulatorTimeout


PROTOCOL = 1  # of the control socket, the newest that this package speaks


class Control:
    """A connection to the control socket. Raises SimulatorError where nobody listens, and for a
    simulator whose protocol is newer than this package's.

    rows: what came of subscriptions, {"time_s", "tick", "values"}, the newest 100,000."""

    def __init__(self, path: str, timeout_s: float = 30.0) -> None:
        """timeout_s: how long an answer may take."""
        self.path, self.timeout_s = path, timeout_s
        self.rows: deque[dict[str, Any]] = deque(maxlen=100_000)
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(timeout_s)
        self._text, self._number = b"", 0
        try:
            self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            raise SimulatorError(f"{path}: {error.strerror or error}: no simulator has its control "
                                 "socket there; `coman-hil run RIG` prints its path, and --control "
                                 "PATH sets it") from None
        try:
            hello = self.request("hello")
        except SimulatorError:
            self._socket.close()
            raise
        if hello.get("protocol", 1) > PROTOCOL:
            self._socket.close()
            raise SimulatorError(f"{path}: found protocol {hello['protocol']}, expected {PROTOCOL} "
                                 f"at most: coman-hil {hello.get('version', '')} is newer than "
                                 "this package")

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def request(self, command: str, **keys: Any) -> dict[str, Any]:
        """Sends {"cmd": command, **keys} and returns the answer. Raises ControlError for a
        refusal; keys and answers are in `coman-hil ctl --help`."""
        self._number += 1
        line = json.dumps({"id": self._number, "cmd": command, **keys}) + "\n"
        end = time.monotonic() + self.timeout_s
        try:
            self._socket.sendall(line.encode())
            while True:
                answer = json.loads(self._read_line(end, command))
                if "values" in answer:
                    self.rows.append(answer)
                elif answer.get("id") == self._number:
                    break
        except socket.timeout:
            raise SimulatorTimeout(f"{command}: no answer within {self.timeout_s:g} s") from None
        except OSError as error:
            raise SimulatorError(f"{command}: the control socket is closed: {error}") from None
        if not answer["ok"]:
            raise ControlError(answer.get("code", ""), answer.get("error", ""))
        return answer

    def _read_line(self, end: float, command: str) -> bytes:
        while b"\n" not in self._text:
            left = end - time.monotonic()
            if left <= 0:
                raise socket.timeout
            self._socket.settimeout(left)
            received = self._socket.recv(65536)
            if not received:
                raise SimulatorError(f"{command}: the simulator has closed the control socket")
            self._text += received
        line, self._text = self._text.split(b"\n", 1)
        return line

    # ---- what it can be asked ----

    def status(self) -> dict[str, Any]:
        """Time, buses, joints (true angles, rad or m), contact forces (N), active faults."""
        return self.request("status")

    def statistics(self) -> dict[str, Any]:
        """Durations of the parts of a tick, overruns."""
        return self.request("statistics")

    def get(self, name: str) -> float:
        """The value of a tunable: "supply_v", "joint.LElbj.position_kp", ..."""
        return self.request("get", name=name)["value"]

    def set(self, name: str, value: float) -> dict[str, Any]:
        """Sets a tunable from the next tick on."""
        return self.request("set", name=name, value=value)

    def fault(self, name: str, on: bool = True) -> dict[str, Any]:
        """Switches a fault that the run was started with."""
        return self.request("fault", name=name, on=on)

    def push(self, body: str, force_n: Sequence[float] = (0, 0, 0),
             moment_nm: Sequence[float] = (0, 0, 0), duration_s: float = 0.0) -> dict[str, Any]:
        """Pushes a body at its center of mass with a force and a moment in the world frame; for
        0 s until the next push."""
        return self.request("push", body=body, force_n=list(force_n), moment_nm=list(moment_nm),
                            **({"duration_s": duration_s} if duration_s else {}))

    def checkpoint(self, slot: int = 1) -> dict[str, Any]:
        """Keeps the state in slot 1 to 3."""
        return self.request("checkpoint", slot=slot)

    def restore(self, slot: int = 1) -> dict[str, Any]:
        """Goes back to a checkpoint, or with slot 0 to the start."""
        return self.request("restore", slot=slot)

    def state_hash(self) -> str:
        """16 digits that two runs share when their robots are in the same state bit for bit. The
        run is paused for a moment, without a trace in virtual time."""
        paused = self.request("pause")
        self.request("resume")
        return paused["state_hash"]

    def subscribe(self, *signals: str, period_ms: float = 10) -> None:
        """From now on a row of these signals (patterns such as "q_*") every period_ms of virtual
        time, whole ticks; they come to `rows` with every answer of this connection."""
        self.request("subscribe", signals=list(signals), period_ms=period_ms)
