"""Devices that are ordered in one packet again and again, as a control loop orders them: all are judged in one pass.

A gate checks each of them in every cycle against bounds that stay the same, so the bounds are laid out once per
`SetpointGroup`, for as long as the guards are the same. The result is what `Gate` and `Guard.is_fine` find one by one,
in the same order; a test proves that. Microseconds count here, so this is one function and not four.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from motorbus.core.family import Quality
from motorbus.core.request import Request, Response, SetpointGroup
from motorbus.core.setpoint import Setpoint
from motorbus.motion.safety.guard import Guard, untold
from motorbus.motion.safety.track import FRESH, TREMBLING, Sample, Track

Heard = tuple[Request[Any], Response]
"""The last exchange that told where a node is, and its answer."""
Where = Callable[[Request[Any], Response], Mapping[int, float]]
"""Where those are (rad) whom an answer tells of."""

FLOCKS: Final = 8
"""Aims that are kept in mind by one gate."""
_NEW: Final = Quality.FRESH
_made: Final = tuple.__new__


class Seat(NamedTuple):
    """One of them: its node, its guard, and by what that bounds it."""

    node: int
    guard: Guard
    track: Track
    low: float
    high: float
    near: float


class Flock:
    """Those whom one aim is for, by their guards: each of them has one, and tells where it is."""

    __slots__ = ("_guards", "_ordered", "_seats", "_tells")

    def __init__(self, ordered: Sequence[int], guards: Sequence[Guard], seats: Sequence[Seat]) -> None:
        self._ordered: Final = ordered
        self._guards: Final = guards
        self._seats: Final = tuple(seats)
        self._tells: Final = [guard.ordered for guard in guards if guard.ordered is not untold]

    def holds(self, guards: Mapping[int, Guard]) -> bool:
        """Whether their guards are those that it was made of."""
        return list(map(guards.get, self._ordered)) == self._guards

    def are_fine(
        self, goals: Sequence[Setpoint], seen: Mapping[int, Heard], where: Where, now: float
    ) -> bool:
        """Whether each of these leads to a place that is surely allowed; see `Guard.is_fine`.

        What was heard of each since is taken in on the way, up to the first that is not.
        """
        if len(goals) != len(self._seats):
            return False
        last: Response | None = None
        places: Mapping[int, float] = {}
        for (node, quantity, to, least, most, stays), (its, guard, track, low, high, near) in zip(
            goals, self._seats, strict=True
        ):
            if node != its or quantity != "position" or stays is not None or least is None or most is None:
                return False
            heard = seen.get(node)
            if heard is not None and (answer := heard[1]) is not guard.answer:
                if answer is not last:
                    places, last = where(*heard), answer
                here, at = places.get(node), answer.at
                if here is not None:
                    before = track.sample
                    if before is not None and at >= before.at and abs(here - before.value) <= TREMBLING:
                        track.suspect = None
                        track.sample = _made(Sample, (here, at, _NEW))  # as `Track.take` does
                    else:
                        track.take(here, at)
                # last, so that an interrupt between these lines leaves it to be taken in once more
                guard.answer = answer
            if not least <= to <= most or track.suspect is not None or (sample := track.sample) is None:
                return False
            if not (now - sample[1] <= FRESH and low <= to <= high and abs(to - sample[0]) <= near):
                return False
        return True

    def tell(self) -> None:
        """They were ordered to move: whoever has set their guards is to know."""
        for tell in self._tells:
            tell(True)


class Flocks:
    """The flocks of one gate, by the aims of the orders that it was asked about lately."""

    __slots__ = ("_known",)

    def __init__(self) -> None:
        self._known: dict[SetpointGroup, Flock] = {}

    def of(self, aim: SetpointGroup | None, guards: Mapping[int, Guard]) -> Flock | None:
        """The one of this aim; None where one of them has no guard, or none that knows where it is."""
        flock = self._known.get(aim)  # type: ignore[arg-type]  # None is never there
        if flock is not None and flock.holds(guards):
            return flock
        return None if aim is None else self._laid(aim, guards)

    def _laid(self, aim: SetpointGroup, guards: Mapping[int, Guard]) -> Flock | None:
        self._known.pop(aim, None)
        its, seats = [], []
        for node in aim.nodes:
            guard = guards.get(node)
            if guard is None or guard.track is None:
                return None
            its.append(guard)
            seats.append(Seat(node, guard, guard.track, *guard.reach))
        if len(self._known) >= FLOCKS:
            self._known.clear()
        flock = self._known[aim] = Flock(aim.nodes, its, seats)
        return flock
