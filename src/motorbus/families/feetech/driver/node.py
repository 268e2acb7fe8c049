"""What is known of one servo, and what its settings mean for its values. No I/O."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from math import degrees, inf
from typing import Any, Final, NamedTuple

from motorbus.core.family import Identity
from motorbus.core.register import Register, RegisterMap, Value, is_number, shown
from motorbus.core.request import Request
from motorbus.core.setpoint import Setpoint
from motorbus.errors import RequestError
from motorbus.families.feetech.protocol import BROADCAST, MAX_ID
from motorbus.families.feetech.registers.codes import alarms
from motorbus.families.feetech.traits import NO_TRAITS, TRAITS, Mode, Traits

IMAGE: Final = 40  # bytes of the EEPROM area, registers 0 to 39, which one READ returns
MANY_TURNS: Final = 30719
"""Counts to either side when both limits are 0 (7.5 turns). Source: STS3215 memory table V3.6."""

_LIMITS: Final = ("min_position_limit", "max_position_limit")
_POSITIONS: Final = ("present_position", "goal_position", "goal_position_echo", *_LIMITS)
_VELOCITIES: Final = ("present_velocity", "goal_velocity")
_ARCS: Final = ("homing_offset", "dead_band_cw", "dead_band_ccw", "hysteresis")


class Settings(NamedTuple):
    """What the EEPROM of a servo says about how to command it.

    `limits`      lowest and highest position (rad); None where unknown, or both 0 in a map without many turns
    `mode`        None for an unknown map or a number that no source explains; `mode_code` is that number
    `turn`        counts of a single-turn position; `arc` are the degrees of these counts
    `many_turns`  goals count over many turns: both limits are 0
    `tells_turns` the present position counts over many turns; else it lies within one
    `shift`       counts to subtract from a present position: a servo applies its offset in position mode only
    `factors`     by row name, a factor of the unit of the row
    `protection_current`  raw; the goal torque of an HLS at power-up
    `zero_is_maximum`     a goal velocity of 0 means the maximum; else standstill
    `tells_current`       its bridge measures the current
    """

    limits: tuple[float, float] | None = None
    mode: Mode | None = None
    mode_code: int | None = None
    turn: int = 4096
    arc: float = 360.0
    many_turns: bool = False
    tells_turns: bool = False
    shift: int = 0
    raw_limits: tuple[int, int] = (0, 0)
    factors: Mapping[str, float] = {}
    protection_current: int = 0
    zero_is_maximum: bool = True
    tells_current: bool = True

    def without_offset(self, raw: int) -> int:
        """A present position (counts) without the homing offset, within a turn where it lies within one."""
        if self.tells_turns or not 0 <= raw < self.turn:
            return raw - self.shift
        return (raw - self.shift) % self.turn


class Pending(NamedTuple):
    """A REG WRITE that waits for ACTION: its goals, and what was so when it left."""

    goals: tuple[Setpoint, ...]
    settings: Settings | None
    epoch: int
    stops: int


class Known:
    """What is known of the servo with one id; all objects of this id on one bus share it.

    `settings`   None: not read, or maybe changed since; `last` are those that were read
    `at`         arrival of the last reply (s, link clock); `alarm` its alarm bits
    `bound`      raw goal torque of an HLS, as last read or written
    `former_limits`  of an SCS that was made a motor
    `reads_alone`    it answers READ and not SYNC READ; None: unknown
    `pending`    a REG WRITE that waits
    `epoch`      number of its stops and torque-offs
    `kept`       requests made by the present settings
    """

    def __init__(self) -> None:
        self.identity: Identity | None = None
        self.table: RegisterMap | None = None
        self.settings: Settings | None = None
        self.last: Settings | None = None
        self.at = -inf
        self.alarm: tuple[str, ...] = ()
        self.bound: int | None = None
        self.second_id: int | None = None
        self.former_limits: tuple[float, float] | None = None
        self.reads_alone: bool | None = None
        self.pending: Pending | None = None
        self.epoch = 0
        self.kept: Final[dict[str, Request[Any]]] = {}

    def learn(self, settings: Settings) -> None:
        """Its settings were read. Equal ones stay the same object, so what was made by them still holds."""
        if settings == self.last:
            settings = self.last
        if settings is not self.settings:
            self.kept.clear()
        self.settings = self.last = settings

    def forget(self, *, written: bool = False) -> None:
        """Its settings may have changed, or were `written`: they are read before they are used again."""
        self.settings = self.bound = None
        self.kept.clear()
        if written and self.last is not None:
            self.last = self.last._replace()  # another object: what was made before is refused


class BusFacts:
    """What is known of the servos of one bus, by id. `arcs` are settings (degrees by id)."""

    def __init__(self, arcs: Mapping[int, float] | None = None) -> None:
        self.arcs: Final = arcs or {}
        self.servos: Final[defaultdict[int, Known]] = defaultdict(Known)

    @property
    def maps(self) -> dict[int, str]:
        """Names of the register maps; "" for an unknown one."""
        return {id: one.identity.table for id, one in self.servos.items() if one.identity}


class Node:
    """One servo by its id, 0 to 253."""

    def __init__(self, node: int, facts: BusFacts | None = None) -> None:
        self.node: Final = checked_id(node)
        self.facts: Final = facts or BusFacts()
        self.known: Final = self.facts.servos[node]
        self.last_move: object = None

    @property
    def identity(self) -> Identity | None:
        """As last read."""
        return self.known.identity

    @property
    def table(self) -> RegisterMap | None:
        """Its register map; None before it is identified."""
        return self.known.table

    @property
    def settings(self) -> Settings | None:
        """None where they are not known."""
        return self.known.settings

    @property
    def alarm(self) -> tuple[str, ...]:
        """Alarm bits of the last reply."""
        return self.known.alarm

    @property
    def limits(self) -> tuple[float, float] | None:
        """Lowest and highest position (rad); None where unknown."""
        return self.settings.limits if self.settings else None

    @property
    def known_mode(self) -> Mode | None:
        """Its operating mode; None where unknown."""
        return self.settings.mode if self.settings else None

    @property
    def traits(self) -> Traits:
        """The roles of the registers of its map; none for an unknown map."""
        return TRAITS.get(self.identity.table, NO_TRAITS) if self.identity else NO_TRAITS

    @property
    def is_writable(self) -> bool:
        """Its register map is known."""
        return self.identity is not None and bool(self.identity.table)

    def note_reply(self, error: int, at: float) -> None:
        """A reply with this error byte arrived. An alarm never makes a reply a failure."""
        known = self.known
        known.alarm = alarms(error, known.table.name if known.table else "sts") if error else ()
        known.at = at

    def row(self, name: str) -> Register:
        """A register of an identified servo, as its present mode codes it."""
        assert self.table is not None
        if self.known_mode is Mode.PWM and name == self.traits.duty:
            return self.traits.duty_row(self.table)
        return self.table[name]

    def value(self, row: Register, raw: int) -> Value:
        """Raw value -> value in the unit of the row, by the last known settings of this servo."""
        settings = self.known.last
        if settings is None or row.name not in settings.factors:
            return row.to_value(raw)
        if settings.shift and row.name == "present_position":
            raw = settings.without_offset(raw)
        return row.to_value(raw) * settings.factors[row.name]

    def raw(self, row: Register, value: Value) -> int:
        """Value in the unit of the row -> raw value. Raises RequestError if it is not a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refusal(f"cannot take {row.name} {shown(value)}", expected="a number")
        factor = self.settings.factors.get(row.name, 1) if self.settings else 1
        return row.to_raw(value / factor if factor != 1 and is_number(value) else value)

    def refusal(self, what: str, fix: str = "", *, expected: str = "") -> RequestError:
        """The error for an impossible request to this servo: `node 3 WHAT`."""
        return RequestError(f"node {self.node} {what}", expected=expected, advice=fix, node=self.node)


def settings_of(table: RegisterMap, image: bytes, arc: float | None = None) -> Settings:
    """The settings in registers 0 to 39, by the map of the servo. `arc`: degrees of all counts, None: by the map."""

    def raw(name: str, other: int = 0) -> int:
        if name not in table:
            return other
        row = table[name]
        return row.decode(image[row.address : row.address + row.size])

    phase, traits = raw("phase"), TRAITS[table.name]
    raw_limits = raw("min_position_limit"), raw("max_position_limit")
    many_turns = traits.many_turns and raw_limits == (0, 0)
    code = raw("operating_mode") if "operating_mode" in table else None
    mode = traits.mode_of(code, raw_limits)
    count = table["goal_position"].scale
    of_rows = round(degrees(count * traits.turn), 6)
    stretch = 1.0 if arc is None or arc == of_rows else arc / of_rows
    angle = stretch * max(1, raw("angular_resolution", 1))
    low, high = (-MANY_TURNS, MANY_TURNS) if many_turns else raw_limits
    velocity = stretch * traits.velocity_scale(phase)
    factors = {**dict.fromkeys(_POSITIONS, angle), **dict.fromkeys(_VELOCITIES, velocity)}
    return Settings(
        raw_limits=raw_limits,
        limits=(low * count * angle, high * count * angle) if low or high else None,
        mode=mode,
        mode_code=code,
        turn=traits.turn,
        arc=of_rows * stretch,
        many_turns=many_turns,
        tells_turns=traits.tells_turns(phase),
        shift=0 if mode in (Mode.POSITION, None) else raw("homing_offset"),
        factors={**factors, **dict.fromkeys(_ARCS, stretch)},
        protection_current=raw("protection_current") if traits.current else 0,
        zero_is_maximum=traits.zero_is_maximum(phase),
        tells_current=traits.tells_current(phase),
    )


def checked_id(node: int) -> int:
    """The id of one servo. Raises RequestError for anything else, also for 254 (all servos)."""
    if isinstance(node, int) and not isinstance(node, bool) and 0 <= node <= MAX_ID:
        return node
    raise RequestError(
        f"{shown(node)} is not the id of a servo", expected=f"0 to {MAX_ID}; {BROADCAST} addresses all servos"
    )


def as_nodes(ids: Iterable[int | Node]) -> list[Node]:
    """Each as a node. Raises RequestError for none, and for an id that is named twice."""
    facts = BusFacts()
    try:
        nodes = [one if isinstance(one, Node) else Node(one, facts) for one in ids]
    except TypeError:
        raise RequestError(f"{shown(ids)} is not a list of servos") from None
    if len({node.node for node in nodes}) == len(nodes) > 0:
        return nodes
    raise RequestError("an id is named twice" if nodes else "no servo is named")
