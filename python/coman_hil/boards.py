# SPDX-License-Identifier: Apache-2.0
"""The controller's side of the boards' protocols, a class each: how boards are made to report, to
switch their motors on and to take set points. What a count is worth stands in the DBC
(database.py); here stands which messages to send, and in which order. described.py has the
protocols of files."""
from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import Any, Mapping, Sequence

from .database import HOST, Bus, Message, Signal
from .errors import BoardError
from .gateway import RawFrame

# a set point: "voltage" (V), "current" (A), "torque" (N m), "velocity" (rad/s), "position" (rad)
Point = tuple

PROTOCOL_OF_HOSTS = (1, 6)      # of iCub: what hosts say that they speak
LIST = re.compile(r"^address \d+, motors (.*)$")


@dataclass(frozen=True)
class FocMotor:
    """What 2FOC boards must be told before they obey: encoder, currents, and the law that limits
    the current (counts; kp and ki are divided by 2**shift). The defaults suit COMAN's motors."""

    encoder_ticks_per_rev: int = 4096
    poles: int = 8
    nominal_a: float = 12.0
    peak_a: float = 18.0
    overload_a: float = 24.0
    current_kp: int = 146
    current_ki: int = 227
    current_shift: int = 15


def frame_text(message: Message, data: bytes) -> str:
    """What the gateway is told to send a frame; FD frames go with the fast rate."""
    words = f"fdsend {message.word} 1" if message.fd else f"send {message.word}"
    return f"< {words} {len(data)} {data.hex(' ')} {message.bus} >".replace("  ", " ")


def axes_of(bus: Bus, board: str) -> list[str]:
    """The joints of a motor board; none for the others."""
    found = LIST.match(bus.boards[board])
    return found[1].split() if found else []


class Boards:
    """The motor boards of a bus and the sensors beside them.

    joints: of the bus, in the order of the rig. quantities: what their motors can be commanded
    with, the usual one first. refresh_ticks: how often set-points are wanted, None = it is the
    user's choice. cyclic: set_points is called in every step, also without a motor that is on.
    extra: by joint, what `take` has found in frames: in SI units, and its mode."""

    quantities: tuple[str, ...] = ("voltage",)
    refresh_ticks: int | None = None
    cyclic = False

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        self.bus, self.supply_v, self.motor = bus, supply_v, motor
        self.board_of = {joint: board for board in bus.boards for joint in axes_of(bus, board)}
        self.joints = list(self.board_of)
        self.extra: dict[str, dict[str, Any]] = {joint: {} for joint in self.joints}

    def text(self, message: str, length: int | None = None, **values: float | str) -> str:
        found = self.bus.message(message)
        return frame_text(found, found.encode(values, length))

    def commanded(self, message: str, quantity: str) -> dict[str, Signal]:
        """Signals of a message to the boards whose quantity begins so, by joint."""
        found = self.bus.messages.get(message)
        return {} if not found else {s.about: s for s in found.signals.values()
                                     if s.quantity.startswith(quantity) and s.about}

    def on_word(self, quantity: str) -> str:
        """The boards' word for a motor that takes such set points."""
        raise NotImplementedError

    def reporting(self) -> list[list[str]]:
        """What makes every board report, in stages with some ticks between them."""
        raise NotImplementedError

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[str]:
        """Switches motors on for a kind of set point, None: off."""
        raise NotImplementedError

    def set_points(self, points: Mapping[str, Point]) -> str:
        """Set points of the joints whose motors are on: quantity and value."""
        raise NotImplementedError

    def take(self, frame: RawFrame) -> None:
        """Finds in a frame what the DBC does not say."""

    def close(self, name: str, data: bytes, given: Sequence[str]) -> bytes:
        """The data of a message with what the protocol fills in itself."""
        return data

    def limited(self, volts: float) -> float:
        """What a bridge can do of it."""
        return max(-self.supply_v, min(self.supply_v, volts))


class _Icub(Boards):
    """What both kinds of iCub boards have in common: modes, sensors."""

    MODES = {"voltage": "open_loop", "current": "current", "position": "direct"}

    def on_word(self, quantity: str) -> str:
        return self.MODES[quantity]

    def _sensors(self) -> list[str]:
        """STRAIN boards begin to transmit."""
        return [self.text(f"{board}_COMMAND", command="SET_TRANSMIT_MODE",
                          SET_TRANSMIT_MODE_mode=0)
                for board in self.bus.boards
                if f"{board}_FORCE" in self.bus.messages]

    def _axis(self, joint: str) -> tuple[str, str]:
        """The message that commands a joint's board, and what its axis adds to names."""
        message = f"{self.board_of[joint]}_COMMAND"
        mode = self.commanded(message, "SET_CONTROL_MODE_mode")[joint]
        return message, mode.name.removeprefix("SET_CONTROL_MODE_mode")

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[str]:
        texts = []
        for joint in joints:
            message, suffix = self._axis(joint)
            texts.append(self.text(message, **{
                "command": "SET_CONTROL_MODE" + suffix,
                "SET_CONTROL_MODE_mode" + suffix:
                    self.MODES[quantity] if quantity else "force_idle"}))
        return texts

    def _percent(self, volts: float) -> float:
        return 100.0 * self.limited(volts) / self.supply_v if self.supply_v > 0 else 0.0


class Icub(_Icub):
    """boards/icub/protocol.h: two axes a board, telemetry every 4 ms."""

    REPORTS = ("POSITION", "STATUS", "CURRENT", "MOTOR_POSITION")
    COMMANDS = {"voltage": ("SET_OPEN_LOOP", "pwm"), "current": ("SET_DESIRED_TORQUE", "torq"),
                "position": ("SET_COMMAND_POSITION", "p")}
    quantities = tuple(COMMANDS)

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._commands = {(joint, quantity): self._command_of(*self._axis(joint), *words)
                          for joint in self.joints for quantity, words in self.COMMANDS.items()}

    def _command_of(self, name: str, suffix: str, command: str,
                    begin: str) -> tuple[Message, Signal, int, int]:
        """The command of an axis: its message, the signal of the set point, the length of the
        frame, and the frame with 0."""
        message = self.bus.message(name)
        signal = next(s for s in message.signals.values() if s.name.endswith(suffix) and
                      s.name.startswith(f"{command}_{begin}"))
        frame = message.encode({"command": command + suffix, signal.name: 0.0})
        return message, signal, len(frame), int.from_bytes(frame, "little")

    def reporting(self) -> list[list[str]]:
        texts = self._sensors()
        for board in dict.fromkeys(self.board_of.values()):
            # the bit of a frame is its type, the low digit of its identifier, less one
            mask = sum(1 << (m.identifier & 0xf) - 1 for m in self.bus.board_messages(board)
                       if m.kind in self.REPORTS)
            texts.append(self.text(f"{board}_COMMAND", command="SET_BROADCAST_POLICY_0",
                                   SET_BROADCAST_POLICY_mask_0=mask))
        return [texts]

    def set_points(self, points: Mapping[str, Point]) -> str:
        texts = []
        for joint in self.joints:
            if joint in points:
                quantity, value = points[joint]
                message, signal, length, frame = self._commands[joint, quantity]
                value = self._percent(value) if quantity == "voltage" else \
                    1e3 * value if quantity == "current" else value
                bits = signal.place(signal.encode(value), length)
                texts.append(frame_text(message, (frame | bits).to_bytes(length, "little")))
        return "".join(texts)


class Foc(_Icub):
    """boards/foc/protocol.h: one axis a board; every set-point is answered."""

    refresh_ticks = 1
    quantities = ("voltage", "current")

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._targets = self.commanded("ALL_DESIRED_TARGETS", "target")

    def reporting(self) -> list[list[str]]:
        motor, major_minor = self.motor, PROTOCOL_OF_HOSTS
        stages: list[list[str]] = [self._sensors(), [], [], []]
        for board in self.board_of.values():
            command = f"{board}_COMMAND"
            stages[0].append(self.text(command, command="GET_FIRMWARE_VERSION",
                                       GET_FIRMWARE_VERSION_major=major_minor[0],
                                       GET_FIRMWARE_VERSION_minor=major_minor[1]))
            stages[1].append(self.text(command, 7, command="SET_MOTOR_CONFIG",
                                       SET_MOTOR_CONFIG_flags=1,  # it has an encoder
                                       SET_MOTOR_CONFIG_resolution=motor.encoder_ticks_per_rev,
                                       SET_MOTOR_CONFIG_poles=motor.poles))
            stages[2].append(self.text(command, command="SET_CURRENT_LIMIT",
                                       SET_CURRENT_LIMIT_nominal=1e3 * motor.nominal_a,
                                       SET_CURRENT_LIMIT_peak=1e3 * motor.peak_a,
                                       SET_CURRENT_LIMIT_overload=1e3 * motor.overload_a))
            stages[3].append(self.text(command, command="SET_CURRENT_PID",
                                       SET_CURRENT_PID_kp=motor.current_kp,
                                       SET_CURRENT_PID_ki=motor.current_ki,
                                       SET_CURRENT_PID_shift=motor.current_shift))
        return stages

    def set_points(self, points: Mapping[str, Point]) -> str:
        if not any(joint in points for joint in self._targets):
            return ""
        message, total = self.bus.message("ALL_DESIRED_TARGETS"), 0
        for joint, target in self._targets.items():
            quantity, value = points.get(joint, ("voltage", 0.0))
            # what a target counts depends on the mode: mA, or STATUS's count of PWM
            if quantity == "current":
                bits = round(1e3 * value) & (1 << target.bits) - 1
            else:
                pwm = self.commanded(f"{self.board_of[joint]}_STATUS", "pwm")[joint]
                bits = pwm.encode(self._percent(value))
            total |= target.place(bits, message.length)
        return frame_text(message, total.to_bytes(message.length, "little"))


class Moteus(Boards):
    """boards/moteus/protocol.h: one axis a controller. A frame commands it in position mode and
    reads what the DBC's reply has."""

    quantities = ("torque", "velocity", "position")
    refresh_ticks = 1
    cyclic = True
    MODES = {0: "stopped", 1: "fault", 10: "position", 11: "timeout"}
    QUESTION = bytes.fromhex("11 00 1f 01 1d 06 13 0d")
    TURN = 2 * math.pi

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._address = {joint: int(bus.boards[board].split()[1].rstrip(","))
                         for joint, board in self.board_of.items()}
        self._joint_of = {address: joint for joint, address in self._address.items()}
        self._listens = False

    def on_word(self, quantity: str) -> str:
        return "position"

    def _frame(self, joint: str, command: bytes) -> str:
        data = command + self.QUESTION
        data = data.ljust(next(n for n in (8, 12, 16, 20, 24, 32, 48, 64) if n >= len(data)), b"P")
        return (f"< fdsend {0x8000 | self._address[joint]:08X} 1 {len(data)} {data.hex(' ')} "
                f"{self.bus.name} >")

    def reporting(self) -> list[list[str]]:
        self._listens = True
        return [[self._frame(joint, b"") for joint in self.joints]]

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[str]:
        return [] if quantity else [self._frame(joint, bytes((1, 0, 0))) for joint in joints]

    def set_points(self, points: Mapping[str, Point]) -> str:
        text = ""
        for joint in self.joints if self._listens else ():
            if joint not in points:
                text += self._frame(joint, b"")
                continue
            quantity, value = points[joint]
            nan = math.nan
            values = {"position": (value / self.TURN, 0.0, 0.0, 1.0, 1.0),
                      "velocity": (nan, value / self.TURN, 0.0, 0.0, 1.0),
                      "torque": (nan, 0.0, value, 0.0, 0.0)}[quantity]
            text += self._frame(joint, bytes((1, 0, 10, 0x0c, 5, 0x20)) +
                                struct.pack("<5f", *values))
        return text

    def take(self, frame: RawFrame) -> None:
        identifier, data = int(frame[1], 16), bytes.fromhex(frame[4])
        joint = self._joint_of.get(identifier >> 8)
        # the reply to QUESTION: mode; position, velocity, torque; the other encoder; volts, fault
        if not joint or identifier & 0x80ff or len(data) < 28 or data[:2] != b"\x21\0":
            return
        position, velocity, torque = struct.unpack_from("<3f", data, 5)
        link = struct.unpack_from("<f", data, 19)[0]
        found = self.extra[joint]
        found["mode"] = self.MODES.get(data[2], str(data[2]))
        found["motor position"] = position * self.TURN
        found["motor velocity"] = velocity * self.TURN
        found["torque"] = torque
        # the encoder of the link repeats each turn
        found["position"] = (link + round(position - link)) * self.TURN
        found["faults"] = data[27]


class Cia402(Boards):
    """boards/cia402/protocol.h: up to four axes a node, objects of an axis 0x800 apart. The PDOs
    are those of the DBC, SYNC triggers telemetry; other set points than voltages go by SDO."""

    quantities = ("voltage", "torque", "velocity", "position")
    refresh_ticks = 1
    cyclic = True
    AXIS, PDO = 0x800, 64
    BOOT = 40           # stages until nodes that were reset are back
    MODES = {"voltage": -1, "position": 8, "velocity": 9, "torque": 10}
    TARGETS = {"position": (0x607a, 4, 1e-5), "velocity": (0x60ff, 4, 1e-5)}

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._node = {board: int(bus.boards[board].split()[1].rstrip(","))
                      for board in dict.fromkeys(self.board_of.values())}
        self._axes, self._place, self._at = {}, {}, {}
        for board, node in self._node.items():
            message = bus.message(f"{board}_STATUS")
            self._axes[node] = message.length // 2
            for joint in axes_of(bus, board):
                signal = next(s for s in message.signals.values() if s.about == joint)
                self._place[joint] = node, signal.start // 16
                self._at[node, signal.start // 16] = joint
        self._listens = False
        self._wanted: set[str] = set()
        self._clearing: set[str] = set()
        self._words: dict[str, int] = {}        # statuswords
        self._control: dict[str, int] = {}
        self._rated_nm: dict[str, float] = {}

    def on_word(self, quantity: str) -> str:
        return "operation enabled"

    def _send(self, identifier: int, data: bytes) -> str:
        return " ".join(filter(None, (f"< send {identifier:03X} {len(data)}", data.hex(" "),
                                      self.bus.name, ">")))

    def _write(self, node: int, index: int, sub: int, size: int, value: int) -> str:
        return self._send(0x600 + node, struct.pack("<BHBI", 0x23 | 4 - size << 2, index, sub,
                                                    value & (1 << 8 * size) - 1).ljust(8, b"\0"))

    def _pdo(self, node: int, kind: int, number: int, cob: int, sync: int,
             objects: Sequence[int], event_ms: int | None = None) -> list[list[str]]:
        """The writes of a PDO, each in a stage of its own: an SDO server takes one at a time."""
        def write(index: int, sub: int, size: int, value: int) -> list[str]:
            return [self._write(node, index, sub, size, value)]
        parameter, mapping = kind + number, kind + 0x200 + number
        return [write(parameter, 1, 4, cob + node | 1 << 31), write(parameter, 2, 1, sync),
                *([write(parameter, 5, 2, event_ms)] if event_ms is not None else []),
                write(mapping, 0, 1, 0),
                *(write(mapping, i + 1, 4, entry) for i, entry in enumerate(objects)),
                write(mapping, 0, 1, len(objects)), write(parameter, 1, 4, cob + node)]

    def reporting(self) -> list[list[str]]:
        stages: list[list[str]] = [[self._send(0, bytes((0x82, 0)))], *([[]] * self.BOOT)]
        rows = []
        for node, axes in self._axes.items():
            steps = [self.AXIS * k for k in range(axes)]
            row = []
            for k, step in enumerate(steps):
                row += self._pdo(node, 0x1800, self.PDO * k, 0x180 + 0x100 * k, 1,
                                 [0x4003 + step << 16 | 32, 0x4004 + step << 16 | 16,
                                  0x4005 + step << 16 | 16], 0)
            for kind, number, cob, index, event_ms in ((0x1800, 1, 0x1c0, 0x6041, 100),
                                                       (0x1400, 0, 0x200, 0x4000, None),
                                                       (0x1400, 1, 0x300, 0x6040, None)):
                row += self._pdo(node, kind, number, cob, 255,
                                 [index + step << 16 | 16 for step in steps], event_ms)
            row += [[self._send(0x600 + node, struct.pack("<BHBI", 0x40, 0x6076 + step, 0, 0))]
                    for step in steps]
            rows.append(row)
        # the nodes take their writes side by side
        stages += [[text for row in rows if number < len(row) for text in row[number]]
                   for number in range(max(map(len, rows), default=0))]
        # force-torque and inertial sensors report by the PDOs that they have from the start
        stages.append([self._send(0, bytes((1, 0)))])
        self._listens = True
        return stages

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[str]:
        texts = []
        for joint in joints:
            node, axis = self._place[joint]
            if quantity:
                self._wanted.add(joint)
                texts.append(self._write(node, 0x6060 + self.AXIS * axis, 0, 1,
                                         self.MODES[quantity]))
            else:
                self._wanted.discard(joint)
                self._clearing.add(joint)
        return texts

    def _next_control(self, joint: str) -> int:
        """The controlword for the next transition of an axis."""
        state = self._words.get(joint, 0) & 0x6f
        if state & 8 and joint in self._clearing:
            return 0 if self._control.get(joint) == 0x80 else 0x80
        self._clearing.discard(joint)
        if joint not in self._wanted:
            return 0
        return {0x40: 6, 0x21: 7, 0x23: 15, 0x27: 15}.get(state, 0)

    def set_points(self, points: Mapping[str, Point]) -> str:
        if not self._listens:
            return ""
        text = ""
        for node, axes in self._axes.items():
            names = [self._at.get((node, axis)) for axis in range(axes)]
            words = [self._next_control(name) if name else 0 for name in names]
            self._control.update({name: word for name, word in zip(names, words) if name})
            volts = [points[name][1] if points.get(name, ("",))[0] == "voltage" else 0.0
                     for name in names]
            text += self._send(0x300 + node, struct.pack(f"<{axes}H", *words))
            text += self._send(0x200 + node, struct.pack(
                f"<{axes}h", *(round(self.limited(v) / 2e-3) for v in volts)))
            for axis, name in enumerate(names):
                quantity, value = points.get(name, ("voltage", 0.0))
                if quantity == "torque":
                    rated = self._rated_nm.get(name, 0.0)
                    count = round(1e3 * value / rated) if rated else 0
                    text += self._write(node, 0x6071 + self.AXIS * axis, 0, 2,
                                        max(-32768, min(32767, count)))
                elif quantity != "voltage":
                    index, size, scale = self.TARGETS[quantity]
                    text += self._write(node, index + self.AXIS * axis, 0, size,
                                        round(value / scale))
        return text + self._send(0x80, b"")

    def take(self, frame: RawFrame) -> None:
        identifier, data = int(frame[1], 16), bytes.fromhex(frame[4])
        node = identifier & 0x7f
        if identifier & 0x780 == 0x180 and node - 0x40 in self._axes:
            for axis in range(min(self._axes[node - 0x40], len(data) // 2)):
                joint = self._at.get((node - 0x40, axis))
                if joint:
                    word = struct.unpack_from("<H", data, 2 * axis)[0]
                    self._words[joint] = word
                    self.extra[joint]["mode"] = "operation enabled" if word & 0x6f == 0x27 else \
                        "fault" if word & 8 else "switched off"
        elif node in self._axes and identifier & 0x780 in (0x180, 0x280, 0x380, 0x480):
            joint = self._at.get((node, (identifier >> 8) - 1))
            if joint and len(data) == 8:
                motor, deflection, torque = struct.unpack("<ihh", data)
                self.extra[joint].update({
                    "motor position": 1e-5 * motor, "position": 1e-5 * (motor - deflection),
                    "torque": 1e-2 * torque})
                self.extra[joint].setdefault("faults", 0)
        elif node in self._axes and identifier & 0x780 == 0x080 and len(data) == 8 and node:
            for axis in range(self._axes[node]):
                joint = self._at.get((node, axis))
                if joint and (data[:2] == b"\0\0" or data[3] == axis):
                    self.extra[joint]["faults"] = struct.unpack_from("<I", data, 4)[0] \
                        if data[:2] != b"\0\0" else 0
        elif node in self._axes and identifier & 0x780 == 0x580 and data[0] & 0xe0 == 0x40:
            index = struct.unpack_from("<H", data, 1)[0]
            joint = self._at.get((node, (index - 0x6076) // self.AXIS))
            if joint and (index - 0x6076) % self.AXIS == 0:
                self._rated_nm[joint] = 1e-3 * struct.unpack_from("<I", data, 4)[0]


def boards_of(bus: Bus, supply_v: float, motor: FocMotor) -> Boards:
    """The boards of a bus, by the protocol that it speaks."""
    from .described import Described
    kinds = {"icub": Icub, "foc": Foc, "cia402": Cia402, "moteus": Moteus}
    if bus.table is None and bus.protocol not in kinds:
        raise BoardError(f"bus {bus.name}: found protocol {bus.protocol}, expected one of "
                         f"{', '.join(kinds)}, or a file's")
    return (kinds[bus.protocol] if bus.table is None else Described)(bus, supply_v, motor)
