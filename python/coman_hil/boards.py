# SPDX-License-Identifier: Apache-2.0
"""The controller's side of the boards' protocols, a class each: how boards are made to report, to
switch their motors on and to take voltages. What a count is worth stands in the DBC (database.py);
here stands which messages to send, and in which order."""
from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Mapping, Sequence

from .database import HOST, Bus, Message, Signal
from .errors import BoardError

PROTOCOL_OF_HOSTS = (1, 6)      # of iCub: what hosts say that they speak
GROUP = 4                       # compact: ALL_COMMAND_n begins with the motor of slot 4 n
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

    joints: of the bus, in the order of the rig. on, off: the words for a motor that takes voltages
    and for one that is switched off. refresh_ticks: how often set-points are wanted, None = it is
    the user's choice."""

    on, off = "voltage", "off"
    refresh_ticks: int | None = None

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        self.bus, self.supply_v, self.motor = bus, supply_v, motor
        self.board_of = {joint: board for board in bus.boards for joint in axes_of(bus, board)}
        self.joints = list(self.board_of)

    def text(self, message: str, length: int | None = None, **values: float | str) -> str:
        found = self.bus.message(message)
        return frame_text(found, found.encode(values, length))

    def commanded(self, message: str, quantity: str) -> dict[str, Signal]:
        """Signals of a message to the boards whose quantity begins so, by joint."""
        found = self.bus.messages.get(message)
        return {} if not found else {s.about: s for s in found.signals.values()
                                     if s.quantity.startswith(quantity) and s.about}

    def reporting(self) -> list[list[str]]:
        """What makes every board report, in stages with some ticks between them."""
        raise NotImplementedError

    def switch(self, joints: Sequence[str], on: bool) -> list[str]:
        """Switches motors."""
        raise NotImplementedError

    def set_points(self, volts: Mapping[str, float]) -> str:
        """Voltages (V) of the joints of this bus whose motors are on."""
        raise NotImplementedError

    def limited(self, volts: float) -> float:
        """What a bridge can do of it."""
        return max(-self.supply_v, min(self.supply_v, volts))


class Compact(Boards):
    """protocols/compact.yaml: a frame sets all motors of a group, one tells their voltages."""

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._groups = []
        self._slot = {}
        for name in bus.messages:
            if name.startswith("ALL_COMMAND_"):
                points = self.commanded(name, "set_point")
                self._groups.append((bus.messages[name], points))
                for joint, signal in points.items():
                    first = GROUP * int(name.removeprefix("ALL_COMMAND_"))
                    self._slot[joint] = first + signal.start // signal.bits

    def reporting(self) -> list[list[str]]:
        return [[self.text(m.name, parameter="telemetry_period", write=1, value=1e-3)
                 for m in self.bus.messages.values()
                 if m.sender == HOST and m.name.endswith("_REQUEST")]]

    def switch(self, joints: Sequence[str], on: bool) -> list[str]:
        slots = sum(1 << self._slot[joint] for joint in joints)
        return [self.text("ALL_MODE", mode=self.on if on else self.off, slots=slots)]

    def set_points(self, volts: Mapping[str, float]) -> str:
        text = ""
        for message, points in self._groups:
            total = 0
            for joint, signal in points.items():
                if joint in volts:
                    low, high = signal.limits
                    value = max(low, min(high, self.limited(volts[joint])))
                    total |= signal.place(signal.encode(value), message.length)
            text += frame_text(message, total.to_bytes(message.length, "little"))
        return text


class _Icub(Boards):
    """What both kinds of iCub boards have in common: modes, sensors."""

    on, off = "open_loop", "force_idle"
    axis_suffix = False

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

    def switch(self, joints: Sequence[str], on: bool) -> list[str]:
        texts = []
        for joint in joints:
            message, suffix = self._axis(joint)
            texts.append(self.text(message, **{
                "command": "SET_CONTROL_MODE" + suffix,
                "SET_CONTROL_MODE_mode" + suffix: self.on if on else self.off}))
        return texts

    def _percent(self, volts: float) -> float:
        return 100.0 * self.limited(volts) / self.supply_v if self.supply_v > 0 else 0.0


class Icub(_Icub):
    """boards/icub/protocol.h: two axes a board, telemetry every 4 ms."""

    REPORTS = ("POSITION", "STATUS", "CURRENT", "MOTOR_POSITION")

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self._open_loop = {joint: self._open_loop_of(*self._axis(joint)) for joint in self.joints}

    def _open_loop_of(self, name: str, suffix: str) -> tuple[Message, Signal, int, int]:
        """The command of an axis: its message, the signal of the voltage, the length of the frame,
        and the frame without a voltage."""
        message = self.bus.message(name)
        signal = message.signal("SET_OPEN_LOOP_pwm" + suffix)
        frame = message.encode({"command": "SET_OPEN_LOOP" + suffix, signal.name: 0.0})
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

    def set_points(self, volts: Mapping[str, float]) -> str:
        texts = []
        for joint, (message, pwm, length, frame) in self._open_loop.items():
            if joint in volts:
                bits = pwm.place(pwm.encode(self._percent(volts[joint])), length)
                texts.append(frame_text(message, (frame | bits).to_bytes(length, "little")))
        return "".join(texts)


class Foc(_Icub):
    """boards/foc/protocol.h: one axis a board; every set-point is answered."""

    refresh_ticks = 1

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

    def set_points(self, volts: Mapping[str, float]) -> str:
        if not any(joint in volts for joint in self._targets):
            return ""
        message, total = self.bus.message("ALL_DESIRED_TARGETS"), 0
        for joint, target in self._targets.items():
            # what a target counts depends on the mode; in this one it is STATUS's count of PWM
            pwm = self.commanded(f"{self.board_of[joint]}_STATUS", "pwm")[joint]
            total |= target.place(pwm.encode(self._percent(volts.get(joint, 0.0))), message.length)
        return frame_text(message, total.to_bytes(message.length, "little"))


def boards_of(bus: Bus, supply_v: float, motor: FocMotor) -> Boards:
    """The boards of a bus, by the protocol that it speaks."""
    kinds = {"icub": Icub, "foc": Foc, "compact": Compact}
    if bus.protocol not in kinds:
        raise BoardError(f"bus {bus.name}: found protocol {bus.protocol}, expected one of "
                         f"{', '.join(kinds)}")
    return kinds[bus.protocol](bus, supply_v, motor)
