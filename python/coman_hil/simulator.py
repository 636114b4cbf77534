# SPDX-License-Identifier: Apache-2.0
"""A simulator as a context manager: started, stepped, observed, ended."""
from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import time
from collections import deque
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Sequence

import can

from . import database
from .boards import Boards, read_table
from .control import Control
from .errors import (BoardError, ControlError, GatewayError, RigError, SimulatorDied,
                     SimulatorError, SimulatorStopped, SimulatorTimeout)
from .gateway import GatewayBus, RawFrame, command_text, message_of
from .process import Process, find_program, make_folder
from .robot import ForceSensor, Joint, Latest, Names

BOARD_FAULT, MISMATCH, STOPPING = 2, 4, 8      # flags of DONE
MOVED = "somebody else moves its time (ctl step, restore, another client's STEP)"
STEP_TICKS = 1000           # at most in one STEP, so that a time-out is soon enough
SWITCH_TICKS = 5            # until a new mode has been reported
FRAMES_KEPT = 100_000
STARTED = ("joints", "sensors", "tick", "tick_s", "bus", "buses", "control", "board_fault",
           "_frames", "_queued", "_boards", "_listening")      # there once it has been started


def frame_text(message: database.Message, data: bytes) -> str:
    """What the gateway is told to send a frame; FD frames go with the fast rate."""
    words = f"fdsend {message.word} 1" if message.fd else f"send {message.word}"
    return f"< {words} {len(data)} {data.hex(' ')} {message.bus} >".replace("  ", " ")


class Done(NamedTuple):
    """What a DONE says."""
    tick: int
    flags: int


class Simulator:
    """A simulator of a rig, in lockstep, for as long as the `with` block lasts.

        with Simulator("coman", hold="always") as sim:
            sim.enable("LElbj")
            sim.joints["LElbj"].voltage_v = 2.0
            sim.step(100)
            print(sim.joints["LElbj"].current_a)

    Nothing moves but by `step`, and the same calls give the same state, bit for bit. Each call
    ends: a simulator that dies or hangs is an exception with what it said.

    rig: name of an installed rig, or path of a rig file. changes: keys of a rig that replace those
    of this one, as {"robot": {"fixed_base": True}}. program: path of coman-hil, else that of the
    environment variable COMAN_HIL, else the one of the PATH. hold: when links are clamped, none,
    until_enabled or always; the rig's by default. settle: start in static equilibrium. faults:
    lines as of `coman-hil run --fault`; with a name ("jam: motor LElbj jam manual") for `fault`.
    seed: of noise and faults. record: folder for a recording. options: more of `coman-hil run`.

    refresh_s: while motors are on, set-points are repeated this often in a step of many ticks;
    boards let a voltage go after 0.1 s. Some boards get theirs every tick. start_timeout_s: until
    buses are served. timeout_s: for each answer, of wall time.

    Attributes. joints, sensors: by name. tick, time_s: virtual time. bus: the connection, a bus of
    python-can. control: the control socket. buses: what the DBC files say. board_fault: whether a
    board is in fault. exit_status: of the process, once it has ended."""

    def __init__(self, rig: str = "coman", *, program: str | None = None,
                 changes: Mapping[str, Any] | None = None, hold: str | None = None,
                 settle: bool = False, faults: Sequence[str] = (), seed: int | None = None,
                 record: str | None = None, options: Sequence[str] = (), refresh_s: float = 0.01,
                 start_timeout_s: float = 180.0, timeout_s: float = 30.0) -> None:
        self.rig, self._changes, self._program = os.fspath(rig), changes, program
        self._options = [*(["--hold", hold] if hold else []), *(["--settle"] if settle else []),
                         *(word for line in faults for word in ("--fault", line)),
                         *(["--seed", str(seed)] if seed is not None else []),
                         *(["--record", os.fspath(record)] if record else []), *options]
        self._refresh_s = refresh_s
        self._start_timeout_s, self._timeout_s = start_timeout_s, timeout_s
        self._process: Process | None = None
        self.exit_status: int | None = None

    def __getattr__(self, name: str) -> Any:
        if name in STARTED and not self.__dict__.get("_process"):
            raise SimulatorError(f"{name}: the simulator has not been started: `with Simulator(...)"
                                 " as sim:` starts it, or start()")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    # ---- start and end ----

    def __enter__(self) -> "Simulator":
        self.start()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.close()
        if kind is None and self.exit_status:
            raise SimulatorDied("end", self.exit_status, self.log)

    def start(self) -> None:
        """Starts the process and joins its buses; `with` does it."""
        if self._process:
            raise SimulatorError("the simulator has been started already")
        program, folder = find_program(self._program), make_folder()
        try:
            rig = self._write_rig(folder)
            # first of all, for it says best what is wrong with a rig
            try:
                self.buses = database.load(program, rig, self._start_timeout_s)
            except RigError as error:
                raise RigError(self._name_files(str(error), folder)) from None
            self._process = Process(program, rig, self._options, folder)
        finally:
            if not self._process:
                shutil.rmtree(folder, ignore_errors=True)
        try:
            host, port, path = self._process.wait_until_ready(self._start_timeout_s)
            self.control = Control(path, self._timeout_s)
            self.bus = GatewayBus(host, port, self._timeout_s)
            self._prepare()
        except BaseException:
            self.close()
            raise

    def _write_rig(self, folder: str) -> str:
        """The rig's name or path; with changes that of a file that extends it."""
        is_path = "/" in self.rig or "." in self.rig
        rig = os.path.abspath(self.rig) if is_path else self.rig
        if not self._changes:
            return rig
        path = os.path.join(folder, "rig.yaml")
        if is_path:
            # a rig may only extend what lies below it: the tree of this one gets a name there
            parts = rig.rsplit("/", 2)
            os.symlink(parts[0] or "/", os.path.join(folder, "tree"))
            rig = "/".join(["tree", *parts[1:]])
        with open(path, "w") as file:
            json.dump({"extends": rig, **self._changes}, file)  # JSON is YAML
        return path

    def _name_files(self, text: str, folder: str) -> str:
        """A message about the rig as the caller knows its files: the one of the changes is ours."""
        text = re.sub(re.escape(f"{folder}/rig.yaml") + r"(:\d+)*", "changes", text)
        return text.replace(f"{folder}/tree", os.path.abspath(self.rig).rsplit("/", 2)[0])

    def _prepare(self) -> None:
        """What is known before the first tick."""
        status = self.control.status()
        self.tick_s: float = status["tick_s"]
        self.tick: int = 0
        self._latest: Latest = {}
        self._frames: deque[RawFrame] = deque(maxlen=FRAMES_KEPT)
        self._queued: list[str] = []
        self._listening = self.board_fault = False
        self._kept: dict[int, tuple] = {}

        buses = self.buses.buses.values()
        self._table = read_table(self._rows_of_table())
        self._boards: list[Boards] = self._table.boards
        at = {boards.bus: boards for boards in self._boards}
        self.joints: Names[Joint] = Names("joint", (
            (name, Joint(name, at[bus], self._table, buses, self._latest))
            for name, bus in self._table.joints.items()))
        self._taking = {boards.bus: boards.take for boards in self._boards if boards.reports}
        self.sensors: Names[ForceSensor] = Names("force sensor", (
            (name, ForceSensor(name, bus, self._table))
            for name, bus in self._table.sensors.items()))
        self._kept[0] = self._keep()

        step = next(((bus, bus.messages["STEP"]) for bus in buses if "STEP" in bus.messages), None)
        if not step:
            raise SimulatorError(f"no bus of rig {self.rig} has a STEP message")
        bus, self._step_message = step
        self._done_message = bus.message("DONE")
        self._done_key = (bus.name, self._done_message.word)

    def _rows_of_table(self) -> Iterator[str]:
        """The client table, which the run tells in parts; an empty one is the end."""
        for number in itertools.count():
            rows = self.bus.ask(str(number), self._timeout_s)
            if not rows:
                return
            yield from rows

    def close(self) -> None:
        """Ends the process; `with` does it."""
        for part in ("bus", "control"):
            if part in self.__dict__:
                getattr(self, part).shutdown() if part == "bus" else self.control.close()
        if self._process:
            self.exit_status = self._process.end()

    @property
    def pid(self) -> int:
        """The number of its process."""
        if not self._process:
            raise SimulatorError("the simulator has not been started")
        return self._process.pid

    @property
    def log(self) -> str:
        """What it has said so far: events of the run, and after its end the summary."""
        return self._process.log if self._process else ""

    # ---- time ----

    @property
    def time_s(self) -> float:
        """Virtual time (s)."""
        return self.tick * self.tick_s

    def step(self, ticks: int = 1, refresh: bool = True) -> None:
        """Runs the simulator on by so many ticks (1 ms each, or as the rig says), all buses in one.

        The set-points of motors that are on are sent before the first tick, and again every
        refresh_s; without refresh none are sent, and boards let the last one go. What has been
        sent before (send, command) takes part in the first tick."""
        if not hasattr(ticks, "__index__"):
            raise TypeError(f"found {ticks!r} ticks, expected a whole number")
        if ticks < 1:
            raise ValueError(f"found {ticks} ticks, expected 1 or more")
        self._frames.clear()
        while ticks > 0:
            points = {j.name: (j.quantity, j.value) for j in self.joints.values() if j.enabled} \
                if refresh else {}
            count = min(ticks, self._refresh_ticks(points))
            text = "".join(boards.set_points(points) for boards in self._boards
                           if any(joint in points for joint in boards.joints) or
                           (boards.cyclic and refresh and self._listening))
            self._run("".join(self._queued) + text, count)
            self._queued.clear()
            ticks -= count

    def _refresh_ticks(self, points: Mapping[str, Any]) -> int:
        ticks = max(1, round(self._refresh_s / self.tick_s)) if points else STEP_TICKS
        return min([boards.refresh_ticks for boards in self._boards if boards.refresh_ticks and
                    (any(joint in points for joint in boards.joints) or
                     (boards.cyclic and self._listening))] + [ticks, STEP_TICKS])

    def _run(self, commands: str, ticks: int) -> None:
        """One STEP, and all frames until its DONE."""
        begin, expected = self.tick & 0xffffffff, self.tick + ticks & 0xffffffff
        step = self._step_message.encode({"tick": begin, "ticks": ticks})
        done, refused = self._exchange(commands + frame_text(self._step_message, step), begin,
                                       expected)
        self.tick = done.tick
        self.board_fault = bool(done.flags & BOARD_FAULT)
        if done.flags & STOPPING and done.tick != expected:
            raise self._reason(f"tick {done.tick}", SimulatorStopped("the run is over"))
        if done.tick != expected:
            raise GatewayError(f"the simulator is at tick {done.tick}, expected {expected}: "
                               f"{MOVED}")
        if refused:
            raise GatewayError(f"the simulator did not run the STEP to tick {refused.tick}: "
                               f"{MOVED}")

    def _exchange(self, text: str, begin: int, expected: int) -> tuple[Done, Done | None]:
        """Sends a STEP that expects tick `begin`, receives until its DONE at tick `expected`, and
        returns it with the refusal of an earlier STEP if one came. Silence for timeout_s is the
        end."""
        refused = moved = None
        try:
            self.bus.send_text(text)
            end = time.monotonic() + self._timeout_s
            while True:
                frames = self.bus.receive_frames(max(0.0, end - time.monotonic()))
                answer = None
                for done in self._keep_frames(frames):
                    # Of its own DONE each STEP knows the tick. A ctl step has one too, which may
                    # still be on its way, and there may be the one of a STEP that timed out.
                    if done.flags & MISMATCH and done.tick == begin:
                        refused = done    # an earlier one: this STEP is not refused there
                    elif done.flags & MISMATCH:
                        answer = refused = done
                    elif done.flags & STOPPING or done.tick == expected:
                        answer = done
                    else:
                        moved = done
                if answer:
                    return answer, refused
                if frames:
                    end = time.monotonic() + self._timeout_s
                elif time.monotonic() >= end:
                    why = f"; it is at tick {moved.tick}: {MOVED}" if moved else ""
                    raise SimulatorTimeout(f"tick {self.tick}: no answer to STEP within "
                                           f"{self._timeout_s:g} s{why}")
        except (GatewayError, SimulatorTimeout) as error:
            raise self._reason(f"tick {self.tick}", error) from None

    def _keep_frames(self, frames: Sequence[RawFrame]) -> list[Done]:
        """Takes frames over as telemetry, but for those DONE, which it returns."""
        latest, key = self._latest, self._done_key
        for frame in frames:
            latest[frame[5], frame[1]] = frame
            if frame[5] in self._taking:
                self._taking[frame[5]](frame)
        if key not in latest:
            self._frames.extend(frames)
            return []
        del latest[key]
        dones = []
        for frame in frames:
            if (frame[5], frame[1]) == key:
                values = self._done_message.decode(bytes.fromhex(frame[4]))
                dones.append(Done(int(values["tick"]), int(values["flags"])))
            else:
                self._frames.append(frame)
        return dones

    def _reason(self, what: str, error: SimulatorError) -> SimulatorError:
        """Why the other side is gone, when it is."""
        died = self._process.died(what) if self._process else None
        if died and died.status == 0:
            return SimulatorStopped(f"{what}: the run is over; the simulator said:\n{died.log}")
        return died or error

    # ---- frames ----

    def send(self, message: can.Message) -> None:
        """Sends a frame, its channel is the name of the bus; it takes part in the next step."""
        self.buses.bus(message.channel or "")
        self._queued.append(command_text(message))

    def command(self, bus: str, message: str, length: int | None = None,
                **values: float | str) -> None:
        """Sends a message of the DBC with its signals in their units, or by the names of values:
        command("torso", "torso_0x01_COMMAND", command="SET_OPEN_LOOP_0", SET_OPEN_LOOP_pwm_0=4).
        Counters and checksums of a protocol file that are not given are filled in. It takes part in
        the next step."""
        found = self.buses.bus(bus).message(message)
        data = found.encode(values, length)
        given = sum(found.signal(name).place((1 << found.signal(name).bits) - 1, len(data))
                    for name in values)
        for boards in self._boards:
            if boards.bus == bus:
                data = boards.close(found.word, data, given)
        self._queued.append(frame_text(found, data))

    def frames(self, bus: str | None = None) -> list[can.Message]:
        """What the boards sent during the last step (the newest 100,000 frames), as python-can has
        it; channel is the bus, timestamp virtual time (s)."""
        return [message_of(frame) for frame in self._frames if bus in (None, frame[5])]

    def received(self, bus: str, message: str) -> list[dict[str, float | str]]:
        """The values of the frames of a message that came during the last step, in their units,
        those that have names by name."""
        found = self.buses.bus(bus).message(message)
        return [found.decode(bytes.fromhex(frame[4])) for frame in self._frames
                if frame[5] == bus and found.has(frame[1])]

    # ---- motors ----

    def listen(self) -> None:
        """Makes every board report; runs some ticks. `enable` does it."""
        if self._listening:
            return
        stages = [boards.reporting() for boards in self._boards]
        for number in range(max(map(len, stages))):
            self._queued += [text for stage in stages if number < len(stage)
                             for text in stage[number]]
            self.step(2)
        self._listening = True
        self.step(SWITCH_TICKS)

    def enable(self, *joints: str, quantity: str | None = None, timeout_s: float = 1.0) -> None:
        """Switches motors on, those of all joints when none is named: faults are cleared, set
        points are 0 until they are set, but for positions, which are the present ones. quantity:
        their kind, "voltage", "current", "torque", "velocity" or "position"; the boards' usual one
        by default. Runs ticks until the boards say so; raises BoardError when one does not within
        timeout_s of virtual time, when boards take no such set points, and for a loop whose gains
        are 0."""
        chosen = [self.joints[name] for name in joints or self.joints]
        self._check_quantity(chosen, quantity)
        self.listen()
        self._check_gains(chosen, quantity)
        self._switch(chosen, None)
        self.step(SWITCH_TICKS)
        self._switch(chosen, quantity, on=True)
        end = self.tick + round(timeout_s / self.tick_s)
        while True:
            self.step(SWITCH_TICKS)
            waiting = [joint for joint in chosen if not joint.is_on]
            if not waiting:
                return
            if self.tick >= end:
                text = ", ".join(joint.state_text() for joint in waiting)
                raise BoardError(f"motors do not switch on within {timeout_s:g} s: {text}; "
                                 "the simulator's log may say what their boards want first")

    def tripped(self) -> list[str]:
        """The joints that are enabled and whose boards no longer say so, as after a trip or a
        restart. Steps succeed all the same: ask after each."""
        return [joint.name for joint in self.joints.values() if joint.enabled and not joint.is_on]

    def dropped(self) -> tuple[int, str]:
        """How many commands boards have dropped, for a wrong length, value or checksum or as
        unknown, and what the log says of the last one ("" = nothing yet; the log comes a little
        later than the count)."""
        count, _, reason = self.bus.ask("dropped", self._timeout_s)[0].partition(" ")
        return int(count), reason

    def disable(self, *joints: str) -> None:
        """Switches motors off, those of all joints when none is named; runs some ticks."""
        chosen = [self.joints[name] for name in joints or self.joints]
        self._switch(chosen, None)
        self.step(SWITCH_TICKS)

    def _check_quantity(self, joints: Sequence[Joint], quantity: str | None) -> None:
        """Whether the boards take such set points."""
        for joint in joints:
            if (quantity or joint.quantities[0]) not in joint.quantities:
                raise BoardError(joint.refusal(quantity))

    def _check_gains(self, joints: Sequence[Joint], quantity: str | None) -> None:
        """Whether the loop that gets the set points has gains, where the run tells them."""
        names = [joint.name for joint in joints]
        questions = [text for boards in self._boards
                     for text in boards.questions(names, quantity or "")]
        if questions:
            self._queued += questions
            self.step(2)
        for name in names if questions else ():
            gains = self._table.values.get((name, f"{quantity}_gain"), ())
            if gains and all(gain.told and not gain.read() for gain in gains):
                raise BoardError(f"{name}: the {quantity} loop of its board has gains of 0 and "
                                 f"would do nothing: sim.set('joint.{name}.{quantity}_kp', ...), "
                                 "or a message with its gains, sets them")

    def _switch(self, joints: Sequence[Joint], quantity: str | None, on: bool = False) -> None:
        wanted = {joint.name: (quantity or joint.quantities[0]) if on else None
                  for joint in joints}
        for joint in joints:
            joint.quantity = wanted[joint.name]
            joint.value = joint.held_rad() if joint.quantity == "position" else 0.0
        stages = [boards.switch([n for n in boards.joints if n in wanted and wanted[n] == kind],
                                kind)
                  for boards in self._boards for kind in dict.fromkeys(wanted.values())]
        for number in range(max(map(len, stages))):
            if number:
                self.step(2)
            self._queued += [text for stage in stages if number < len(stage)
                             for text in stage[number]]

    # ---- control ----

    def _ask(self, call: Callable[..., Any], *arguments: Any, **keys: Any) -> Any:
        try:
            return call(*arguments, **keys)
        except ControlError:
            raise
        except SimulatorError as error:
            raise self._reason("control socket", error) from None

    def status(self) -> dict[str, Any]:
        """The true state: "joints" (rad), "contacts" (N), "faults" that are active, "buses", ..."""
        self.state_hash()   # DONE comes before a tick is published, a pause after it
        return self._ask(self.control.status)

    def state_hash(self) -> str:
        """16 digits that two runs share when their robots are in the same state bit for bit."""
        return self._ask(self.control.state_hash)

    def get(self, name: str) -> float:
        """A tunable: `coman-hil ctl list tunables` has their names."""
        return self._ask(self.control.get, name)

    def set(self, name: str, value: float) -> None:
        """Sets a tunable from the next tick on: set("supply_v", 40)."""
        self._ask(self.control.set, name, value)

    def fault(self, name: str, on: bool = True) -> None:
        """Switches a fault that was given with a name at the start."""
        self._ask(self.control.fault, name, on)

    def push(self, body: str, force_n: Sequence[float] = (0, 0, 0),
             moment_nm: Sequence[float] = (0, 0, 0), duration_s: float = 0.0) -> None:
        """Pushes a body from the next tick on with a force (N) and a moment (N m) in the world
        frame, for duration_s of virtual time, 0 = until the next push."""
        self._ask(self.control.push, body, force_n, moment_nm, duration_s)

    def checkpoint(self, slot: int = 1) -> None:
        """Keeps the state in slot 1 to 3."""
        self._ask(self.control.checkpoint, slot)
        self._kept[slot] = self._keep()

    def restore(self, slot: int = 1) -> None:
        """Goes back to a checkpoint, with slot 0 to the start. Telemetry, voltages and motors that
        are on are again those of then."""
        answer = self._ask(self.control.restore, slot)
        # of a checkpoint that somebody else has made only the state is known
        latest, self._listening, joints, kept = self._kept.get(slot, ({}, self._listening, {}, ()))
        self.tick = answer["tick"]
        self._queued.clear()
        self._frames.clear()
        self._latest.clear()
        self._latest.update(latest)
        for name, (quantity, value) in joints.items():
            self.joints[name].quantity, self.joints[name].value = quantity, value
        for boards, state in zip(self._boards, kept):
            boards.restore(state)

    def reset(self) -> None:
        """Goes back to the start."""
        self.restore(0)

    def _keep(self) -> tuple:
        return (dict(self._latest), self._listening,
                {joint.name: (joint.quantity, joint.value) for joint in self.joints.values()},
                [boards.keep() for boards in self._boards])
