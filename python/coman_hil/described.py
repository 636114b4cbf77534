# SPDX-License-Identifier: Apache-2.0
"""The controller's side of protocols that a file describes, by the table that `coman-hil dbc`
writes beside the DBC: frames with fields, the meaning of each field, and which frames discover,
configure, switch and command."""
from __future__ import annotations

import struct
from typing import Any, Mapping, Sequence

from .boards import Boards, FocMotor
from .database import Bus
from .gateway import RawFrame

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
QUANTITIES = ("voltage", "current", "torque", "velocity", "position")
# what an impedance law is commanded with, of its own stiffness and damping
IMPEDANCE = {"position": ("kp", "kd"), "velocity": ("kd",), "torque": ()}
MEASURED = {"motor_position": "motor position", "link_position": "position",
            "deflection": "deflection", "motor_velocity": "motor velocity", "current": "current",
            "torque": "torque", "drive_torque": "drive torque", "faults": "faults"}
MOTOR = 1                       # kind of a board


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


def put(field: Mapping[str, Any], count: int, after: int, data: bytearray) -> int:
    """Writes a count, clamped to the field; returns its bits of the identifier."""
    bits = max(field["low"], min(field["high"], count)) & field["mask"]
    if field["in_id"]:
        return bits << field["shift"]
    first, order = field["byte"] + after, "big" if field["big"] else "little"
    window = int.from_bytes(data[first:first + 8], order) | bits << field["shift"]
    data[first:first + 8] = window.to_bytes(8, order)
    return 0


def get(field: Mapping[str, Any], identifier: int, data: bytes, after: int) -> int:
    """Reads the count of a field."""
    if field["in_id"]:
        bits = identifier >> field["shift"]
    else:
        first = field["byte"] + after
        bits = int.from_bytes(data[first:first + 8].ljust(8, b"\0"),
                              "big" if field["big"] else "little") >> field["shift"]
    return ((bits & field["mask"]) ^ field["sign"]) - field["sign"]


def count_of(field: Mapping[str, Any], value: float) -> int:
    """The count for a value in SI units; of a float its bits."""
    scaled = (value - field["offset"]) / field["scale"]
    return struct.unpack("<I", struct.pack("<f", scaled))[0] if field["real"] else round(scaled)


def value_of(field: Mapping[str, Any], count: int) -> float:
    if field["real"]:
        count = struct.unpack("<f", struct.pack("<I", count & 0xffffffff))[0]
    return count * field["scale"] + field["offset"]


def of_model(field: Mapping[str, Any], model: int) -> Mapping[str, Any]:
    """A field with the scale of a drive's model."""
    if "models" not in field:
        return field
    scale, offset = field["models"][model]
    return {**field, "scale": scale, "offset": offset}


class Described(Boards):
    """The boards of a described protocol."""

    def __init__(self, bus: Bus, supply_v: float, motor: FocMotor) -> None:
        super().__init__(bus, supply_v, motor)
        self.table = bus.table
        self.frames = self.table["frames"]
        self.models = {board["address"]: board["model"] for board in self.table["boards"]}
        # by slot: address, axis, joint
        self.slots = [(board["address"], axis, joint) for board in self.table["boards"]
                      for axis, joint in enumerate(board["joints"])]
        self.slot_of = {joint: slot for slot, (_, _, joint) in enumerate(self.slots) if joint}
        self._counters: dict[tuple, int] = {}
        self._on = {}           # by quantity: the state that takes it, and the law to select
        states, laws = self.table["states"], self.table["laws"]
        told = self._has("on", "state")
        for number, state in enumerate(states):
            if number != self.table["on_state"] and not told:
                continue
            choices = [state] if state["law"] != "selected" else laws
            for law in choices:
                for quantity in IMPEDANCE if law["law"] == "impedance" else (law["law"],):
                    if quantity in QUANTITIES and self._commands(quantity):
                        self._on.setdefault(quantity, (state, law))
        self._tells_torque = any(f["meaning"] == "torque" for frame in self.frames
                                 if not frame["host"] for f in frame["fields"])
        self._tells_state = any(f["meaning"] == "state" for frame in self.frames
                                if not frame["host"] for f in frame["fields"])
        self._shares_ids = any(f["meaning"] == "address" for frame in self.frames
                               if not frame["host"] and frame["by"] == "none"
                               for f in frame["fields"])
        self._switched: dict[str, str] = {}     # where no frame tells the state
        preferred = states[self.table["on_state"]]["law"]
        self.quantities = tuple(sorted(self._on, key=lambda q: (q != preferred,
                                                                QUANTITIES.index(q))))

    def _has(self, key: str, meaning: str) -> bool:
        return any(f["meaning"] == meaning for i in self.table[key]
                   for f in self.frames[i]["fields"])

    def _commands(self, quantity: str) -> list[int]:
        """The frames that carry a set point: those of the file's host, else others."""
        wanted = {quantity, "set_point"}
        chosen = [[i for i in indices if self.frames[i]["host"] and
                   wanted & {f["meaning"] for f in self.frames[i]["fields"]}]
                  for indices in (self.table["command"], range(len(self.frames)))]
        return chosen[0] or chosen[1][:1]

    def on_word(self, quantity: str) -> str:
        return self._on[quantity][0]["name"]

    # ---- what is sent ----

    def _count(self, index: int, field: Mapping[str, Any], number: int, known: Mapping[str, Any],
               point: tuple[str, float] | None, state: Mapping[str, Any]) -> int:
        """The count of a field. known: counts by meaning; point: quantity and value of the axis."""
        meaning = field["meaning"]
        field = of_model(field, self.models.get(known.get("address"), 0))
        if meaning == "constant":
            return field["constant"]
        if meaning == "counter":
            key = index, number
            self._counters[key] = self._counters.get(key, -1) + 1
            return self._counters[key] & field["mask"]
        if meaning in known:
            return known[meaning]
        if meaning == "state":
            return state["value"]
        if meaning == "telemetry_period":
            return count_of(field, 1e-3)
        if meaning == "law" and point:
            return self._on[point[0]][1]["value"]
        if meaning == "set_point":
            return round(point[1] / state["scale"]) if point else 0
        if point and meaning == point[0]:
            return count_of(field, point[1])
        if point and meaning in ("kp", "kd") and meaning not in IMPEDANCE.get(point[0], ()):
            return count_of(field, 0.0)
        if meaning in QUANTITIES:
            return count_of(field, 0.0)
        return count_of(field, field["host"])

    def _text(self, index: int, number: int, parts: Sequence[tuple], state: Mapping[str, Any],
              node: Sequence[tuple[str, float] | None] = ()) -> str:
        """A frame. parts: what is known of each repetition, with its set point; node: set points of
        the board's axes, in a frame for a whole board."""
        frame, data = self.frames[index], bytearray(72)
        identifier = frame["id"] + frame["step"] * number
        if frame["remote"]:
            return self._line("sendrtr", frame, identifier, "0")
        for part, (known, point) in enumerate(parts):
            for field in frame["fields"]:
                of = node[field["axis"]] if field["axis"] < len(node) else point
                identifier |= put(field, self._count(index, field, number, known, of, state),
                                  part * frame["length"], data)
        length = frame["length"] * len(parts)
        if frame["fd"]:
            length = next(n for n in FD_LENGTHS if n >= length)
        return self._line("fdsend" if frame["fd"] else "send", frame, identifier,
                          ("1 " if frame["fd"] else "") + str(length),
                          self._closed(frame, data[:length]))

    @staticmethod
    def _closed(frame: Mapping[str, Any], data: bytearray) -> bytes:
        """The data with its checksum."""
        if frame["checksum"] and len(data) >= frame["length"]:
            data[frame["checksum_byte"]] = checksum(
                frame["checksum"], data[:frame["length"]], frame["checksum_byte"])
        return bytes(data)

    def _line(self, word: str, frame: Mapping[str, Any], identifier: int, middle: str,
              data: bytes = b"") -> str:
        number = f"{identifier:08X}" if frame["extended"] else f"{identifier:03X}"
        words = "<", word, number, middle, data.hex(" "), self.bus.name, ">"
        return " ".join(filter(None, words))

    def close(self, name: str, data: bytes, given: Sequence[str]) -> bytes:
        """A message of the DBC with the counter and the checksum that its frame has, but for fields
        that are given."""
        message = self.bus.messages[name]
        for index, frame in enumerate(self.frames):
            number, rest = divmod(message.identifier - frame["id"], frame["step"] or 1)
            if not frame["host"] or rest or not 0 <= number <= frame["most"] or \
                    frame["extended"] != message.extended or len(data) != frame["length"]:
                continue
            names = {field["name"] for field in frame["fields"]}
            if not set(given) <= names:
                continue
            whole = bytearray(data.ljust(72, b"\0"))
            for field in frame["fields"]:
                if field["name"] in given or field["in_id"]:
                    continue
                if field["meaning"] == "constant":
                    put(field, field["constant"], 0, whole)
                elif field["meaning"] == "counter":
                    put(field, self._count(index, field, number, {}, None, {}), 0, whole)
            if any(f["meaning"] == "checksum" and f["name"] in given for f in frame["fields"]):
                return bytes(whole[:len(data)])
            return self._closed(frame, whole[:len(data)])
        return data

    def _off_state(self) -> Mapping[str, Any]:
        return self.table["states"][self.table["off_state"]]

    def _to_boards(self, index: int, always: bool) -> list[str]:
        """A frame for each board of its kinds; one for all when nothing tells them apart."""
        frame, texts = self.frames[index], []
        single = frame["by"] == "none" and not any(f["meaning"] == "address"
                                                   for f in frame["fields"])
        for board in self.table["boards"]:
            if board["of"] & frame["of"]:
                number = board["address"] if always or frame["by"] == "address" else 0
                known = {"address": board["address"], "axis": 0, "slots": 0}
                texts.append(self._text(index, number, [(known, None)], self._off_state()))
                if single and not always:
                    break
        return texts

    def reporting(self) -> list[list[str]]:
        # a question makes boards answer that do not report by themselves once they are configured
        if not self.table["configure"]:
            return [[text for i in self.table["discover"] for text in self._to_boards(i, False)]]
        return [[text for i in self.table["configure"] for text in self._to_boards(i, True)]]

    def _to_axis(self, index: int, slot: int, point: tuple[str, float] | None,
                 state: Mapping[str, Any], points: Mapping[str, tuple[str, float]]) -> str:
        """A frame for one axis, or for its board, which gets it with its first axis."""
        frame = self.frames[index]
        address, axis, _ = self.slots[slot]
        if not frame["of_one"] and axis:
            return ""
        node = [] if frame["of_one"] else [
            points.get(joint) for at, _, joint in self.slots if at == address]
        number = address if frame["by"] == "address" else slot if frame["by"] == "slot" else 0
        known = {"address": address, "axis": axis, "slots": 1 << slot}
        return self._text(index, number, [(known, point)], state, node)

    def switch(self, joints: Sequence[str], quantity: str | None) -> list[str]:
        texts = []
        state = self._on[quantity][0] if quantity else self._off_state()
        self._switched.update(dict.fromkeys(joints, state["name"]))
        for index in self.table["on" if quantity else "off"]:
            point = (quantity, 0.0) if quantity else None
            if any(f["meaning"] == "slots" for f in self.frames[index]["fields"]):
                known = {"slots": sum(1 << self.slot_of[joint] for joint in joints),
                         "address": 0, "axis": 0}
                texts.append(self._text(index, 0, [(known, point)], state))
            else:
                texts += [self._to_axis(index, self.slot_of[joint], point, state, {})
                          for joint in joints]
        return texts

    def set_points(self, points: Mapping[str, tuple[str, float]]) -> str:
        points = {joint: (quantity, self.limited(value) if quantity == "voltage" else value)
                  for joint, (quantity, value) in points.items() if joint in self.slot_of}
        text = ""
        for quantity in dict.fromkeys(quantity for quantity, _ in points.values()):
            state = self._on[quantity][0]
            mine = {joint: point for joint, point in points.items() if point[0] == quantity}
            for index in self._commands(quantity):
                frame = self.frames[index]
                if frame["by"] != "group":
                    text += "".join(self._to_axis(index, self.slot_of[joint], point, state, mine)
                                    for joint, point in mine.items())
                    continue
                for first in range(0, len(self.slots), frame["repeats"]):
                    group = self.slots[first:first + frame["repeats"]]
                    # a group is one frame, for axes of any state
                    if any(joint in mine for _, _, joint in group):
                        parts = [({}, points.get(joint)) for _, _, joint in group]
                        text += self._text_of_group(index, first // frame["repeats"], parts)
        return text

    def _text_of_group(self, index: int, number: int, parts: Sequence[tuple]) -> str:
        frame, data = self.frames[index], bytearray(72)
        for part, (known, point) in enumerate(parts):
            state = self._on[point[0]][0] if point else self._off_state()
            for field in frame["fields"]:
                put(field, self._count(index, field, number, known, point, state),
                    part * frame["length"], data)
        length = frame["length"] * len(parts)
        if frame["fd"]:
            length = next(n for n in FD_LENGTHS if n >= length)
        return self._line("fdsend" if frame["fd"] else "send", frame,
                          frame["id"] + frame["step"] * number,
                          ("1 " if frame["fd"] else "") + str(length),
                          self._closed(frame, data[:length]))

    # ---- what arrives ----

    @property
    def extra(self) -> dict[str, dict[str, Any]]:
        pending, self._pending = self._pending, {}
        for frame in pending.values():
            self._take(frame)
        return self._extra

    @extra.setter
    def extra(self, extra: dict[str, dict[str, Any]]) -> None:
        self._extra, self._pending = extra, {}

    def take(self, frame: RawFrame) -> None:
        # the last of each identifier, or of each drive that writes its number into the first byte;
        # read when it is asked for
        self._pending[frame[1], frame[4][:2] if self._shares_ids else ""] = frame

    def _take(self, frame: RawFrame) -> None:
        identifier, extended = int(frame[1], 16), len(frame[1]) == 8
        data = bytes.fromhex(frame[4])
        for row in self.frames:
            if row["host"] or row["extended"] != extended or not row["of"] & MOTOR:
                continue
            above = (identifier & ~row["id_mask"]) - row["id"]
            number = above // row["step"] if row["step"] and row["by"] != "none" else 0
            if above != number * row["step"] or not 0 <= number <= row["most"]:
                continue
            parts = max(1, len(data) // row["length"]) if row["repeats"] > 1 else 1
            if len(data) < row["length"] or not all(
                    get(f, identifier, data, 0) == f["constant"]
                    for f in row["fields"] if f["meaning"] == "constant"):
                continue
            for part in range(parts):
                self._take_part(row, identifier, data, number, part)
            return

    def _take_part(self, row: Mapping[str, Any], identifier: int, data: bytes, number: int,
                   part: int) -> None:
        counts = [(f, get(f, identifier, data, part * row["length"])) for f in row["fields"]]
        known = {f["meaning"]: count for f, count in counts}
        if row["by"] == "slot":
            slot = number
        elif row["by"] == "group":
            slot = number * row["repeats"] + part
        else:
            address = number if row["by"] == "address" else known.get("address", 0)
            axis = part if row["repeats"] > 1 else known.get("axis", 0)
            slot = next((i for i, at in enumerate(self.slots)
                         if at[:2] == (address, axis)), len(self.slots))
        if not self._tells_state and slot < len(self.slots):
            joint = self.slots[slot][2]
            self._extra[joint]["mode"] = self._switched.get(joint, self._off_state()["name"])
        for field, count in counts:
            at = slot if row["of_one"] else slot + field["axis"]
            joint = self.slots[at][2] if at < len(self.slots) else None
            if not joint:
                continue
            found = self._extra[joint]
            if field["meaning"] == "state":
                found["mode"] = next((s["name"] for s in self.table["states"]
                                      if s["value"] == count), str(count))
            elif field["meaning"] in MEASURED:
                found[MEASURED[field["meaning"]]] = \
                    count if field["meaning"] == "faults" else \
                    value_of(of_model(field, self.models[self.slots[at][0]]), count)
        found = self._extra.get(self.slots[slot][2]) if slot < len(self.slots) else None
        if found and "deflection" in found and "motor position" in found:
            found["position"] = found["motor position"] - found["deflection"]
        if found and "drive torque" in found and not self._tells_torque:
            found["torque"] = found["drive torque"]
