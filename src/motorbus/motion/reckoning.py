"""Dead reckoning: where an axis stands whose device does not tell, by adding up what it was told to do.

A device without feedback begins somewhere. Homing says where it is, or a person does; each movement that came to its
end is added. A stop in the middle, an error or a program makes it unknown again, and the reason is kept for whoever
needs the position next. Everything that comes from here is called *estimated*: a motor that missed a step, or was
turned by hand, tells nobody.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import isfinite
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

from motorbus.core.steps import Runnable, discard
from motorbus.errors import LimitExceeded, MotionError, MotorbusError, NotHomed, RequestError
from motorbus.motion import limits
from motorbus.motion.machine.model import FARTHEST
from motorbus.motion.safety import restarts

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

T = TypeVar("T")

Place: TypeAlias = "tuple[float | None, str]"
"""Where an axis is (rad, m), None while that is not known, and then why."""

NEVER_SAID: Final = "nobody has said where it is since it was opened"
UNDER_WAY: Final = "it is moving"
CUT_SHORT: Final = "a movement was interrupted"


class Movement:
    """One movement of an axis, and what was before it. Whoever moves the axis makes one, and gives it back at the end.

    So an end counts for the movement that it is of, also when another one has begun behind a stop. `accounted` is false
    where nobody is going to say how far it went; `stopped` is true once the axis has accepted a stop meanwhile.
    """

    def __init__(self, *, accounted: bool = True) -> None:
        self.accounted: Final = accounted
        self.stopped = self.engaged = self.under_way = False
        self.place: Place = (None, NEVER_SAID)

    def after(self, way: float) -> Place:
        """Where the axis is when it went so far (rad, m, with its sign)."""
        position, why = self.place
        return (None, why) if position is None else (position + way, "")


class Reckoning:
    """Where one axis is, by dead reckoning: `position` in rad or m, None while that is not known, and then `why`.

    `departed` is where the movement began that is under way, by which what is ordered on its way is judged; None where
    that is not known, or none is under way.
    """

    def __init__(self) -> None:
        self.position: float | None = None
        self.departed: float | None = None
        self.why = NEVER_SAID

    def declare(self, position: float) -> None:
        """It stands there, as somebody knows who has seen it."""
        self.position, self.why, self.departed = position, "", None

    def forget(self, why: str) -> None:
        """Nobody knows any more where it is, and this is why."""
        self.position, self.why, self.departed = None, why, None

    def depart(self) -> Place:
        """A movement begins: gives where it was. Until that has come to its end nothing is known.

        Where an earlier one has not said how it ended nobody knows where it was.
        """
        before = (None, CUT_SHORT) if self.why == UNDER_WAY else (self.position, self.why)
        self.forget(UNDER_WAY)
        self.departed = before[0]
        return before

    def arrive(self, place: Place) -> None:
        """The movement came to its end, or was refused before anything was sent: it is there."""
        self.position, self.why = place
        self.departed = None

    def known(self, name: str) -> float:
        """Where it is. Raises NotHomed, with the reason, while that is not known."""
        if self.position is not None:
            return self.position
        raise NotHomed(
            f"{name}: where it is is not known",
            expected="an axis that was homed, or of which somebody said where it is",
            cause=self.why,
            advice="home it, or declare its position when you have seen it; nothing was sent",
        )

    def __str__(self) -> str:
        return f"not known: {self.why}" if self.position is None else f"{self.position:.6g}, estimated"


def is_reckoned(able: Iterable[str]) -> bool:
    """Whether a device with these capabilities moves and does not tell where it is."""
    names = frozenset(able)
    return "position" not in names and bool(names & {"move_by", "home", "keep_time", "jog"})


def checked_place(name: str, position: float) -> float:
    """A position that a person declares. Raises RequestError for what cannot be one."""
    limits.check_number(f"{name}: its position", position)
    if not isfinite(position):
        raise RequestError(f"{name}: {position!r} is not a finite number", expected="a position in rad or m")
    if abs(position) > FARTHEST:
        raise RequestError(f"{name}: {position:g} is too far", expected=f"at most {FARTHEST:g} rad or m")
    return float(position)


async def journey(axis: AxisVerbs, work: Runnable[T], place: Callable[[Movement, T], Place]) -> T:
    """Carry out a movement of one axis and keep account of it: it is engaged, under way, and at rest afterwards.

    `place` gives, from what was before and what the movement returned, where the axis is then. A refusal that is
    `unmoved` changes nothing; any other end in the middle makes a reckoned position unknown.

    Raises RequestError, with nothing sent, while another movement of a reckoned axis is under way, and Refused while it
    is at fault.
    """
    movement = Movement()
    try:
        restarts.check(axis)
    except MotorbusError:
        discard(work)
        raise
    try:
        axis.departs(movement)
        told = await work
        axis.arrives(movement, place(movement, told))
    except BaseException as error:
        discard(work)  # if it was refused before it began
        cut_short(axis, movement, error)
        raise
    return told


def cut_short(axis: AxisVerbs, movement: Movement, error: BaseException) -> None:
    """A movement of this axis ended by an error: it is where it was when nothing has moved, else nobody knows.

    Of a device that is silent nothing is certain: it may have lost its supply, and been turned.
    """
    if isinstance(error, RequestError | MotionError) and error.unmoved:
        axis.stays(movement)
        return
    said = getattr(error, "summary", "") or str(error) or type(error).__name__
    axis.fails(f"a movement did not come to its end: {said}", movement)


# -- verbs of axes whose device moves by a profile of its own ------------------------------------------------------


async def move_by(axis: AxisVerbs, way: float, *, velocity: float | None = None) -> float:
    """Move by so far (rad, m) at so much (rad/s, m/s; None: as fast as the axis may), by the device's own profile.

    Returns the way that was gone, *estimated*: in whole steps of the motor. Allowed also where the position is not
    known, for that is how an axis gets off its switch. Raises LimitExceeded, with nothing sent, for a way that leads
    out of the limits or is longer than `max_step`, and for too great a velocity; else as the device's own verb.
    """
    check_way(axis, way)
    rate = _rate(axis, velocity)
    return await _gone(axis, axis.able.move_by(axis.device, way * axis.spec.ratio, velocity=rate), way)


async def jog(axis: AxisVerbs, velocity: float, seconds: float) -> float:
    """Move at a velocity (rad/s, m/s, with its sign) for a while (s), then stop. Returns the way, *estimated*.

    Raises LimitExceeded for what `move_by` refuses; else as the device's own verb.
    """
    limits.check_finite(axis.name, "seconds", seconds)
    limits.check_velocity(axis.name, axis.spec, velocity)
    way = velocity * seconds
    check_way(axis, way)
    return await _gone(axis, axis.able.jog(axis.device, velocity * axis.spec.ratio, seconds), way)


async def home(axis: AxisVerbs, *, deadline: float | None = None, velocity: float | None = None) -> float:
    """Go to the switch of the axis, at most for so long (s; None: what is usual there). Returns where that is (rad, m).

    The `velocity` is in rad/s or m/s, above 0; None is that which is set in the device, or `max_velocity` where that is
    less. From then on it is known where the axis stands, *estimated*: its device is at its angle 0 there. Raises
    NotHomed when the switch did not come; LimitExceeded for a velocity above that of the axis; else as the device's own
    verb.
    """
    options = {"at_most" if velocity is None else "velocity": _rate(axis, velocity)}
    if deadline is not None:
        options["deadline"] = deadline
    place = axis.spec.from_device(0.0)
    await journey(axis, axis.able.home(axis.device, **options), lambda *_: (place, ""))
    return place


async def run(axis: AxisVerbs, number: int, *, timeout: float | None = None) -> Any:
    """Run a program that is stored in the device, at most for so long (s), and wait for its end.

    Returns what the device's own verb does. Where the axis stands afterwards is not known, for its program does not
    tell. Raises as the device's own verb.
    """
    options = {} if timeout is None else {"timeout": timeout}
    moved = f"program {number} has moved it"
    return await journey(axis, axis.able.run(axis.device, number, **options), lambda *_: (None, moved))


def check_way(axis: AxisVerbs, way: float) -> None:
    """Raise LimitExceeded for a way that is no number, longer than `max_step`, or leads out of the soft limits.

    Where nobody knows where the axis is, the whole range between its limits is as far as it may go.
    """
    name, spec = axis.name, axis.spec
    limits.check_finite(name, "way", way)
    known = axis.reckoning.position if axis.reckoning is not None else None
    if known is not None:
        limits.check_goal(name, spec, known + way, measured=known)
        return
    limits.check_step(name, spec, way, 0.0)
    if spec.low is not None and spec.high is not None and abs(way) > spec.high - spec.low:
        raise LimitExceeded(
            f"{name}: {spec.show(abs(way))} is more than all its way, and where it is is not known",
            expected=f"at most {spec.show(spec.high - spec.low)}",
            advice="home it first, or go less far; nothing was sent",
        )


def _rate(axis: AxisVerbs, velocity: float | None) -> float:
    """How fast the device is to turn (rad/s)."""
    if velocity is not None:
        limits.check_number(f"{axis.name}: velocity", velocity)
    if velocity is not None and not velocity > 0:
        raise RequestError(
            f"{axis.name}: velocity is {velocity}",
            expected="a number above 0; the sign of the way says where",
            advice="nothing was sent",
        )
    asked = axis.spec.max_velocity if velocity is None else velocity
    limits.check_velocity(axis.name, axis.spec, asked)
    return abs(axis.spec.rate_to_device(asked))


async def _gone(axis: AxisVerbs, work: Runnable[Any], ordered: float) -> float:
    """The way that an axis has gone (rad, m): what its device says it has turned, else what was ordered."""

    def way(told: object) -> float:
        return float(getattr(told, "angle", ordered * axis.spec.ratio)) / axis.spec.ratio

    return way(await journey(axis, work, lambda movement, told: movement.after(way(told))))
