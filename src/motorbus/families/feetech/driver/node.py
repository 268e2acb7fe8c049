"""What the driver knows of one servo, and what its settings mean for the values that go to and fro.

A node is memory only: no bus, no I/O. Driver functions fill it, every reply adds its alarm bits and its time to
it, and whoever writes a setting makes it forget. Nothing here is ever guessed: unknown stays None.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from math import inf
from typing import Final, NamedTuple

from motorbus.core.entry import Entry, Table, Value
from motorbus.core.family import Identity
from motorbus.core.operation import Goal
from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.table import alarms, tells_current, velocity_scale, zero_is_maximum

COMMANDED: Final = frozenset(("sts",))
"""The register maps this driver writes and moves by. Servos of other maps are read by name, and nothing more: modes,
units and the place of the lock differ, and half of a driver for them would be worse than none."""
IMAGE: Final = 40
"""Bytes of the EEPROM area, registers 0 to 39, which one READ brings."""
MANY_TURNS: Final = 30719
"""Counts to either side when both limits are 0 (7.5 turns). Source: STS3215 memory table V3.6."""
POSITION, VELOCITY, PWM, STEP = range(4)
"""Operating modes of STS servos (register 33)."""

_POSITIONS: Final = ("present_position", "goal_position", "goal_position_echo")
_VELOCITIES: Final = ("present_velocity", "goal_velocity")
SCALED: Final = frozenset((*_POSITIONS, *_VELOCITIES))
"""Rows whose unit depends on settings of the servo (angular resolution, phase)."""

alarm_names: Final = cache(alarms)


class Settings(NamedTuple):
    """What the EEPROM of a servo says about how to talk to it.

    `limits` in rad; None when its map is not known, or two limits of 0 mean what nobody has published. `mode` is the
    operating mode; None where the driver does not command the map, whose modes have other numbers. `factors` multiply
    what a row says of its unit, by row name. `answers_writes` is the status return level. `zero_is_maximum`: a goal
    velocity of 0 means the maximum, otherwise it means standstill. `tells_current`: its bridge measures the current.
    """

    limits: tuple[float, float] | None = None
    mode: int | None = None
    factors: Mapping[str, float] = {}
    answers_writes: bool = True
    zero_is_maximum: bool = True
    tells_current: bool = True


class Node:
    """One servo by its id, 0 to 253, and what is known of it.

    `alarm` holds the names of the alarm bits of the last reply and `at` its arrival on the link's clock (s);
    `pending` what a REG WRITE from here ordered and no ACTION has carried out yet.
    """

    def __init__(self, node: int) -> None:
        self.node: Final = checked_id(node)
        self.identity: Identity | None = None
        self.table: Table | None = None
        self.settings: Settings | None = None
        self.alarm: tuple[str, ...] = ()
        self.at = -inf
        self.pending: tuple[Goal, ...] = ()

    @property
    def limits(self) -> tuple[float, float] | None:
        """Lowest and highest position in rad, as last read from the servo; None when not read yet."""
        return self.settings.limits if self.settings else None

    @property
    def mode(self) -> int | None:
        """Operating mode as last read: 0 position, 1 velocity, 2 PWM, 3 step; None when not read yet."""
        return self.settings.mode if self.settings else None

    @property
    def writable(self) -> bool:
        """Its register map is known and commanded here, so that a write does what its name says."""
        return self.identity is not None and self.identity.table in COMMANDED

    def heard(self, error: int, at: float) -> None:
        """A reply came: keep its alarm bits and its time. An alarm never makes a good reply a failure."""
        self.alarm = alarm_names(error, self.table.name if self.table else "sts") if error else ()
        self.at = at

    def forget_settings(self) -> None:
        """They may have changed: read them again before they are used."""
        self.settings = None

    def value(self, row: Entry, raw: int) -> Value:
        """Raw value of a register -> value in the row's unit, by the settings of this servo."""
        value = row.to_value(raw)
        if self.settings and row.name in self.settings.factors:
            return value * self.settings.factors[row.name]
        return value

    def raw(self, row: Entry, value: Value) -> int:
        """Value in the row's unit -> raw value. Raises RequestError when it is not a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RequestError(
                f"{row.name}: {value!r} is not a number",
                advice="give a number; nothing was sent",
                node=self.node,
            )
        factor = self.settings.factors.get(row.name, 1) if self.settings else 1
        return row.to_raw(value / factor if factor != 1 else value)


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


def settings_of(table: Table, image: bytes) -> Settings:
    """What registers 0 to 39 say, read by the map of the servo."""

    def raw(name: str) -> int:
        row = table[name]
        return row.decode(image[row.address : row.address + row.size])

    phase = raw("phase")
    turns = float(max(1, raw("angular_resolution"))) if "angular_resolution" in table else 1.0
    limits = _limits(table, raw("min_position_limit"), raw("max_position_limit"))
    count = table["goal_position"].scale * turns
    return Settings(
        limits=(limits[0] * count, limits[1] * count) if limits else None,
        mode=raw("operating_mode") if table.name in COMMANDED else None,
        factors={
            **dict.fromkeys(_POSITIONS, turns),
            **dict.fromkeys(_VELOCITIES, float(velocity_scale(phase, table.name))),
        },
        answers_writes=raw("status_return_level") != 0,
        zero_is_maximum=zero_is_maximum(phase, table.name),
        tells_current=tells_current(phase, table.name),
    )


def _limits(table: Table, low: int, high: int) -> tuple[int, int] | None:
    """In counts. Two zeros mean many turns on STS, a motor without limits on SCS, and who knows what elsewhere."""
    if low or high:
        return low, high
    return (-MANY_TURNS, MANY_TURNS) if table.name in COMMANDED else None
