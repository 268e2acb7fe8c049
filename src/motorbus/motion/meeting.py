"""Where the buses of one movement wait for each other: to agree how long it takes, and on the moment it starts.

A procedure on one bus cannot wait for one on another bus by a request. So both look here every few milliseconds. What
they agree on is a moment to come, so how often they look decides nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final, Generic, TypeVar

from motorbus.core.steps import Runnable, Sleep
from motorbus.errors import Interrupted, MotorbusError

T = TypeVar("T")

LOOK: Final = 0.002
"""s between two looks at whether all have come."""
NOTICE: Final = 0.02
"""s from the moment the last one is ready to the earliest start: time for the others to look, also at their axes."""


class Meeting(Generic[T]):
    """All who take part say something and get to know what all have said. `parties` are their names."""

    def __init__(self, parties: Iterable[str]) -> None:
        self.parties: Final = frozenset(parties)
        self._said: dict[str, T] = {}
        self._failed: MotorbusError | None = None

    async def meet(self, name: str, says: T) -> Mapping[str, T]:
        """Say it, and wait until all have. Raises Interrupted when somebody will not come.

        Raises ValueError for somebody who was not asked: whoever waits for all would wait for ever.
        """
        if name not in self.parties:
            raise ValueError(f"{name!r} has no part in this; those who have are {sorted(self.parties)}")
        self._said[name] = says
        while self._said.keys() != self.parties:
            if self._failed is not None:
                raise _called_off(name, self._failed) from self._failed
            await Sleep(LOOK)
        return self._said

    def fail(self, error: MotorbusError) -> None:
        """Somebody will not come, and this is why: whoever waits is told, and whoever comes later.

        Once all have come nothing is changed by this: they go on, every one of them.
        """
        self._failed = self._failed or error


def _called_off(name: str, error: MotorbusError) -> Interrupted:
    return Interrupted(
        f"{name} does not move: another part of the movement cannot begin",
        cause=error.summary,
        advice="see to that; a movement of several begins with all of them or not at all",
    )


class Beat:
    """The meetings of one movement: everyone's duration, then the moment of the start in s on the robot's clock.

    `origin` of a party is what its link's clock showed when the robot's clock was at 0.
    """

    def __init__(self, parties: Iterable[str]) -> None:
        names = tuple(parties)
        self.shortest: Final = Meeting[float](names)
        self.fitted: Final = Meeting[float](names)
        self.ready: Final = Meeting[float](names)

    def of(self, party: str, origin: float) -> Seat:
        """Its part in it: a `core.timing.Timing`."""
        return Seat(self, party, origin)

    def fail(self, error: MotorbusError) -> None:
        """Somebody cannot take part; all who wait, or come to wait, are told."""
        for meeting in (self.shortest, self.fitted, self.ready):
            meeting.fail(error)


class Seat:
    """What one party of a `Beat` sees of it."""

    def __init__(self, beat: Beat, party: str, origin: float) -> None:
        self._beat = beat
        self._party = party
        self._origin = origin

    async def agreed(self, shortest: float, fitted: Callable[[float], float]) -> float:
        """See `core.timing.Timing`."""
        needed = await self._beat.shortest.meet(self._party, shortest)
        longest = max(needed.values())
        offered = await self._beat.fitted.meet(self._party, fitted(longest))
        return max(longest, *offered.values())

    async def start(self, lead: float, meanwhile: Callable[[], Runnable[object]] | None = None) -> float:
        """See `core.timing.Timing`. Once all are ready there is `NOTICE` left; `meanwhile` is done in that time."""
        now = await Sleep(0) - self._origin
        ready = await self._beat.ready.meet(self._party, now + lead)
        moment = max(ready.values()) + NOTICE + self._origin
        if meanwhile is not None:
            await meanwhile()
        await Sleep(max(0.0, moment - lead - await Sleep(0)))
        return moment

    def fails(self, error: BaseException) -> None:
        """See `core.timing.Timing`. Those who have begun already see to that themselves."""
        self._beat.fail(
            error if isinstance(error, MotorbusError) else Interrupted(str(error) or type(error).__name__)
        )
