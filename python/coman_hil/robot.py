# SPDX-License-Identifier: Apache-2.0
"""A robot by the names of its joints and sensors: what the boards have said last, in SI units,
angles at the link side of the gear."""
from __future__ import annotations

from typing import Dict, Generic, Iterable, TypeVar

from .boards import Boards, Table
from .database import HOST, Bus, Message, Signal
from .errors import BoardError, NoTelemetry, UnknownName
from .gateway import RawFrame

# by bus and identifier: the last frame of each message
Latest = Dict[tuple, RawFrame]
Source = tuple  # (bus, identifier as text), Signal, Message
T = TypeVar("T")

class Names(Dict[str, T], Generic[T]):
    """Things by name; a name that is not there is an UnknownName with the nearest."""

    def __init__(self, kind: str, items: Iterable[tuple[str, T]] = ()) -> None:
        super().__init__(items)
        self._kind = kind

    def __missing__(self, name: str) -> T:
        raise UnknownName(self._kind, name, self)


def _sources(bus: Bus, about: str) -> list[Source]:
    """Every signal of the boards about a joint, but for answers to questions."""
    return [((bus.name, m.word), s, m)
            for m in bus.messages.values() if m.sender != HOST
            for s in m.signals.values() if s.about == about and s.selector is None]


def _value(latest: Latest, source: Source) -> float | None:
    frame = latest.get(source[0])
    return None if frame is None else source[1].decode(bytes.fromhex(frame[4]))


class Joint:
    """A joint with its motor.

    name: the rig's. bus: that of its motor board. quantity: what its motor takes since
    Simulator.enable, None = it is off. voltage_v, current_a, torque_nm, velocity_rad_s,
    position_rad: read, the last value that its board has told (voltage_v: the set point); set, the
    set point, sent with every step; the supply is the most that acts of a voltage. BoardError for
    one of a kind that the motor is not enabled for, other than 0 V, for its board would ignore
    it."""

    # a misspelled voltage_v is an error
    __slots__ = ("name", "bus", "quantity", "quantities", "value", "_boards", "_table", "_latest",
                 "_all")

    def __init__(self, name: str, boards: Boards, table: Table, buses: Iterable[Bus],
                 latest: Latest) -> None:
        self.name, self.bus = name, boards.bus
        self.quantity: str | None = None
        self.quantities = boards.quantities(name)
        self.value = 0.0
        self._boards, self._table, self._latest = boards, table, latest
        self._all = [source for b in buses for source in _sources(b, name)]

    @property
    def enabled(self) -> bool:
        """Whether Simulator.enable has switched it on."""
        return self.quantity is not None

    def __repr__(self) -> str:
        return f"<joint {self.name} on {self.bus}>"

    def _set(self, quantity: str, value: float, unit: str) -> None:
        value = float(value)
        if value - value != 0.0:
            raise ValueError(f"{self.name}: found {value} {unit}, expected a number")
        if self.quantity != quantity:
            if quantity == "voltage" and not value:
                return
            if quantity not in self.quantities:
                raise BoardError(self.refusal(quantity))
            kind = "" if quantity == self.quantities[0] else f", quantity={quantity!r}"
            raise BoardError(f"{self.name}: found {value:g} {unit} for a motor that is not enabled"
                             f"{' for it' if self.enabled else ''}, expected "
                             f"enable({self.name!r}{kind}) before")
        self.value = value

    @property
    def voltage_v(self) -> float:
        return self.value if self.quantity == "voltage" else 0.0

    @voltage_v.setter
    def voltage_v(self, volts: float) -> None:
        self._set("voltage", volts, "V")

    def refusal(self, quantity: str) -> str:
        """Why its board takes no such set points."""
        return (f"{self.name}: {self._boards.protocol} boards take no {quantity}, expected "
                f"{', '.join(self.quantities)}")

    def _told(self, value: float | None, *quantities: str) -> float:
        """The value, or why there is none."""
        if value is not None:
            return value
        what = quantities[0].replace("_", " ")
        if not any((self.name, quantity) in self._table.values for quantity in quantities):
            raise NoTelemetry(f"{self.name}: {self._boards.protocol} boards do not report the "
                              f"{what}")
        raise NoTelemetry(f"{self.name}: no {what} has been reported yet: Simulator.enable or "
                          "listen makes the boards report")

    def _read(self, quantity: str) -> float:
        return self._told(self._table.read(self.name, quantity), quantity)

    @property
    def position_rad(self) -> float:
        """Angle of the link (rad). 2FOC boards read no link encoder: NoTelemetry. Set: the angle
        that the board's own loop holds."""
        return self._told(self._table.position(self.name), "position", "deflection",
                          "position_in_turn")

    @position_rad.setter
    def position_rad(self, rad: float) -> None:
        self._set("position", rad, "rad")

    @property
    def velocity_rad_s(self) -> float:
        """Velocity of the motor (rad/s), as motor_velocity_rad_s. Set: the one that the board's own
        loop holds."""
        return self._read("motor_velocity")

    @velocity_rad_s.setter
    def velocity_rad_s(self, rad_s: float) -> None:
        self._set("velocity", rad_s, "rad/s")

    @property
    def motor_position_rad(self) -> float:
        """Angle of the motor (rad), the other end of the joint's spring."""
        return self._read("motor_position")

    @property
    def motor_velocity_rad_s(self) -> float:
        """Velocity of the motor (rad/s); foc and compact FD."""
        return self._read("motor_velocity")

    @property
    def current_a(self) -> float:
        """Current of the motor (A)."""
        return self._read("current")

    @current_a.setter
    def current_a(self, ampere: float) -> None:
        self._set("current", ampere, "A")

    @property
    def torque_nm(self) -> float:
        """Torque on the link, of its sensor (N m); of the motor where boards have no sensor."""
        return self._read("torque")

    @torque_nm.setter
    def torque_nm(self, nm: float) -> None:
        self._set("torque", nm, "N m")

    @property
    def mode(self) -> str:
        """The board's word for what its motor does: "voltage", "open_loop", "off", "fault", ..."""
        value = self._table.newest(self.name, "mode")
        if value is not None:
            return value.boards.names.get(value.count(), str(value.count()))
        word = self._boards.on_word(self.name, self.quantity or "")
        if word and (self.name, "mode") not in self._table.values and self._heard:
            return word     # boards that do not report their mode
        raise NoTelemetry(f"{self.name}: no mode has been reported yet")

    @property
    def _heard(self) -> bool:
        """Whether its boards have reported anything."""
        return any(value.told for (name, _), values in self._table.values.items()
                   if name == self.name for value in values)

    @property
    def faults(self) -> int:
        """The fault bits of its board; each protocol has its own."""
        value = self._table.newest(self.name, "faults")
        if value is None and (self.name, "faults") in self._table.values and self._heard:
            return 0        # boards that report faults when they come
        return int(self._told(None if value is None else value.count(), "faults"))

    @property
    def is_on(self) -> bool:
        """Whether the board says that its motor takes set points of the enabled kind."""
        try:
            return self.mode == self._boards.on_word(self.name,
                                                     self.quantity or self.quantities[0])
        except NoTelemetry:
            return False

    def held_rad(self) -> float:
        """The present angle, to begin to hold: of the motor where it is told."""
        try:
            return self.motor_position_rad
        except NoTelemetry:
            return self.position_rad

    def state_text(self) -> str:
        """Its mode and faults in words."""
        try:
            return f"{self.name} is in mode {self.mode}, faults {self.faults:#x}"
        except NoTelemetry:
            return f"the board of {self.name} says nothing"

    def signals(self) -> dict[str, float]:
        """All that has been said about it: MESSAGE.signal and value, in the DBC's units."""
        values = ((source, _value(self._latest, source)) for source in self._all)
        return {f"{source[2].name}.{source[1].name}": value for source, value in values
                if value is not None}


class ForceSensor:
    """A six-axis force-torque sensor."""

    def __init__(self, name: str, bus: str, table: Table) -> None:
        self.name, self.bus, self._table = name, bus, table

    def __repr__(self) -> str:
        return f"<force sensor {self.name} on {self.bus}>"

    def _read(self, components: str) -> tuple[float, float, float]:
        values = [self._table.read(self.name, c) for c in components.split()]
        if None in values:
            raise NoTelemetry(f"{self.name}: has not reported yet: Simulator.listen makes it")
        return tuple(values)

    @property
    def force_n(self) -> tuple[float, float, float]:
        """Force in the sensor's frame (N)."""
        return self._read("fx fy fz")

    @property
    def moment_nm(self) -> tuple[float, float, float]:
        """Moment in the sensor's frame (N m)."""
        return self._read("mx my mz")
