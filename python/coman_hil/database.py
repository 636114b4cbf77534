# SPDX-License-Identifier: Apache-2.0
"""What the frames on a rig's buses mean: the DBC files that `coman-hil dbc` writes, made ready to
read and write values quickly. All scales, units and names come from there."""
from __future__ import annotations

import logging
import pathlib
import re
import struct
import subprocess
import tempfile
from dataclasses import dataclass, field
from functools import cached_property
from typing import Iterator, Mapping

from .errors import ProgramNotFound, RigError, SimulatorTimeout, UnknownName

HOST = "host"
TITLE = re.compile(r'^CM_ "Rig (\S+), bus (\S+) on (\S+): protocol ([\w-]+)', re.M)
# what makes a unit one of SI
SI = {"mA": 1e-3, "ms": 1e-3, "deg": 3.141592653589793 / 180}


@dataclass(frozen=True, eq=False)
class Signal:
    """A number in a frame.

    about: the joint, or the force-torque sensor, that it belongs to; "" = none. selector: the
    value of byte 0 with which it is there, None = always. frame_length: bytes of a frame that
    carries it, 0 = as the message's."""

    name: str
    start: int
    bits: int
    little_endian: bool
    signed: bool
    floating: bool
    scale: float
    offset: float
    unit: str
    about: str
    selector: int | None
    frame_length: int
    values: Mapping[int, str]

    @property
    def quantity(self) -> str:
        """The name without the joint that it begins with."""
        joint = re.sub(r"[^A-Za-z0-9]", "_", self.about)
        return re.sub(rf"^_?{joint}_", "", self.name) if joint else self.name

    def decode_raw(self, data: bytes) -> int | None:
        """The count in a frame; None when the frame is too short to have it."""
        size = 8 * len(data)
        if self.start + self.bits > size:
            return None
        if self.little_endian:
            raw = int.from_bytes(data, "little") >> self.start
        else:
            raw = int.from_bytes(data, "big") >> size - self.start - self.bits
        raw &= (1 << self.bits) - 1
        return raw - (1 << self.bits) if self.signed and raw >> self.bits - 1 else raw

    def decode(self, data: bytes) -> float | None:
        """The value in the signal's unit; None when the frame is too short to have it."""
        raw = self.decode_raw(data)
        if raw is None:
            return None
        if self.floating:
            raw = struct.unpack("<f", struct.pack("<I", raw & 0xffffffff))[0]
        return raw * self.scale + self.offset

    @property
    def to_si(self) -> float:
        """What its unit is worth in SI units."""
        return SI.get(self.unit, 1.0)

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The least and the greatest value that fit, in the signal's unit."""
        low = -(1 << self.bits - 1) if self.signed else 0
        ends = [(count * self.scale + self.offset)
                for count in (low, low + (1 << self.bits) - 1)]
        return min(ends), max(ends)

    def encode(self, value: float | str) -> int:
        """The bits for a value in the signal's unit, or for the name of one."""
        if isinstance(value, str):
            for count, name in self.values.items():
                if name == value:
                    return count & (1 << self.bits) - 1
            raise UnknownName(f"value of {self.name}", value, self.values.values())
        if self.floating:
            return int.from_bytes(struct.pack("<f", value), "little")
        low, high = self.limits
        if not low - abs(self.scale) / 2 <= value <= high + abs(self.scale) / 2:
            raise ValueError(f"{self.name}: found {value:g}, expected {low:g} to {high:g}"
                             f"{' ' if self.unit else ''}{self.unit}")
        return round((value - self.offset) / self.scale) & (1 << self.bits) - 1

    def place(self, bits: int, length: int) -> int:
        """The bits where they belong in a frame of this length, as a little-endian number."""
        if self.little_endian:
            return bits << self.start
        big = bits << 8 * length - self.start - self.bits
        return int.from_bytes(big.to_bytes(length, "big"), "little")


@dataclass(eq=False)
class Message:
    """The frames of an identifier. sender: the node, "host" = the controller. extended: the
    identifier has 29 bits; mask: those of its bits that carry values, which are 0 here."""

    bus: str
    name: str
    identifier: int
    length: int
    sender: str
    fd: bool
    signals: dict[str, Signal] = field(default_factory=dict)
    extended: bool = False
    mask: int = 0

    @property
    def word(self) -> str:
        """The identifier as the gateway writes it: 8 digits when it is extended, else 3."""
        return f"{self.identifier:08X}" if self.extended else f"{self.identifier:03X}"

    def has(self, word: str) -> bool:
        """Whether a frame with this identifier is one of the message."""
        return (len(word) == 8) == self.extended and \
            int(word, 16) & ~self.mask == self.identifier

    @property
    def kind(self) -> str:
        """Its name without that of the sender and the number of the axis: POSITION, ..."""
        prefix = self.sender + "_"
        name = self.name[len(prefix):] if self.name.startswith(prefix) else self.name
        return re.sub(r"_\d+$", "", name)

    @property
    def selector(self) -> Signal | None:
        """The signal that says which of the others are there."""
        multiplexed = any(s.selector is not None for s in self.signals.values())
        return self.signals.get("command") if multiplexed or len(self.signals) == 1 else None

    def signal(self, name: str) -> Signal:
        try:
            return self.signals[name]
        except KeyError:
            raise UnknownName(f"signal of {self.name}", name, self.signals) from None

    def encode(self, values: Mapping[str, float | str], length: int | None = None) -> bytes:
        """The data of a frame; a signal that is not given is 0. A message of commands needs
        `command`, whose signals have lengths of their own."""
        chosen = {self.signal(name): value for name, value in values.items()}
        if length is None:
            lengths = [s.frame_length for s in chosen if s.selector is not None]
            if lengths:
                length = max(lengths) or self.length
            else:
                length = 1 if self.selector else self.length
        total = 0
        for signal, value in chosen.items():
            if signal.start + signal.bits > 8 * length:
                raise ValueError(f"{self.name}: {signal.name} is not in the first {length} bytes")
            total |= signal.place(signal.encode(value), length)
        return total.to_bytes(length, "little")

    def decode(self, data: bytes) -> dict[str, float | str]:
        """The values that a frame has, in their units; those that have names by name."""
        selected = self.selector.decode_raw(data) if self.selector else None
        found: dict[str, float | str] = {}
        for signal in self.signals.values():
            if signal.selector is None or signal.selector == selected:
                raw, value = signal.decode_raw(data), signal.decode(data)
                if value is not None:
                    found[signal.name] = signal.values.get(raw, value)
        return found


@dataclass
class Bus:
    """A bus of the rig. boards: what each node is for, as "address 1, motors LShYaw"."""

    name: str
    interface: str
    protocol: str
    messages: dict[str, Message] = field(default_factory=dict)
    by_identifier: dict[int, Message] = field(default_factory=dict)     # of 11 bits
    boards: dict[str, str] = field(default_factory=dict)

    def find(self, identifier: int, extended: bool = False) -> Message | None:
        """The message that a frame is; None: of no message."""
        if not extended:
            return self.by_identifier.get(identifier)
        word = f"{identifier:08X}"
        return next((m for m in self.messages.values() if m.has(word)), None)

    def message(self, name: str) -> Message:
        try:
            return self.messages[name]
        except KeyError:
            raise UnknownName(f"message of bus {self.name}", name, self.messages) from None

    def board_messages(self, board: str) -> Iterator[Message]:
        """What a board sends."""
        return (m for m in self.messages.values() if m.sender == board)


@dataclass
class Database:
    """All buses of a rig by name, in its order."""

    rig: str
    buses: dict[str, Bus]

    def bus(self, name: str) -> Bus:
        try:
            return self.buses[name]
        except KeyError:
            raise UnknownName("bus", name, self.buses) from None


_parsed: dict[str, tuple[str, Bus]] = {}


def _load_canmatrix():
    """canmatrix complains on standard error about every format that it has no library for."""
    log = logging.getLogger("canmatrix")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        import canmatrix.formats
        return canmatrix.formats
    finally:
        log.setLevel(level)


def _signal_of(signal) -> Signal:
    selector = signal.mux_val
    return Signal(
        name=signal.name, start=signal.start_bit, bits=signal.size,
        little_endian=signal.is_little_endian, signed=signal.is_signed and not signal.is_float,
        floating=signal.is_float, scale=float(signal.factor), offset=float(signal.offset),
        unit=signal.unit or "", about=signal.comment or "",
        selector=None if selector is None else int(selector),
        frame_length=int(signal.attributes.get("FrameLength", 0)),
        values={int(value): str(name) for value, name in signal.values.items()})


def parse_bus(text: str) -> tuple[str, Bus]:
    """The rig's name, and the bus that a file of `coman-hil dbc` describes."""
    if text in _parsed:
        return _parsed[text]
    title = TITLE.search(text)
    if not title:
        raise ValueError("found no line 'CM_ \"Rig ...', expected a file of coman-hil dbc")
    matrix = _load_canmatrix().loads_flat(text.encode(), "dbc", dbcImportEncoding="utf-8",
                                          dbcImportCommentEncoding="utf-8")
    rig, name, interface, protocol = title.groups()
    bus = Bus(name, interface, protocol)
    for node in matrix.ecus:
        bus.boards[node.name] = node.comment or ""
    for frame in matrix.frames:
        message = Message(name, frame.name, frame.arbitration_id.id, frame.size,
                          frame.transmitters[0], frame.is_fd,
                          extended=bool(frame.arbitration_id.extended),
                          mask=int(frame.attributes.get("IdentifierMask", 0)))
        message.signals = {s.name: _signal_of(s) for s in frame.signals}
        bus.messages[message.name] = message
        if not message.extended:
            bus.by_identifier[message.identifier] = message
    _parsed[text] = rig, bus
    return rig, bus


def load(program: str, rig: str, timeout_s: float = 60.0) -> Database:
    """The messages of a rig, as the program writes them. Raises RigError for a rig that the
    program refuses."""
    with tempfile.TemporaryDirectory(prefix="coman-hil-") as folder:
        try:
            done = subprocess.run([program, "dbc", rig, "-o", folder], stdin=subprocess.DEVNULL,
                                  capture_output=True, text=True, timeout=timeout_s)
        except OSError as error:
            raise ProgramNotFound(f"cannot start {program}: {error.strerror}") from None
        except subprocess.TimeoutExpired:
            raise SimulatorTimeout(f"{program} dbc {rig} still runs after {timeout_s:g} s") \
                from None
        if done.returncode:
            raise RigError(done.stderr.strip() or f"{program} dbc {rig} ended with status "
                           f"{done.returncode}")
        # the order of its lines is that of the rig
        order = [line.split()[0] for line in done.stdout.splitlines() if line.split()]
        parsed = []
        for path in pathlib.Path(folder).glob("*.dbc"):
            parsed.append(parse_bus(path.read_text()))
    buses = sorted((bus for _, bus in parsed),
                   key=lambda bus: order.index(bus.name) if bus.name in order else len(order))
    return Database(parsed[0][0], {bus.name: bus for bus in buses})
