"""What one cycle of a loop brought: where the axes are, who was not heard, how old each position is, and how far it can
be believed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.core.family import Quality
from motorbus.motion.loop.errors import silence

if TYPE_CHECKING:
    from motorbus.motion.loop.cycle import Part
    from motorbus.motion.loop.grid import Statistics
    from motorbus.motion.loop.place import Place

PATIENCE: Final = 5
"""Cycles in a row in which an axis may be silent, or tell what cannot be believed, before it is an error."""
SILENCE: Final = 0.3
"""s for which it may be silent besides, as while axes are led: a servo that has missed a reply is left alone for a
while, and a computer that is busy answers late. It is not ordered meanwhile."""
NOBODY: Final[frozenset[str]] = frozenset()
NOWHERE: Final[Mapping[str, float]] = MappingProxyType({})
SURE: Final[Mapping[str, Quality]] = MappingProxyType({})


class Silence(NamedTuple):
    """Since when (s of robot time) an axis is silent that was heard then last, or was told to be, and how many silent
    cycles there were before that."""

    heard: float
    since: float
    cycles: int


def is_overdue(place: Place, at: float, least: float) -> bool:
    """Whether it has been silent for more than `PATIENCE` cycles and `least` s by now; then again as long after that.

    A cycle that waits in vain lasts longer than others, and where the computer is held up there are none: so both
    count. To be asked in each cycle in which it is silent.
    """
    before = place.silence
    if before is None or before.heard != place.heard or place.silent < before.cycles:
        before = place.silence = Silence(place.heard, at - place.period, 0)
    if place.silent - before.cycles <= PATIENCE or at - before.since <= least - place.period / 2:
        return False
    place.silence = Silence(place.heard, at, place.silent)
    return True


class LoopState:
    """What one cycle of a loop brought.

    `at`        when the readings were in, s of robot time
    `number`    of its slot on the grid of the loop; slots that were skipped are missing
    `position`  where each axis is (rad, m) by name, as it was heard last and can be believed
    `missing`   the names of those that were not heard in this cycle
    `age`       how old the position of each is at that moment, s by name: buses do not answer at the same time
    `quality`   what came of each in this cycle, by name: FRESH; REPEATED, of who was not heard; SUSPECT, of who cannot
                be where he said he was: his position is the one before, and he gets no goal until another reading
                agrees; CONFIRMED, where one does
    `doubts`    the same of those only who are SUSPECT or CONFIRMED
    """

    __slots__ = ("_ages", "at", "doubts", "missing", "number", "position")

    def __init__(
        self,
        at: float,
        number: int,
        position: Mapping[str, float],
        missing: frozenset[str],
        ages: Callable[[float], dict[str, float]],
        doubts: Mapping[str, Quality] = SURE,
    ) -> None:
        self.at = at
        self.number = number
        self.position = position
        self.missing = missing
        self.doubts = doubts
        self._ages = ages

    @property
    def age(self) -> dict[str, float]:
        """How old the position of each axis is (s), by name."""
        ages = self._ages(self.at)
        return {name: ages[name] for name in self.position}

    @property
    def quality(self) -> dict[str, Quality]:
        """How far what was heard of each axis in this cycle can be believed, by name."""
        return {
            name: self.doubts.get(name, Quality.REPEATED if name in self.missing else Quality.FRESH)
            for name in self.position
        }

    def __repr__(self) -> str:
        silent = f", missing {', '.join(sorted(self.missing))}" if self.missing else ""
        doubted = "".join(f", {name} {quality.value}" for name, quality in self.doubts.items())
        return f"<LoopState {self.number} at {self.at:.6g} s{silent}{doubted}>"


def state_of(
    parts: Mapping[str, Part],
    told: Mapping[str, Any],
    places: Iterable[Place],
    missing: list[str],
    at: float,
    number: int,
    statistics: Statistics,
) -> LoopState:
    """What a cycle brought, by what was `told` on each bus; `missing` are those who were not heard.

    Raises NoReply for who has been silent, or cannot be believed, for too long; then again as long after that.
    """
    position = {place.name: place.position for place in places}
    doubts = SURE
    for part in parts.values():
        if part.doubts:
            doubts = {**doubts, **part.doubts}
    if not missing and not doubts:
        return LoopState(at, number, position, NOBODY, partial(_ages, parts, told, NOWHERE))
    for name in missing:
        statistics.lost[name] += 1
    for name, quality in doubts.items():
        statistics.suspect[name] += quality is Quality.SUSPECT
    unheard = {place.name: place for place in places if place.silent}
    silent = [
        name for name, place in unheard.items() if is_overdue(place, at, 0.0 if name in doubts else SILENCE)
    ]
    if silent:
        raise silence(silent, unheard[silent[0]].silent, unheard, at)
    heard = {name: place.heard for name, place in unheard.items()}
    return LoopState(at, number, position, frozenset(missing), partial(_ages, parts, told, heard), doubts)


def _ages(
    parts: Mapping[str, Part], told: Mapping[str, Any], before: Mapping[str, float], at: float
) -> dict[str, float]:
    """How old (s) a position is that came with what was told in this cycle, or was heard `before`."""
    heard: dict[str, float] = {}
    for bus, part in parts.items():
        heard |= part.heard(told[bus])
    heard |= before
    return {name: max(0.0, at - moment) for name, moment in heard.items()}
