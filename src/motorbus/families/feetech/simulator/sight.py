"""All that a host could read of a servo at a moment, as a value that is cheap to make and to compare.

What a servo works out when it is read stands in its memory as it was when it was read last; here it is worked out anew.
Most servos stand still most of the time, and then only three of those rows can change by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Final, NamedTuple

from motorbus.core.plant import Motion
from motorbus.families.feetech.simulator.feedback import FEEDBACK
from motorbus.families.feetech.simulator.memory import Layout, code
from motorbus.families.feetech.simulator.servo import Servo

_REPEATS: Final = {"goal_position_echo": "goal_position"}
"""Rows that show what another one holds."""
_RESTLESS: Final = ("present_voltage", "present_temperature", "hardware_error")
"""Rows that may change while it stands still and nobody writes to it."""


class Seen(NamedTuple):
    """A picture: the layout of the memory, its bytes, what the restless rows tell, and what the others do."""

    layout: Layout
    live: bytes
    restless: tuple[int, ...]
    others: tuple[int, ...]


class Last(NamedTuple):
    """The last picture of a servo, and what decided about its other rows."""

    motion: Motion
    zero: int
    pending: object
    seen: Seen


class Sight:
    """Makes pictures of servos."""

    def __init__(self) -> None:
        self._asked: dict[Layout, tuple[Callable[[Servo, float], int], ...]] = {}
        self._last: dict[Servo, Last] = {}
        self._restless = tuple(FEEDBACK[name] for name in _RESTLESS)

    def all(self, servos: Iterable[Servo], at: float) -> list[tuple[int, tuple[Hashable, ...]]]:
        """The id and the picture of each."""
        return [(servo.id, self._of(servo, at)) for servo in servos]

    def _of(self, servo: Servo, at: float) -> Seen:
        live, motion = bytes(servo.memory.live), servo.motion
        voltage, temperature, error = self._restless
        restless = (voltage(servo, at), temperature(servo, at), error(servo, at))
        last = self._last.get(servo)
        still = not motion.phases and not motion.cruise and servo.push is None and not servo.torque
        if last is not None and still and last.motion is motion:
            known = last.zero == servo.zero and last.pending is servo.pending and last.seen.live == live
            if known:
                return last.seen if restless == last.seen.restless else last.seen._replace(restless=restless)
        seen = Seen(servo.memory.layout, live, restless, self._others(servo, at))
        self._last[servo] = Last(motion, servo.zero, servo.pending, seen)
        return seen

    def _others(self, servo: Servo, at: float) -> tuple[int, ...]:
        layout = servo.memory.layout
        asked = self._asked.get(layout)
        if asked is None:
            asked = self._asked[layout] = tuple(FEEDBACK[name] for name in _others_of(layout))
        return tuple([ask(servo, at) for ask in asked])


def _others_of(layout: Layout) -> list[str]:
    """The feedback rows of a memory that a servo at rest goes on telling, in order."""
    return [name for name in FEEDBACK if name in layout.table and name not in (*_REPEATS, *_RESTLESS)]


def shown(seen: Seen, name: str) -> int:
    """The raw value of a row in a picture, as a host would read it. Raises RequestError for a row that is not there."""
    layout = seen.layout
    entry = layout.table[name]
    if name in _RESTLESS:
        return entry.decode(code(entry, seen.restless[_RESTLESS.index(name)]))
    if name in FEEDBACK and name not in _REPEATS:
        return entry.decode(code(entry, seen.others[_others_of(layout).index(name)]))
    source = layout.table[_REPEATS.get(name, name)]
    raw = source.decode(seen.live[source.address : source.address + source.size])
    return raw if source is entry else entry.decode(code(entry, raw))
