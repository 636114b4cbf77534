# SPDX-License-Identifier: Apache-2.0
"""The boards of a bus as the client table of the run describes them (rig/client_table.h): how they
are made to report, to switch their motors on and to take set points, and what they report. No
protocol is known here."""
from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping, Sequence

from .gateway import RawFrame

# a set point: "voltage" (V), "current" (A), "torque" (N m), "velocity" (rad/s), "position" (rad)
Point = tuple
ID_BYTE = 64                    # place of the identifier behind the data
SIZE = ID_BYTE + 4
WORDS = {"rig": 2, "joint": 3, "sensor": 3, "bus": 7, "name": 3, "frame": 8, "setup": 3, "cycle": 3,
         "switch": 7, "set": 10, "ask": 4, "report": 7, "value": 7}


def checksum(kind: int, data: bytes, skip: int) -> int:
    """The exclusive or (1), or CRC-8 SAE J1850 (2), of all bytes but one."""
    total = 0xff if kind == 2 else 0
    for at, byte in enumerate(data):
        if at == skip:
            continue
        total ^= byte
        for _ in range(8 if kind == 2 else 0):
            total = (total << 1 ^ (0x1d if total & 0x80 else 0)) & 0xff
    return total ^ 0xff if kind == 2 else total


class Field:
    """A number in a frame, START|BITS@ORDER: value = count * scale + offset."""

    def __init__(self, text: str, scale: str = "1", offset: str = "0") -> None:
        start, rest = text.split("|")
        self.bits, order = int(rest[:-3]), rest[-2:]
        self.little, self.signed, self.floating = order[0] == "1", order[1] == "-", order[1] == "f"
        self.scale, self.offset = float(scale), float(offset)
        first = int(start)
        self.shift = first if self.little else 8 * SIZE - (first ^ 7) - self.bits
        end = (first + self.bits + 7) // 8 if self.little else ((first ^ 7) + self.bits + 7) // 8
        self.end = end if first < 8 * ID_BYTE else 0    # the bytes of a frame that has it
        self.mask = self.place((1 << self.bits) - 1)

    def place(self, bits: int) -> int:
        """The bits where they belong in an image, which is little-endian."""
        placed = bits << self.shift
        return placed if self.little else int.from_bytes(placed.to_bytes(SIZE, "big"), "little")

    def count(self, image: bytes) -> int:
        whole = int.from_bytes(image, "little" if self.little else "big")
        raw = whole >> self.shift & (1 << self.bits) - 1
        return raw - (1 << self.bits) if self.signed and raw >> self.bits - 1 else raw

    def value(self, image: bytes) -> float:
        raw = self.count(image)
        if self.floating:
            raw = struct.unpack("<f", struct.pack("<I", raw))[0]
        return raw * self.scale + self.offset

    def encode(self, value: float) -> int:
        """The bits for a value, which is limited to what fits."""
        scaled = (value - self.offset) / self.scale
        if self.floating:
            return struct.unpack("<I", struct.pack("<f", scaled))[0]
        low = -(1 << self.bits - 1) if self.signed else 0
        high = low + (1 << self.bits) - 1
        return round(max(low, min(high, scaled))) & (1 << self.bits) - 1


@dataclass(eq=False)
class Frame:
    """A frame from the host. image: its data and its identifier."""

    word: str
    kind: str
    length: int
    image: int
    checksum: int
    checksum_byte: int
    counter: int
    count_field: Field
    number: int = 0
    head: tuple[int, str] = (-1, "")    # what its command begins with, for an identifier

    def put(self, where: Field, bits: int) -> None:
        self.image = self.image & ~where.mask | where.place(bits)


@dataclass(eq=False)
class Report:
    """A frame from a board. image: the last one; length: of its data; number: of its arrival, 0 =
    none has come."""

    identifier: int
    extended: bool
    shortest: int
    id_mask: int
    mask: int
    value: int
    image: bytes = b""
    length: int = 0
    number: int = 0


@dataclass
class Row:
    """A row about a frame of a joint."""

    joint: str
    quantity: str
    frame: Frame
    stage: int = 0
    field: Field | None = None
    count: int = 0
    low: float = 0.0
    high: float = 0.0
    mode: str = ""
    bits: int | None = None     # of the last set point; None = 0


@dataclass
class Boards:
    """The boards of a bus.

    joints: of the bus, in the order of the rig. refresh_ticks: how often set-points are wanted,
    None = it is the user's choice. cyclic: set_points is called in every step, also without a motor
    that is on."""

    bus: str
    protocol: str
    refresh_ticks: int | None
    joints: list[str]
    names: dict[int, str] = field(default_factory=dict)
    frames: list[Frame] = field(default_factory=list)
    reports: list[Report] = field(default_factory=list)
    setups: list[Row] = field(default_factory=list)
    cycles: list[Row] = field(default_factory=list)
    switches: list[Row] = field(default_factory=list)
    sets: list[Row] = field(default_factory=list)
    asks: list[Row] = field(default_factory=list)
    counters: dict[int, int] = field(default_factory=dict)
    exact: dict[str, list[Report]] = field(default_factory=dict)
    masked: list[Report] = field(default_factory=list)
    listening: bool = False
    arrived: int = 0

    @property
    def cyclic(self) -> bool:
        return bool(self.cycles)

    def quantities(self, joint: str) -> tuple[str, ...]:
        """What the motor of a joint can be commanded with, the usual one first."""
        return tuple(dict.fromkeys(row.quantity for row in self.sets if row.joint == joint))

    def on_word(self, joint: str, quantity: str) -> str | None:
        """The boards' word for a motor that takes such set points."""
        return next((row.mode for row in self.sets
                     if (row.joint, row.quantity) == (joint, quantity)), None)

    # ---- what is sent ----

    def _close(self, frame: Frame, image: int, given: int = 0) -> bytes:
        """The data with counter and checksum, except bits that are given."""
        if frame.counter >= 0 and not given & frame.count_field.mask:
            count = self.counters.get(frame.counter, 0)
            self.counters[frame.counter] = count + 1
            where = frame.count_field
            image = image & ~where.mask | where.place(count & (1 << where.bits) - 1)
        data = bytearray(image.to_bytes(SIZE, "little")[:frame.length])
        if frame.checksum and not given >> 8 * frame.checksum_byte & 0xff:
            data[frame.checksum_byte] = checksum(frame.checksum, data, frame.checksum_byte)
        return bytes(data)

    def _text(self, frame: Frame) -> str:
        identifier = frame.image >> 8 * ID_BYTE
        if frame.head[0] != identifier:
            word = {"c": "send", "f": "fdsend", "r": "sendrtr"}[frame.kind]
            flags = " 1" if frame.kind == "f" else ""
            frame.head = (identifier, f"< {word} {identifier:0{len(frame.word)}X}{flags} "
                                      f"{frame.length} ")
        if not frame.length:
            return f"{frame.head[1]}{self.bus} >"
        return f"{frame.head[1]}{self._close(frame, frame.image).hex(' ')} {self.bus} >"

    def _texts(self, rows: Iterable[Row]) -> list[list[str]]:
        """The frames of rows, by stage."""
        stages: list[list[str]] = []
        for row in rows:
            stages += [[] for _ in range(row.stage + 1 - len(stages))]
            if row.field:
                row.frame.put(row.field, row.count & (1 << row.field.bits) - 1)
            stages[row.stage].append(self._text(row.frame))
        return stages

    def reporting(self) -> list[list[str]]:
        """What makes every board report, in stages with some ticks between them."""
        self.listening = True
        return self._texts(self.setups)

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[list[str]]:
        """Switches motors for a kind of set point, None: off, in stages."""
        # the image of a frame that motors share has to be right for each of its stages
        chosen = sorted((row for row in self.switches if row.joint in joints and
                         row.quantity == (quantity or "off")), key=lambda row: row.stage)
        return self._texts(chosen)

    def questions(self, joints: Sequence[str], quantity: str) -> list[str]:
        """Asks boards for the gains of a loop."""
        return [self._text(row.frame) for row in self.asks
                if row.joint in joints and row.quantity == quantity]

    def set_points(self, points: Mapping[str, Point]) -> str:
        """Set points of the joints whose motors are on, and what is sent in every step."""
        pending: dict[int, Frame] = {}
        active = []
        for row in self.sets:       # 0 for motors that are off, in frames that they share
            point = points.get(row.joint)
            if point and point[0] == row.quantity:
                active.append((row, point[1]))
            elif row.bits is not None:
                row.frame.put(row.field, row.field.encode(0.0))
                row.bits = None
        for row, value in active:
            row.bits = row.field.encode(max(row.low, min(row.high, value)))
            row.frame.put(row.field, row.bits)
            pending[row.frame.number] = row.frame
        text = "".join(self._text(pending[number]) for number in sorted(pending))
        if self.listening:
            text += "".join(self._text(row.frame) for row in self.cycles
                            if row.joint not in points)
        return text

    def close(self, word: str, data: bytes, given: int) -> bytes:
        """The data of a message with the constants, the counter and the checksum of its frame,
        except the given bits."""
        for frame in self.frames:
            if (frame.word, frame.length) == (word, len(data)) and \
                    (frame.checksum or frame.counter >= 0):
                blank = frame.image & (1 << 8 * frame.length) - 1
                return self._close(frame, blank & ~given | int.from_bytes(data, "little"), given)
        return data

    # ---- what arrives ----

    def take(self, frame: RawFrame) -> None:
        """Keeps a frame for the reports that it is."""
        word, text = frame[1], frame[4]
        image = None
        for report in self.exact.get(word, self.masked):
            if image is None:
                length = len(text) // 2
                image = bytes.fromhex(text).ljust(ID_BYTE, b"\0") + \
                    int(word, 16).to_bytes(4, "little")
            if report.id_mask != 0x1fffffff and (
                    report.extended != (len(word) == 8) or
                    int(word, 16) & report.id_mask != report.identifier):
                continue
            if length >= report.shortest and (
                    not report.mask or
                    int.from_bytes(image[:ID_BYTE], "little") & report.mask == report.value):
                self.arrived += 1
                report.image, report.length, report.number = image, length, self.arrived

    def keep(self) -> tuple:
        """The state for a checkpoint."""
        return ([(r.image, r.length, r.number) for r in self.reports],
                [frame.image for frame in self.frames], dict(self.counters), self.listening,
                [row.bits for row in self.sets])

    def restore(self, kept: tuple) -> None:
        for report, seen in zip(self.reports, kept[0]):
            report.image, report.length, report.number = seen
        for frame, image in zip(self.frames, kept[1]):
            frame.image = image
        self.counters, self.listening = dict(kept[2]), kept[3]
        for row, bits in zip(self.sets, kept[4]):
            row.bits = bits


@dataclass
class Value:
    """A value that a board reports."""

    boards: Boards
    report: Report
    field: Field

    @property
    def told(self) -> bool:
        return self.report.number > 0 and self.report.length >= self.field.end

    def read(self) -> float:
        return self.field.value(self.report.image)

    def count(self) -> int:
        return self.field.count(self.report.image)


@dataclass
class Table:
    """The client table. joints, sensors: the bus of each. values: by name and quantity."""

    joints: dict[str, str] = field(default_factory=dict)
    sensors: dict[str, str] = field(default_factory=dict)
    boards: list[Boards] = field(default_factory=list)
    values: dict[tuple[str, str], list[Value]] = field(default_factory=dict)
    step: tuple[str, int] | None = None

    def newest(self, name: str, quantity: str) -> Value | None:
        """The value that has come last; None = none has come."""
        told = [value for value in self.values.get((name, quantity), ()) if value.told]
        return max(told, key=lambda value: value.report.number, default=None)

    def read(self, name: str, quantity: str) -> float | None:
        value = self.newest(name, quantity)
        return None if value is None else value.read()

    def position(self, name: str) -> float | None:
        """The angle of a link: reported, or from its deflection, or within a turn of the motor."""
        motor = self.read(name, "motor_position")
        deflection, link = self.read(name, "deflection"), self.read(name, "position_in_turn")
        if motor is not None and deflection is not None:
            return motor - deflection
        if motor is not None and link is not None:
            return link + 2 * math.pi * round((motor - link) / (2 * math.pi))
        return self.read(name, "position")


def _frame_of(word: list[str], number: int) -> Frame:
    data = b"" if word[3] == "-" else bytes.fromhex(word[3])
    image = data.ljust(ID_BYTE, b"\0") + int(word[1], 16).to_bytes(4, "little")
    return Frame(word[1], word[2], len(data), int.from_bytes(image, "little"), int(word[4]),
                 int(word[5]), int(word[6]), Field(word[7]), number)


def _report_of(word: list[str]) -> Report:
    mask, value = (0 if text == "-" else int.from_bytes(bytes.fromhex(text), "little")
                   for text in word[5:7])
    return Report(int(word[1], 16), len(word[1]) == 8, int(word[3]), int(word[4], 16), mask, value)


def _add_row(table: Table, boards: Boards, word: list[str]) -> None:
    """A row about a bus."""
    kind = word[0]
    if kind == "name":
        boards.names.setdefault(int(word[1]), word[2])
    elif kind == "frame":
        boards.frames.append(_frame_of(word, len(boards.frames)))
    elif kind == "report":
        report = _report_of(word)
        boards.reports.append(report)
        if report.id_mask == 0x1fffffff:
            boards.exact.setdefault(word[1], []).append(report)
        else:
            boards.masked.append(report)
    elif kind == "setup":
        boards.setups.append(Row("", "", boards.frames[int(word[2])], int(word[1])))
    elif kind == "cycle":
        boards.cycles.append(Row(word[2], "", boards.frames[int(word[1])]))
    elif kind == "switch":
        boards.switches.append(Row(word[1], word[2], boards.frames[int(word[4])], int(word[3]),
                                   Field(word[5]), int(word[6])))
    elif kind == "set":
        boards.sets.append(Row(word[1], word[2], boards.frames[int(word[3])],
                               field=Field(*word[4:7]), low=float(word[7]), high=float(word[8]),
                               mode=word[9]))
    elif kind == "ask":
        boards.asks.append(Row(word[1], word[2], boards.frames[int(word[3])]))
    elif kind == "value":
        value = Value(boards, boards.reports[int(word[3])], Field(*word[4:7]))
        table.values.setdefault((word[1], word[2]), []).append(value)


def read_table(rows: Iterable[str]) -> Table:
    """The client table from its rows; rows of unknown kinds are skipped."""
    table = Table()
    for row in rows:
        kind = row.split(" ", 1)[0]
        if kind not in WORDS:
            continue
        word = row.split(" ", WORDS[kind] - 1)
        if kind == "joint":
            table.joints[word[1]] = word[2]
        elif kind == "sensor":
            table.sensors[word[1]] = word[2]
        elif kind == "bus":
            table.boards.append(Boards(word[1], word[3], 1 if word[6] == "1" else None,
                                       [n for n, bus in table.joints.items() if bus == word[1]]))
        elif kind != "rig":
            _add_row(table, table.boards[-1], word)
    return table
