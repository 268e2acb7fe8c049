"""One movement of axes on any number of buses: all of them begin it at the same moment, or none does.

It comes in steps that every part of it goes through (`parts`): find out where the axes stand, meet and plan, agree on
how long it takes, make ready, agree on the moment, go, arrive. Axes that can be led are one part for each bus; an axis
that moves by a profile of its own is a part by itself. Whatever goes wrong before the moment, nobody moves; afterwards,
all are stopped. Here is what the parts share, and what becomes of their results.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from motorbus.core.steps import gather
from motorbus.errors import Interrupted, MotorbusError, RequestError
from motorbus.motion.command import Command
from motorbus.motion.meeting import Beat, Meeting, Seat
from motorbus.motion.moving import parts
from motorbus.motion.moving.moved import Moved
from motorbus.motion.moving.plan import Fact, Gone, Plan, Planned
from motorbus.motion.moving.stream import Fate
from motorbus.motion.parallel import Parallel
from motorbus.motion.profile import Limiting
from motorbus.motion.profile.shapes import NOTHING
from motorbus.motion.safety import restarts

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

ROUNDING: Final = 1e-6
"""Of a duration; less is no difference."""


class Journey:
    """A movement of these `axes`, by their names; `origins` as in a `Body`. `rate` (Hz) is that of what is led.

    `tolerance` (rad, m) is how near to its goal each that is led must come, `timeout` (s) how long after the end at the
    latest; None: as usual. Raises Refused for an axis that is at fault.
    """

    def __init__(
        self,
        axes: Mapping[str, AxisVerbs],
        plan: Plan,
        origins: Mapping[str, float],
        rate: float | None = None,
        *,
        tolerance: float | None = None,
        timeout: float | None = None,
    ) -> None:
        self.tolerance: Final = tolerance
        self.timeout: Final = timeout
        self.plan: Final = plan
        self.rate: Final = rate
        self.fate: Final = Fate()
        self.commands: Final[list[Command]] = []
        self.unstopped: Final[dict[str, MotorbusError]] = {}
        self.needs: Final[dict[str, float]] = {}
        self.outline: Planned | None = None
        self.duration = 0.0
        self._axes: Final = axes
        self._origins: Final = origins
        self._parties: Final = _parties(axes)
        for axis in axes.values():
            restarts.check(axis)
        self._facts: Final = Meeting[Mapping[str, Fact]](self._parties)
        self._beat: Final = Beat(self._parties)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its axes."""
        return tuple(self._axes)

    # -- as work on buses ----------------------------------------------------------------------------------------------

    def work(self) -> Parallel[Moved]:
        """The work on each bus, and what comes of it."""
        buses = dict.fromkeys(axis.spec.bus for axis in self._axes.values())
        return Parallel({bus: self.on(bus) for bus in buses}, self.combine)

    async def on(self, bus: str) -> list[Gone]:
        """All that is to do on one bus."""
        there = {party: axes for party, axes in self._parties.items() if axes[0].spec.bus == bus}
        return list(await gather(*[parts.part(self, party, axes) for party, axes in there.items()]))

    def combine(self, results: Mapping[str, Any]) -> Moved:
        """What came of the whole. Raises what went wrong first, with a note for each axis that did not stop."""
        errors = [told for told in results.values() if isinstance(told, MotorbusError)]
        if errors:
            raise self._noted(self.fate.failure or errors[0], errors)
        gone = {bus: one for bus, told in results.items() for one in told}
        axes = {name: one for told in results.values() for part in told for name, one in part.axes.items()}
        tracks = {
            name: one for told in results.values() for part in told for name, one in part.tracks.items()
        }
        cycles = {
            bus: part.cycles for bus, told in results.items() for part in told if part.cycles is not None
        }
        assert self.outline is not None or not gone
        return Moved(
            self.duration,
            {name: axes[name] for name in self._axes},
            self._limited_by(),
            {name: tracks[name] for name in self._axes},
            cycles,
        )

    def _limited_by(self) -> Limiting:
        """What the plan says, unless a device that moves by its own profile needs longer than that."""
        if self.outline is None:
            return Limiting("", "nothing")
        slowest = max(self.needs, key=lambda name: self.needs[name], default="")
        if slowest and self.needs[slowest] > self.outline.course.duration * (1 + ROUNDING):
            return Limiting(slowest, "velocity")
        return self.outline.limited_by

    def _noted(self, error: MotorbusError, errors: list[MotorbusError]) -> MotorbusError:
        said = {str(error)}
        for other in errors:
            if not isinstance(other, Interrupted) and str(other) not in said:
                said.add(str(other))
                error.add_note(f"also: {other}")
        for name, failure in self.unstopped.items():
            if not isinstance(failure, Interrupted):
                error.add_note(f"{name} did not accept the stop that followed: {failure}")
        return error

    # -- what the parts share ------------------------------------------------------------------------------------------

    def fail(self, error: BaseException) -> None:
        """A part cannot go on: who has not begun does not begin, who is under way stops."""
        known = error if isinstance(error, MotorbusError) else _interrupted(error)
        self._facts.fail(known)
        self._beat.fail(known)
        self.fate.fail(known)

    def check(self) -> None:
        """Raise Interrupted when a part has failed, or somebody else has told one of the axes something since."""
        self.fate.check()
        for command in self.commands:
            command.check()

    def seat(self, party: str, bus: str) -> Seat:
        """How a part keeps time with the others."""
        return self._beat.of(party, self._origins[bus])

    async def meet(self, party: str, facts: Mapping[str, Fact]) -> Mapping[str, Fact]:
        """Say where these axes stand, and get to know where all do."""
        told = await self._facts.meet(party, facts)
        return {name: fact for one in told.values() for name, fact in one.items()}

    def outlined(self, facts: Mapping[str, Fact]) -> Planned:
        """The movement as quick as it may be, or as long as was asked for. Raises what refuses it."""
        self.outline = self.plan.planned(facts, self.plan.asked)
        return self.outline

    def check_asked(self, name: str, shortest: float) -> None:
        """Raise RequestError when an axis that moves by its own profile needs longer than was asked for (s)."""
        self.needs[name] = shortest
        asked = self.plan.asked
        if asked is not None and shortest > asked * (1 + ROUNDING):
            raise RequestError(
                f"{asked:.6g} s is too short: {name} needs {shortest:.4g} s",
                expected=f"{shortest:.4g} s or more",
                cause=f"how fast the device of {name} goes by its own profile, and how it speeds up",
                advice=f"give it more time, or leave the duration out for the quickest; {NOTHING}",
            )

    def agreed(self, facts: Mapping[str, Fact], duration: float) -> Planned:
        """The movement in the time (s) that all have agreed on."""
        self.duration = duration
        return self.plan.planned(facts, duration)

    def reports(self, party: str) -> bool:
        """Whether this part tells the progress of all."""
        return party == next(iter(self._parties))


def _parties(axes: Mapping[str, AxisVerbs]) -> dict[str, list[AxisVerbs]]:
    """The parts of a movement: the axes of a bus that are led, and each axis that moves by its own profile.

    Raises RequestError for an axis that can be moved in neither way.
    """
    found: dict[str, list[AxisVerbs]] = {}
    for name, axis in axes.items():
        if "stream" in axis.able:
            found.setdefault(axis.spec.bus, []).append(axis)
        elif "keep_time" in axis.able:
            found[name] = [axis]
        else:
            raise RequestError(
                f"{name}: {axis.spec.device} cannot be moved to a position",
                expected="a device that takes goals, or one that can keep time with others",
                advice=f"leave it out; {NOTHING}",
            )
    return dict(sorted(found.items(), key=lambda one: "stream" not in one[1][0].able))


def _interrupted(error: BaseException) -> Interrupted:
    return Interrupted(
        "the movement was interrupted",
        cause=str(error) or type(error).__name__,
        advice="all its axes were told to stop; give the order again if it is still wanted",
    )
