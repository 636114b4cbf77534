# SPDX-License-Identifier: Apache-2.0
"""A simulator as a process of ours, from its start to its end; nothing here waits for ever."""
from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
import threading
import time
import weakref
from typing import Sequence

from .errors import ProgramNotFound, SimulatorDied, SimulatorTimeout

POLL_S = 0.005          # for the file of --ready
END_S = 20.0            # for the summary, after it was asked to end
SOCKET_PATH_MAX = 100   # of a path of a unix socket, with some room


def find_program(program: str | None) -> str:
    """The program: as given, else that of the environment variable COMAN_HIL, else coman-hil of
    the PATH."""
    name = program or os.environ.get("COMAN_HIL") or "coman-hil"
    found = shutil.which(name)
    if not found:
        raise ProgramNotFound(f"found no program {name!r}: install the package coman-hil, or say "
                              "where it is by program=... or in the environment variable COMAN_HIL")
    return found


def make_folder() -> str:
    """A folder of ours that has room for the path of a unix socket."""
    folder = tempfile.mkdtemp(prefix="coman-hil-")
    if len(folder) > SOCKET_PATH_MAX - len("/control"):
        os.rmdir(folder)
        folder = tempfile.mkdtemp(prefix="coman-hil-", dir="/tmp")
    return folder


def read_ready(path: str | os.PathLike[str]) -> dict[str, str] | None:
    """What the file of --ready says, by name; None while there is none."""
    try:
        with open(path, encoding="utf-8", errors="surrogateescape") as file:
            return dict(word.split("=", 1) for word in shlex.split(file.read()))
    except FileNotFoundError:
        return None


def _end(process: subprocess.Popen, folder: str) -> None:
    """Asks the process to end, kills it if it does not."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    shutil.rmtree(folder, ignore_errors=True)


class Process:
    """coman-hil run RIG with the lockstep clock, local buses, a gateway at a free port of
    127.0.0.1 and a control socket in a folder of its own.

    What it prints is read by a thread, so that it never waits for us; a pipe that closes, when we
    die, ends it. It is in a session of its own: Ctrl-C is ours to handle."""

    def __init__(self, program: str, rig: str, options: Sequence[str] = (),
                 folder: str | None = None) -> None:
        self.folder = folder or make_folder()
        self.command = [program, "run", rig, "--transport", "local", "--clock", "lockstep",
                        "--gateway", "127.0.0.1:0", "--control", self.folder + "/control",
                        "--ready", self.folder + "/ready", "--quiet", *options]
        self._text, self._lock = "", threading.Lock()
        try:
            self._process = subprocess.Popen(
                self.command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT, start_new_session=True)
        except OSError as error:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise ProgramNotFound(f"cannot start {program}: {error.strerror}") from None
        # also when nobody closes it: at the latest when the interpreter ends
        self._finalizer = weakref.finalize(self, _end, self._process, self.folder)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self._process.stdout:
            with self._lock:
                self._text += line.decode(errors="replace")

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def log(self) -> str:
        """What it has printed, the summary of the run last."""
        with self._lock:
            return self._text

    def poll(self) -> int | None:
        """Its exit status, None while it runs."""
        return self._process.poll()

    def died(self, what: str) -> SimulatorDied | None:
        """What to raise when it has ended; a moment is given to one that is about to."""
        try:
            status = self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            return None
        self._reader.join(5.0)
        return SimulatorDied(what, status, self.log)

    def wait_until_ready(self, timeout_s: float) -> tuple[str, int, str]:
        """Host and port of the gateway and the path of the control socket, once it serves them."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            ready = read_ready(self.folder + "/ready")
            if ready:
                return ready["gateway_host"], int(ready["gateway_port"]), ready["control"]
            if self.poll() is not None:
                break
            time.sleep(POLL_S)
        error = self.died("start")
        if error:
            raise error
        raise SimulatorTimeout(f"the simulator is not ready after {timeout_s:g} s; it said:\n"
                               f"{self.log.strip() or '(nothing)'}")

    def end(self) -> int:
        """Ends it, if it still runs; its exit status."""
        self._finalizer()
        self._reader.join(5.0)
        return self._process.wait()
