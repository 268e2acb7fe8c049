"""What the driver knows of one servo, and what its settings mean for the values that go to and fro.

A node is memory only: no bus, no I/O. Driver functions fill it, every reply adds its alarm bits and its time to
it, and whoever writes a setting makes it forget. Nothing here is ever guessed: unknown stays None.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from math import inf
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.core.family import Identity
from motorbus.core.register import Register, RegisterMap, Value, is_number, shown
from motorbus.core.request import Expected, Request
from motorbus.core.setpoint import Setpoint
from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.table import (
    CONTROL,
    Control,
    Mode,
    alarms,
    mode_of,
    tells_current,
    velocity_scale,
    zero_is_maximum,
)
from motorbus.families.feetech.table.phase import many_turns_are_told

IMAGE: Final = 40
"""Bytes of the EEPROM area, registers 0 to 39, which one READ brings."""
MANY_TURNS: Final = 30719
"""Counts to either side when both limits are 0 (7.5 turns). Source: STS3215 memory table V3.6."""

_UNKNOWN: Final = Control()
PRESENT_POSITION: Final = "present_position"
_POSITIONS: Final = (PRESENT_POSITION, "goal_position", "goal_position_echo")
_LIMITS: Final = ("min_position_limit", "max_position_limit")
_VELOCITIES: Final = ("present_velocity", "goal_velocity")
SCALED: Final = frozenset((*_POSITIONS, *_LIMITS, *_VELOCITIES))
"""Rows whose unit depends on settings of the servo (angular resolution, phase)."""

alarm_names: Final = cache(alarms)


class Settings(NamedTuple):
    """What the EEPROM of a servo says about how to talk to it.

    `limits`       in rad; None when its map is not known, or both are 0 and nobody has published what that means
    `mode`         what it heeds; None when its map is not known, or the number is one that no source explains
    `mode_code`    that number; None where the map has no operating mode and the limits decide
    `offset`       homing offset in counts; 0 where the map has none
    `turn`         counts after which a position over one turn begins anew
    `many_turns`   both limits are 0 where that means many turns
    `accumulates`  the present position is told over many turns (phase, bit 4), otherwise over one
    `shift`        counts to take from the present position as it is told: the offset in every mode but position,
                   for the servo itself applies it in position mode only
    `factors`      what a row says of its unit, times this, by row name
    `protection_current`  raw; what bounds the current after power-up where a goal register does so
    `answers_writes`  the status return level
    `zero_is_maximum`  a goal velocity of 0 means the maximum, otherwise it means standstill
    `tells_current`    its bridge measures the current
    """

    limits: tuple[float, float] | None = None
    mode: Mode | None = None
    mode_code: int | None = None
    offset: int = 0
    turn: int = 4096
    many_turns: bool = False
    accumulates: bool = False
    shift: int = 0
    factors: Mapping[str, float] = {}
    protection_current: int = 0
    answers_writes: bool = True
    zero_is_maximum: bool = True
    tells_current: bool = True

    def compensated(self, raw: int) -> int:
        """A present position in counts with the homing offset taken out, within a turn where it is told over one."""
        if self.accumulates or not 0 <= raw < self.turn:
            return raw - self.shift
        return (raw - self.shift) % self.turn


class Pending(NamedTuple):
    """What a REG WRITE from here ordered and no ACTION has carried out yet: the goals, the settings by which they were
    reckoned, how many stops had left for the servo until then, and whether it was taken back since."""

    goals: tuple[Setpoint, ...]
    settings: Settings | None
    stops: int = 0
    withdrawn: bool = False


class Changes:
    """`now` is another object after each change of the settings of any servo.

    So whoever has found that certain servos have certain settings need not look again, as long as it is the same.
    """

    __slots__ = ("now",)

    def __init__(self) -> None:
        self.now = object()


CHANGES: Final = Changes()


def _set_settings(node: Any, settings: Settings | None) -> None:
    before, behind = object(), object()  # first of all, so that between the others nothing can fail
    CHANGES.now = before  # in front, so that an interrupt between these lines is taken for a change
    node._settings = settings
    CHANGES.now = behind  # behind, so that another thread that has looked in between looks again


class Node:
    """One servo by its id, 0 to 253, and what is known of it.

    `alarm` holds the names of the alarm bits of the last reply and `at` its arrival on the link's clock (s);
    `pending` the goals that wait in it for an ACTION, None when none from here do. `bound` is the raw bound of the
    current where a goal register holds it (HLS), as last read or written; None when not read yet. `former_limits` are
    those (rad) that were given up to make a motor of it, where limits decide about that. `questions` are packets that
    were made to read it, with the reply due, by address and count; `kept` are exchanges that bring one quantity, each
    with the settings under which it was made, and `preparation` the one that brings all that the driver must know.
    `last_move` identifies the move that was ordered last.
    `unsure` are the EEPROM cells that were written and
    may not be kept: what came in between may have closed the lock, behind which a write is obeyed and soon gone.
    """

    if TYPE_CHECKING:
        settings: Settings | None
    else:  # read far more often than set, so without a function of Python
        settings = property(attrgetter("_settings"), _set_settings)

    def __init__(self, node: int) -> None:
        self.node: Final = checked_id(node)
        self.identity: Identity | None = None
        self.table: RegisterMap | None = None
        self.settings = None
        self.alarm: tuple[str, ...] = ()
        self.at = -inf
        self.pending: Pending | None = None
        self.last_move: object = None
        self.bound: int | None = None
        self.former_limits: tuple[float, float] | None = None
        self.unsure: set[int] = set()
        self.questions: Final[dict[tuple[int, int], tuple[bytes, tuple[Expected, ...]]]] = {}
        self.kept: Final[dict[str, tuple[Settings, Request[Any]]]] = {}
        self.preparation: Request[Identity] | None = None

    @property
    def limits(self) -> tuple[float, float] | None:
        """Lowest and highest position in rad, as last read from the servo; None when not read yet."""
        return self.settings.limits if self.settings else None

    @property
    def known_mode(self) -> Mode | None:
        """What it heeds, as last read; None when not read yet, or when no source explains what it is set to."""
        return self.settings.mode if self.settings else None

    @property
    def control(self) -> Control:
        """Which registers of its map play which part; of an unknown map, none does."""
        return CONTROL.get(self.identity.table, _UNKNOWN) if self.identity else _UNKNOWN

    @property
    def writable(self) -> bool:
        """Its register map is known, so that a write does what its name says."""
        return self.identity is not None and bool(self.identity.table)

    def heard(self, error: int, at: float) -> None:
        """A reply came: keep its alarm bits and its time. An alarm never makes a good reply a failure."""
        self.alarm = alarm_names(error, self.table.name if self.table else "sts") if error else ()
        self.at = at

    def forget_settings(self) -> None:
        """They may have changed: read them again before they are used."""
        self.settings = None
        self.bound = None

    def value(self, row: Register, raw: int) -> Value:
        """Raw value of a register -> value in the row's unit, by the settings of this servo.

        The homing offset is taken out of a present position in the modes in which the servo itself leaves it in.
        """
        settings = self.settings
        if settings is None or row.name not in settings.factors:
            return row.to_value(raw)
        if settings.shift and row.name == PRESENT_POSITION:
            raw = settings.compensated(raw)
        return row.to_value(raw) * settings.factors[row.name]

    def raw(self, row: Register, value: Value) -> int:
        """Value in the row's unit -> raw value. Raises RequestError when it is not a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RequestError(
                f"{row.name}: {shown(value)} is not a number",
                advice="give a number; nothing was sent",
                node=self.node,
            )
        factor = self.settings.factors.get(row.name, 1) if self.settings else 1
        return row.to_raw(value / factor if factor != 1 and is_number(value) else value)


def checked_id(node: int) -> int:
    """An id that one servo can have. Raises RequestError for everything else, 254 (everyone) included."""
    if isinstance(node, int) and not isinstance(node, bool) and 0 <= node <= wire.MAX_ID:
        return node
    everyone = node == wire.BROADCAST
    raise RequestError(
        f"{node!r} is not the id of a servo" + (": 254 addresses everyone at once" if everyone else ""),
        expected=f"0 to {wire.MAX_ID}",
        advice="name one servo; `motorbus scan BUS` lists them; nothing was sent",
    )


def as_nodes(ids: Iterable[int | Node]) -> list[Node]:
    """Each as a node, once, in this order; an id alone becomes a node of which nothing is known yet."""
    nodes: dict[int, Node] = {}
    for one in ids:
        node = one if isinstance(one, Node) else Node(one)
        nodes.setdefault(node.node, node)
    return list(nodes.values())


def settings_of(table: RegisterMap, image: bytes) -> Settings:
    """What registers 0 to 39 say, read by the map of the servo."""

    def raw(name: str) -> int:
        row = table[name]
        return row.decode(image[row.address : row.address + row.size])

    def raw_or(name: str, other: int) -> int:
        return raw(name) if name in table else other

    phase, control = raw("phase"), CONTROL[table.name]
    raw_limits = raw("min_position_limit"), raw("max_position_limit")
    many_turns = control.many_turns and raw_limits == (0, 0)
    code = raw("operating_mode") if "operating_mode" in table else None
    mode = mode_of(table.name, code, raw_limits)
    offset = raw_or("homing_offset", 0)
    turns = float(max(1, raw_or("angular_resolution", 1)))
    return Settings(
        limits=_limits(raw_limits, many_turns, table["goal_position"].scale * turns),
        mode=mode,
        mode_code=code,
        offset=offset,
        turn=control.turn,
        many_turns=many_turns,
        accumulates=many_turns_are_told(phase, table.name),
        shift=0 if mode in (Mode.POSITION, None) else offset,
        factors={
            **dict.fromkeys((*_POSITIONS, *_LIMITS), turns),
            **dict.fromkeys(_VELOCITIES, float(velocity_scale(phase, table.name))),
        },
        protection_current=raw("protection_current") if control.current else 0,
        answers_writes=raw("status_return_level") != 0,
        zero_is_maximum=zero_is_maximum(phase, table.name),
        tells_current=tells_current(phase, table.name),
    )


def _limits(raw: tuple[int, int], many_turns: bool, count: float) -> tuple[float, float] | None:
    """In rad. Two zeros mean many turns where the map says so; elsewhere there is no goal that they would admit."""
    low, high = (-MANY_TURNS, MANY_TURNS) if many_turns else raw
    return (low * count, high * count) if low or high else None
