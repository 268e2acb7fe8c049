"""What a machine is, as types: buses, axes, groups, poses, each key with its meaning, unit, range and default.

A person writes them down in `motorbus.toml`. Reading, the schema, the page of the documentation and a fresh file are
all made from these types, so none of them can say anything else than what is read. Values are in the API's units: an
axis that turns is in rad, a linear one in m. What one field can say alone stands here; what several must agree on
stands in `agreement`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

from msgspec import Meta, Struct, field

from motorbus.core import units

FORMAT: Final = 1
"""The number that a file of this kind begins with."""
NAME: Final = "[a-z][a-z0-9_-]{0,39}"
"""What a bus, an axis, a group or a pose may be called: it can stand on a command line and in a path."""
DEVICE: Final = f"({NAME})#(0[xX][0-9a-fA-F]{{1,8}}|[0-9]{{1,10}})"
ADDRESS: Final = r"[^\s:#,]+:[^\s#,][^#,]*(,[^\s#,=]+=[^#,]+)*"
FARTHEST: Final = 1e6
"""rad or m. An angle of more turns than this has no digits left for a position."""
HIGHEST_NODE: Final = 0x7FFFFFFF
ROUNDING: Final = 1e-9
TURN: Final = 2 * pi
TURNING_UNITS: Final = ("deg", "rad", "turn")
LINEAR_UNITS: Final = ("mm", "m")

Exit: TypeAlias = Literal["hold", "torque_off", "park", "leave"]
Estop: TypeAlias = Literal["torque_off", "hold"]
Unit: TypeAlias = Literal["deg", "rad", "turn", "mm", "m"]

EXITS: Final[Mapping[Exit, str]] = {
    "hold": "it stops, and stays with its torque on",
    "torque_off": "it stops, then lets go",
    "park": "it goes to `park`, and stays with its torque on",
    "leave": "nothing is sent",
}
"""What each way to end means."""
ESTOPS: Final[Mapping[Estop, str]] = {
    "torque_off": "it lets go at once, and may fall",
    "hold": "it is told to stay where it is, and keeps its torque",
}
"""What each emergency stop means."""


class Measure(NamedTuple):
    """Which quantity (a key of `units.SCALES`) a value is, on an axis that turns and on a linear one."""

    turning: str
    linear: str

    def of(self, linear: bool) -> str:
        """The quantity of the one or the other kind of axis."""
        return self.linear if linear else self.turning


POSITION: Final = Measure("position", "length")
VELOCITY: Final = Measure("velocity", "linear velocity")
ACCELERATION: Final = Measure("acceleration", "linear acceleration")
ANGLE: Final = Measure("position", "position")
LENGTH: Final = Measure("length", "length")
CURRENT: Final = Measure("current", "current")
LOAD: Final = Measure("load", "load")


def _key(
    says: str,
    example: str | tuple[str, str],
    measure: Measure | None = None,
    *,
    usual: tuple[str, str] = ("", ""),
    **rest: Any,
) -> Meta:
    """One key: what it says, an example in TOML, which quantity it is, and what it usually is.

    Pairs are for an axis that turns and for a linear one. `rest` is its range.
    """
    examples = (example, example) if isinstance(example, str) else example
    return Meta(description=says, extra={"example": examples, "measure": measure, "usual": usual}, **rest)


class BusSpec(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A bus: where it is."""

    address: Annotated[
        str,
        _key(
            "where the bus is: FAMILY:PORT, options after commas",
            '"feetech:/dev/ttyACM0,baud=1000000"',
            pattern=f"^{ADDRESS}$",
        ),
    ]


Zero: TypeAlias = Annotated[
    float,
    _key(
        "angle of the device at which the axis is at 0", '"180 deg"', ANGLE,
        usual=("0 deg", "0 deg"), ge=-FARTHEST, le=FARTHEST,
    ),
]  # fmt: skip
Sign: TypeAlias = Annotated[Literal[1, -1], _key("1, or -1 where the axis turns against the device", "-1")]
Gear: TypeAlias = Annotated[
    float, _key("turns of the device for one turn of the axis", "3.0", ge=1e-6, le=1e6)
]
Travel: TypeAlias = Annotated[
    float, _key("makes the axis linear: its way for one turn", '"5 mm"', LENGTH, ge=1e-6, le=1e3)
]
Low: TypeAlias = Annotated[
    float,
    _key("lowest position; needs `high`", ('"-90 deg"', '"0 mm"'), POSITION, ge=-FARTHEST, le=FARTHEST),
]
High: TypeAlias = Annotated[
    float,
    _key("highest position; needs `low`", ('"90 deg"', '"120 mm"'), POSITION, ge=-FARTHEST, le=FARTHEST),
]
MaxVelocity: TypeAlias = Annotated[
    float,
    _key(
        "it is never led faster", ('"120 deg/s"', '"50 mm/s"'), VELOCITY,
        usual=("90 deg/s", "50 mm/s"), gt=0, le=FARTHEST,
    ),
]  # fmt: skip
MaxAcceleration: TypeAlias = Annotated[
    float,
    _key(
        "it never starts or stops harder", ('"500 deg/s2"', '"200 mm/s2"'), ACCELERATION,
        usual=("360 deg/s2", "200 mm/s2"), gt=0, le=FARTHEST,
    ),
]  # fmt: skip
MaxStep: TypeAlias = Annotated[
    float,
    _key(
        "farthest that one command may be from the measured position", ('"10 deg"', '"2 mm"'), POSITION,
        gt=0, le=FARTHEST,
    ),
]  # fmt: skip
Park: TypeAlias = Annotated[
    float,
    _key(
        'where parking goes; needed with exit = "park"', ('"0 deg"', '"0 mm"'), POSITION,
        ge=-FARTHEST, le=FARTHEST,
    ),
]  # fmt: skip
EstopPolicy: TypeAlias = Annotated[
    Estop, _key("what an emergency stop does to it; left out: what is usual for its device", '"hold"')
]
Torque: TypeAlias = Annotated[float, _key("cap of its torque; not with `current`", "0.5", LOAD, gt=0, le=1)]
Current: TypeAlias = Annotated[
    float, _key("cap of its current; not with `torque`", '"0.4 A"', CURRENT, gt=0, le=1e3)
]

Guard: TypeAlias = Annotated[
    bool,
    _key("whether a movement ends when its motor pushes too hard for too long, or is too hot", "false"),
]


class AxisSpec(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An axis: which device moves it, how its positions become angles of that device, and how far it may go.

    Positions are in rad; with `travel` it is a linear axis, and they are in m. Without `low` and `high`, which come
    together, the limits of the device hold alone.
    """

    device: Annotated[str, _key("what moves it: BUS#ID", '"arm#1"', pattern=f"^{DEVICE}$")]
    zero: Zero = 0.0
    sign: Sign = 1
    gear: Gear = 1.0
    travel: Travel | None = None
    unit: Annotated[Unit, _key("how people see its positions", ('"deg"', '"mm"'), usual=("deg", "mm"))]
    low: Low | None = None
    high: High | None = None
    max_velocity: MaxVelocity
    max_acceleration: MaxAcceleration
    max_step: MaxStep | None = None
    exit: Annotated[Exit, _key("what it does when the program ends, however that comes", '"hold"')] = "hold"
    estop: EstopPolicy | None = None
    park: Park | None = None
    torque: Torque | None = None
    current: Current | None = None
    guard: Guard = True

    # -- which device ------------------------------------------------------------------------------------------

    @property
    def bus(self) -> str:
        """The name of the bus that its device is on."""
        return self.device.partition("#")[0]

    @property
    def node(self) -> int:
        """The id of its device on that bus."""
        return number(self.device.partition("#")[2])

    # -- positions of the axis and angles of the device -----------------------------------------------------------

    @property
    def linear(self) -> bool:
        """Whether its positions are lengths."""
        return self.travel is not None

    @property
    def ratio(self) -> float:
        """rad of the device for 1 rad (or 1 m) of the axis; negative where they go against each other. Never 0."""
        return self.sign * self.gear * (TURN / self.travel if self.travel else 1.0)

    def to_device(self, position: float) -> float:
        """Position of the axis (rad or m) -> angle of the device (rad). What is not finite stays so."""
        return self.zero + position * self.ratio

    def from_device(self, angle: float) -> float:
        """Angle of the device (rad) -> position of the axis (rad or m). What is not finite stays so."""
        return (angle - self.zero) / self.ratio

    def rate_to_device(self, rate: float) -> float:
        """Velocity or acceleration of the axis -> of the device (rad/s or rad/s²), with its sign."""
        return rate * self.ratio

    def rate_from_device(self, rate: float) -> float:
        """Velocity or acceleration of the device (rad/s or rad/s²) -> of the axis, with its sign."""
        return rate / self.ratio

    @property
    def device_limits(self) -> tuple[float, float] | None:
        """`low` and `high` as angles of the device, the lower one first; None when the file has none."""
        if self.low is None or self.high is None:
            return None
        ends = self.to_device(self.low), self.to_device(self.high)
        return min(ends), max(ends)

    def allows(self, position: float) -> bool:
        """Whether the soft limits allow this position; without any, whatever no file may exceed. Never NaN.

        A limit that went to the device and came back is still allowed: rounding makes up to 1e-9 of it.
        """
        low = -FARTHEST if self.low is None else self.low
        high = FARTHEST if self.high is None else self.high
        slack = ROUNDING * max(abs(low), abs(high), 1.0)
        return low - slack <= position <= high + slack

    # -- for people --------------------------------------------------------------------------------------------------

    def parse(self, text: str) -> float:
        """`90 deg`, `12.5 mm`, or a number in the API's unit -> a position. Raises RequestError as `units.parse`."""
        return units.parse(text, POSITION.of(self.linear))

    def show(self, position: float) -> str:
        """A position in the unit in which people see this axis: `-45.0 deg`, `12.50 mm`."""
        scale = units.SCALES[POSITION.of(self.linear)][self.unit]
        decimals = {"deg": 1, "mm": 2, "turn": 3}.get(self.unit, 4)
        number = position / scale
        text = f"{number:.{decimals}f}" if abs(number) < units.LONG else f"{number:.6g}"
        return f"{text if float(text) else text.removeprefix('-')} {self.unit}"


class GroupSpec(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A group: axes that are moved together under one name."""

    axes: Annotated[
        tuple[str, ...], _key("names of its axes, in order", '["shoulder", "elbow"]', min_length=1)
    ]


class Description(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All that a file says; tables by name, in the order of the file."""

    name: Annotated[str, _key("what people call the machine", '"bench"', max_length=200)] = ""
    buses: Annotated[Mapping[str, BusSpec], _key("a table [bus.NAME] for each bus", "[bus.arm]")] = field(
        name="bus", default_factory=dict
    )
    axes: Annotated[Mapping[str, AxisSpec], _key("a table [axis.NAME] for each axis", "[axis.shoulder]")] = (
        field(name="axis", default_factory=dict)
    )
    groups: Annotated[
        Mapping[str, GroupSpec], _key("a table [group.NAME] for each group", "[group.left]")
    ] = field(name="group", default_factory=dict)
    poses: Annotated[
        Mapping[str, Mapping[str, float]],
        _key("a table [pose.NAME] for each pose: positions by the names of axes", "[pose.ready]"),
    ] = field(name="pose", default_factory=dict)


def number(text: str) -> int:
    """An id as it stands after `#`: decimal, also with leading zeros, or 0x."""
    return int(text, 16 if text[:2] in ("0x", "0X") else 10)
