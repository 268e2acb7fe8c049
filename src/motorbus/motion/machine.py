"""The machine file `motorbus.toml`: buses, axes, groups and poses.

Values are in API units: rad and rad/s, for a linear axis m and m/s. In the file they are text with a unit.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from math import inf, isfinite, tau
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, Self, TypeAlias, TypeVar

import msgspec
from msgspec import Meta, Struct, structs

from motorbus.core import units
from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.session.address import parse_address

T = TypeVar("T", bound=Struct)
Names: TypeAlias = "str | Iterable[str] | None"  # of axes, groups and buses; None means all axes
FORMAT: Final = 1
NAME: Final = "^[a-z][a-z0-9_-]{0,39}$"
DEVICE: Final = r"^[a-z][a-z0-9_-]*#(0[xX][0-9a-fA-F]+|[0-9]+)$"
NUMBERS: Final = r"(-?[0-9]+(\.[0-9]+)? ){3}"
PLACE: Final = f"^{NUMBERS}mm$"
FRAME: Final = f"^{NUMBERS}mm, {NUMBERS}deg$"
LARGEST: Final = 1e6  # of a number in API units
SLACK: Final = 1e-9  # rounding of a limit that went to the device and back
WHEEL_EXITS: Final = ("stop", "torque_off", "leave")


class Quantity(float):
    """A number in API units; in the file it is text with a unit of one of these `kinds`, as the `example`."""

    kinds: ClassVar[tuple[str, ...]]
    example: ClassVar[str]
    above_zero: ClassVar[bool] = True
    kind: str

    def __new__(cls, value: float, kind: str = "") -> Self:
        made = super().__new__(cls, value)
        made.kind = kind or cls.kinds[0]
        return made

    @property
    def is_linear(self) -> bool:
        """It measures a linear axis."""
        return self.kind.startswith("l")  # length, linear velocity

    @classmethod
    def parse(cls, value: object) -> Self:
        """`"90 deg"` -> 1.571. Raises ValueError without a unit, with a wrong unit, and for an impossible number."""
        text = str(value).strip()
        unit = text.lstrip("+-.0123456789eE ").strip()
        if not unit or not isinstance(value, str):
            raise ValueError(f'{shown(value)} has no unit: write it as "{cls.example}"')
        kind = next((kind for kind in cls.kinds if unit in units.SCALES[kind]), cls.kinds[0])
        found = cls(units.parse(text, kind), kind)
        if not isfinite(found) or abs(found) > LARGEST:
            raise ValueError(f"{text} is out of range: at most {LARGEST:g} in API units")
        if cls.above_zero and found <= 0:
            raise ValueError(f"{text} must be above 0")
        return found


class Position(Quantity):
    """rad; m for a linear axis."""

    kinds = ("position", "length")
    example = "90 deg"
    above_zero = False


class Velocity(Quantity):
    """rad/s; m/s for a linear axis."""

    kinds = ("velocity", "linear velocity")
    example = "90 deg/s"


class Acceleration(Quantity):
    """rad/s²; m/s² for a linear axis."""

    kinds = ("acceleration", "linear acceleration")
    example = "360 deg/s2"


class Length(Quantity):
    """m."""

    kinds = ("length",)
    example = "5 mm"


class BusConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """A bus."""

    address: Annotated[str, Meta(description="FAMILY:PORT, options after commas")]


class AxisConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An axis: its device, the conversion of its positions to angles of the device, and its limits.

    A `wheel` turns without end: it has a velocity and no position.
    """

    device: Annotated[str, Meta(pattern=DEVICE, description="BUS#ID")]
    kind: Annotated[Literal["position", "wheel"], Meta(description="wheel: turns without end")] = "position"
    zero: Annotated[Position, Meta(description="angle of the device where the axis is at 0; default 0")] = (
        msgspec.field(default_factory=lambda: Position(0.0))
    )
    sign: Annotated[Literal[1, -1], Meta(description="-1: turns against the device")] = 1
    gear: Annotated[float, Meta(gt=0, le=LARGEST, description="turns of the device per turn of the axis")] = (
        1.0
    )
    travel: Annotated[Length | None, Meta(description="linear axis: length per turn")] = None
    unit: Annotated[
        Literal["deg", "rad", "turn", "mm", "m"] | None, Meta(description="of shown positions")
    ] = None
    low: Annotated[Position | None, Meta(description="lowest position")] = None
    high: Annotated[Position | None, Meta(description="highest position")] = None
    max_velocity: Annotated[Velocity, Meta(description="highest velocity")]
    max_acceleration: Annotated[Acceleration | None, Meta(description="highest acceleration")] = None
    max_step: Annotated[Position | None, Meta(description="farthest goal from the measured position")] = None
    exit: Annotated[
        Literal["hold", "stop", "torque_off", "park", "leave"] | None,
        Meta(description="at the end of a program"),
    ] = None
    estop: Annotated[
        Literal["torque_off", "hold"] | None, Meta(description="at an emergency stop; default: of the device")
    ] = None
    max_torque: Annotated[
        Annotated[float, Meta(gt=0, le=1)] | None, Meta(description="share of the full torque")
    ] = None
    monitor_load: Annotated[bool, Meta(description="overload and heat end a movement")] = True
    parent: Annotated[str | None, Meta(description="for the sketch: the axis that carries it")] = None
    frame: Annotated[
        Annotated[str, Meta(pattern=FRAME)] | None,
        Meta(description='for the sketch: place and roll, pitch, yaw on its parent, "0 0 62 mm, 0 0 90 deg"'),
    ] = None
    tip: Annotated[
        Annotated[str, Meta(pattern=PLACE)] | None,
        Meta(description='for the sketch: end of the part that it moves, "0 0 98 mm"'),
    ] = None

    @property
    def bus(self) -> str:
        """The name of its bus."""
        return self.device.partition("#")[0]

    @property
    def node(self) -> int:
        """The id of its device."""
        return int(self.device.partition("#")[2], 16 if "x" in self.device.lower().partition("#")[2] else 10)

    @property
    def is_wheel(self) -> bool:
        """It turns without end."""
        return self.kind == "wheel"

    @property
    def display_unit(self) -> str:
        """The unit of shown positions."""
        return self.unit or ("mm" if self.travel else "deg")

    @property
    def exit_action(self) -> str:
        """What happens at the end of a program."""
        return self.exit or ("stop" if self.is_wheel else "hold")

    @property
    def acceleration(self) -> float:
        """rad/s² or m/s²; one turn of the device per s² by default."""
        return self.max_acceleration or tau / abs(self.ratio)

    # -- conversion ------------------------------------------------------------------------------------------------

    @property
    def ratio(self) -> float:
        """rad of the device for 1 rad (or 1 m) of the axis."""
        return self.sign * self.gear * (tau / self.travel if self.travel else 1.0)

    def to_device(self, position: float) -> float:
        """Position (rad, m) -> angle of the device (rad)."""
        return self.zero + position * self.ratio

    def from_device(self, angle: float) -> float:
        """Angle of the device (rad) -> position (rad, m)."""
        return (angle - self.zero) / self.ratio

    @property
    def device_limits(self) -> tuple[float, float]:
        """`low` and `high` as angles of the device (rad), ordered; infinite without them."""
        if self.low is None or self.high is None:
            return -inf, inf
        first, last = self.to_device(self.low), self.to_device(self.high)
        return min(first, last), max(first, last)

    def allows(self, position: float) -> bool:
        """Whether the limits allow this position (rad, m); never NaN."""
        low, high = (-inf if self.low is None else self.low), (inf if self.high is None else self.high)
        slack = SLACK * max(1.0, abs(position)) if isfinite(position) else 0.0
        return low - slack <= position <= high + slack

    # -- text ------------------------------------------------------------------------------------------------------

    def show(self, position: float) -> str:
        """A position in the display unit: `-45.0 deg`."""
        unit = self.display_unit
        scale = units.SCALES["length" if self.travel else "position"][unit]
        digits = {"deg": 1, "mm": 2, "turn": 3}.get(unit, 4)
        number = f"{position / scale:.{digits}f}"
        return f"{number if float(number) else number.removeprefix('-')} {unit}"


class GroupConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """A group of axes."""

    axes: Annotated[tuple[str, ...], Meta(min_length=1)]


class MachineConfig(Struct, frozen=True, kw_only=True):
    """A machine; tables by name, in the order of the file."""

    name: str = ""
    buses: dict[str, BusConfig] = {}
    axes: dict[str, AxisConfig] = {}
    groups: dict[str, tuple[str, ...]] = {}
    poses: dict[str, dict[str, float]] = {}
    path: str = ""

    @classmethod
    def load(cls, path: str | PathLike[str] = "motorbus.toml") -> MachineConfig:
        """Read and check a file. Raises RequestError that names the file and the key."""
        try:
            return cls.parse(Path(path).read_text("utf-8"), str(path))
        except (OSError, UnicodeDecodeError) as error:
            raise RequestError(
                f"{path}: {getattr(error, 'strerror', '') or 'not UTF-8 text'}",
                advice="`motorbus init BUS` writes a machine file",
            ) from None
        except RequestError as error:
            error.summary = f"{path}: {error.summary}"
            raise

    @classmethod
    def parse(cls, text: str, path: str = "") -> MachineConfig:
        """The machine of the text of a file. Raises RequestError that names the key."""
        try:
            data = tomllib.loads(text.removeprefix("\ufeff"))
        except ValueError as error:
            raise RequestError(
                str(error), advice='text is in quotes, also a number with its unit: "90 deg"'
            ) from None
        return cls.of(data, path)

    @classmethod
    def of(cls, data: Mapping[str, Any], path: str = "") -> MachineConfig:
        """The machine of plain data. Raises RequestError that names the key."""
        known = ("format", "name", "bus", "axis", "group", "pose")
        for key in data:
            if key not in known:
                raise RequestError(f"unknown key {key!r}", advice=nearest(key, known))
        if data.get("format") != FORMAT:
            raise RequestError(
                f"format is {shown(data.get('format'))}", expected=f"format = {FORMAT} in the first line"
            )
        groups = {
            name: _convert(f"group.{name}", table, GroupConfig) for name, table in _tables(data, "group")
        }
        machine = cls(
            name=str(data.get("name", "")),
            buses={name: _convert(f"bus.{name}", table, BusConfig) for name, table in _tables(data, "bus")},
            axes={name: _convert(f"axis.{name}", table, AxisConfig) for name, table in _tables(data, "axis")},
            groups={name: group.axes for name, group in groups.items()},
            poses={
                name: {axis: _position(f"pose.{name}.{axis}", value) for axis, value in table.items()}
                for name, table in _tables(data, "pose")
            },
            path=path,
        )
        machine.check()
        return machine

    def check(self) -> None:
        """Raise RequestError for the first key that contradicts another."""
        owners: dict[tuple[str, int], str] = {}
        for name, bus in self.buses.items():
            if parse_address(bus.address).nodes:
                raise RequestError(f"bus.{name}.address: an id belongs to an axis", expected="FAMILY:PORT")
        for name, axis in self.axes.items():
            where = f"axis.{name}"
            if axis.bus not in self.buses:
                raise RequestError(
                    f"{where}.device: no bus {axis.bus!r}", advice=nearest(axis.bus, self.buses)
                )
            if other := owners.get((axis.bus, axis.node)):
                raise RequestError(f"{where}.device: {axis.device} belongs to axis.{other}")
            owners[axis.bus, axis.node] = name
            _check_axis(where, axis)
            self._check_parents(name)
            if axis.exit == "park" and name not in self.poses.get("park", {}):
                raise RequestError(f'{where}.exit: "park" needs its position in [pose.park]')
        for name, members in self.groups.items():
            if name in self.axes:
                raise RequestError(f"group.{name}: an axis has this name")
            for member in members:
                self._axis(f"group.{name}", member)
        for name, places in self.poses.items():
            for member, place in places.items():
                where, axis = f"pose.{name}.{member}", self._axis(f"pose.{name}", member)
                if axis.is_wheel:
                    raise RequestError(f"{where}: a wheel has no position")
                _check_kind(where, axis, place)
                if not axis.allows(place):
                    raise RequestError(f"{where}: {axis.show(place)} is outside the limits of the axis")

    def _check_parents(self, name: str) -> None:
        above = [name]
        while (parent := self.axes[above[-1]].parent) is not None:
            if parent in above or parent not in self.axes or not self.axes[parent].frame:
                raise RequestError(
                    f"axis.{above[-1]}.parent: {shown(parent)}", expected="an axis with a frame, not below it"
                )
            above.append(parent)

    def _axis(self, where: str, name: str) -> AxisConfig:
        if name not in self.axes:
            raise RequestError(f"{where}: no axis {name!r}", advice=nearest(name, self.axes))
        return self.axes[name]

    def axes_of(self, names: Names = None) -> tuple[str, ...]:
        """The axes of these names of axes, groups and buses. Raises RequestError for an unknown name."""
        if names is None:
            return tuple(self.axes)
        found: dict[str, None] = {}
        for name in (names,) if isinstance(names, str) else names:
            if name in self.axes:
                found[name] = None
            elif name in self.groups:
                found |= dict.fromkeys(self.groups[name])
            elif name in self.buses:
                found |= dict.fromkeys(axis for axis, config in self.axes.items() if config.bus == name)
            else:
                known = [*self.axes, *self.groups, *self.buses]
                raise RequestError(f"no axis, group or bus {name!r}", advice=nearest(name, known))
        return tuple(found)


def _check_axis(where: str, axis: AxisConfig) -> None:
    if axis.is_wheel:
        for key in ("low", "high", "max_step", "travel"):
            if getattr(axis, key) is not None:
                raise RequestError(f"{where}.{key}: a wheel has no position", advice="take it out")
        if axis.exit_action not in WHEEL_EXITS:
            raise RequestError(
                f"{where}.exit: {axis.exit!r} of a wheel", expected=f"one of {', '.join(WHEEL_EXITS)}"
            )
    elif axis.exit == "stop":
        raise RequestError(f'{where}.exit: "stop" is for a wheel', advice='"hold" stops and holds')
    for key in ("low", "high", "max_step", "max_velocity", "max_acceleration"):
        _check_kind(f"{where}.{key}", axis, getattr(axis, key))
    if (axis.display_unit in ("mm", "m")) != bool(axis.travel):
        raise RequestError(f"{where}.unit: {axis.unit} does not measure this axis")
    if (axis.low is None) != (axis.high is None):
        raise RequestError(f"{where}: low and high are needed together")
    if axis.low is not None and axis.high is not None and axis.low >= axis.high:
        ends = axis.show(axis.low), axis.show(axis.high)
        raise RequestError(f"{where}.low: {ends[0]} is not below high, {ends[1]}")


def _check_kind(where: str, axis: AxisConfig, value: float | None) -> None:
    if isinstance(value, Quantity) and value.is_linear != bool(axis.travel):
        raise RequestError(
            f"{where}: this axis is {'linear' if axis.travel else 'not linear'}",
            advice='an axis with travel = "5 mm" (length per turn) is linear',
        )


def _tables(data: Mapping[str, Any], kind: str) -> list[tuple[str, Mapping[str, Any]]]:
    tables = data.get(kind, {})
    if not isinstance(tables, dict) or not all(isinstance(table, dict) for table in tables.values()):
        raise RequestError(f"{kind} is not a table of tables", expected=f"[{kind}.NAME]")
    for name in tables:
        if not re.match(NAME, name):
            raise RequestError(
                f"{kind}.{shown(name)}: not a name", expected="a-z, then a-z 0-9 _ -, at most 40"
            )
    return list(tables.items())


def _convert(where: str, table: Mapping[str, Any], kind: type[T]) -> T:
    try:
        return msgspec.convert(table, kind, dec_hook=_hook)
    except msgspec.ValidationError as error:
        text, _, place = str(error).partition(" - at `$.")
        key = f".{place.rstrip('`')}" if place else ""
        fields = [one.encode_name for one in structs.fields(kind)]
        unknown = text.partition("unknown field `")[2].partition("`")[0]
        advice = nearest(unknown, fields) if unknown else ""
        raise RequestError(f"{where}{key}: {text[:1].lower()}{text[1:]}", advice=advice) from None


def _position(where: str, value: object) -> float:
    try:
        return Position.parse(value)
    except ValueError as error:
        raise RequestError(f"{where}: {_line(error)}") from None


def _hook(kind: type, value: object) -> object:
    if not issubclass(kind, Quantity):
        raise NotImplementedError(kind)
    try:
        return kind.parse(value)
    except ValueError as error:
        raise ValueError(_line(error)) from None


def _line(error: ValueError) -> str:
    return error.summary if isinstance(error, RequestError) else str(error)


def nearest(word: str, known: Iterable[str]) -> str:
    """`did you mean shoulder?`, or the known words."""
    words = list(known)
    near = get_close_matches(word, words, n=1)
    return f"did you mean {near[0]}?" if near else f"known: {', '.join(words[:12]) or 'none'}"
