"""Axes of the machine file moved together, for every command that does so: what is wanted, asked, shown and told."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from motorbus.cli.consent import consent_to
from motorbus.cli.machine import axes_named, is_name, machine
from motorbus.cli.rates import time_of
from motorbus.cli.robot import InHand, able, place, rehearse
from motorbus.core import units
from motorbus.errors import NotHomed, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.motion.moving.moved import Moved

Kind = Literal["trapezoid", "minimum_jerk"]
FAR: Final = pi
"""rad; a longer way of an axis needs somebody's agreement."""
FAR_LINEAR: Final = 0.1
"""m; the same of a linear axis."""


class Goal(NamedTuple):
    """Where an axis shall go (rad, m), or by how far when it is a `way` from where it stands."""

    value: float
    way: bool


class How(NamedTuple):
    """How they go there: in so many s (None: as quick as they may), by this profile, at this share of their limits."""

    duration: float | None = None
    kind: Kind = "trapezoid"
    speed: float = 1.0


class Known(NamedTuple):
    """What to do about axes that do not know where they are: where they stand (rad, m), or that they home first."""

    stands: Mapping[str, float]
    home: bool


# -- what is wanted ----------------------------------------------------------------------------------------------------


def names_axes(text: str) -> bool:
    """Whether a goal, as `shoulder=30deg` or `lift+=5mm`, is one for axes of the machine file."""
    return is_name(text.rpartition("=")[0].removesuffix("+").removesuffix("-") or text)


def goals_of(texts: Iterable[str]) -> dict[str, Goal]:
    """Goals by axis. Raises RequestError for a name or a position that is none, and for an axis named twice."""
    found: dict[str, Goal] = {}
    for text in texts:
        head, equals, position = text.rpartition("=")
        if not equals:
            raise RequestError(
                f"{text}: where to?", expected="AXIS=POSITION, as shoulder=30deg", advice="nothing was sent"
            )
        way = head.endswith(("+", "-"))
        for axis in axes_named((head[:-1] if way else head,)):
            value = _position(axis, position)
            once(axis, found, text)
            found[axis] = Goal(-value if head.endswith("-") else value, way)
    return found


def _position(axis: str, text: str) -> float:
    """A position of this axis (rad, m). Raises RequestError, naming it, for what is none."""
    from motorbus.motion.several import named

    try:
        return machine().axes[axis].parse(text)
    except RequestError as error:
        raise named(axis, error) from None


def positions_of(texts: Iterable[str]) -> dict[str, float]:
    """Positions (rad, m) by axis, as `lift=0mm`. Raises RequestError as `goals_of`, and for a way."""
    words = [one for text in texts for one in text.split(",")]
    for word in words:
        if "=" not in word:
            raise RequestError(
                f"--assume {word}: where does it stand?",
                expected="AXIS=POSITION, as lift=0mm",
                advice="nothing was sent",
            )
    found = goals_of(words)
    for axis, goal in found.items():
        if goal.way:
            raise RequestError(f"{axis}: a place is wanted, not a way", expected=f"{axis}=POSITION")
    return {axis: goal.value for axis, goal in found.items()}


def once(axis: str, found: Mapping[str, object], text: str) -> None:
    """Raise RequestError for an axis that was named before."""
    if axis in found:
        raise RequestError(f"{text}: {axis} is named twice", advice="nothing was sent")


def how_of(duration: str, kind: Kind, speed: str) -> How:
    """How they shall go, from what was typed. Raises RequestError for what is no duration and no share."""
    fastest = "leave it out to go as quickly as the limits allow"
    seconds = time_of(duration, "--duration", fastest) if duration else None
    try:
        share = units.parse(speed, "load") if speed else 1.0
    except RequestError:
        share = 0.0
    if not 0 < share <= 1:
        raise RequestError(
            f"--speed {speed}: it is a share of the limits in the machine file",
            expected="above 0, at most 1, or 50%",
            advice="nothing was sent",
        )
    return How(seconds, kind, share)


# -- before they go ----------------------------------------------------------------------------------------------------


def settle(hand: InHand, names: Iterable[str], known: Known, *, yes: bool, dry_run: bool) -> None:
    """See to it that axes without feedback know where they are, as far as somebody has said how.

    Raises RequestError for one that measures its position, NeedsConsent when nobody agrees to homing.
    """
    for name, stands in known.stands.items():
        if not hasattr(hand.robot[name], "declare"):
            raise RequestError(
                f"{name} measures where it is",
                expected="--assume for axes that do not",
                advice="nothing was sent",
            )
        hand.robot[name].declare(stands)
    lost = [name for name, at in hand.robot.positions(list(names)).items() if at is None]
    if not known.home or not lost:
        return
    for name in lost:
        able(hand, name, "home")
        if dry_run:
            hand.robot[name].declare(hand.robot.machine.axes[name].from_device(0.0))
    if dry_run:
        hand.output.note(f"note: {', '.join(lost)} would home first; what is shown begins at the switch")
        return
    consent_to(f"home {', '.join(lost)}: each moves until its switch is met", hand.output, yes=yes)
    with hand.working("homing"), hand.robot.attended():
        hand.robot.home(lost)


def absolute(hand: InHand, goals: Mapping[str, Goal]) -> tuple[dict[str, float], dict[str, float]]:
    """Where the axes are and where they go to (rad, m). Raises NotHomed for one that does not know where it is."""
    places = hand.robot.positions(list(goals))
    present = {name: at for name, at in places.items() if at is not None}
    lost = [name for name in goals if name not in present]
    if lost:
        raise NotHomed(
            f"{', '.join(lost)}: it is not known where it stands",
            expected=f"--assume {lost[0]}=0{hand.robot.machine.axes[lost[0]].unit}, what it stands at; or --home",
            cause="its device does not tell, and nothing is remembered from one command to the next",
            advice=f"`motorbus home {lost[0]}` finds its switch alone; nothing moved",
        )
    return present, {name: one.value + (present[name] if one.way else 0.0) for name, one in goals.items()}


def consent_to_far(
    hand: InHand, present: Mapping[str, float], goals: Mapping[str, float], *, yes: bool
) -> None:
    """Ask before an axis goes far. Raises NeedsConsent when nobody agrees, LimitExceeded for what is refused anyway."""
    axes = hand.robot.machine.axes
    ways = {name: abs(goal - present[name]) for name, goal in goals.items()}
    far = [name for name, way in ways.items() if way > (FAR_LINEAR if axes[name].linear else FAR)]
    if far and not yes:
        inside(hand, present, goals)
        hand.output.consent(
            f"move {', '.join(f'{one} by {axes[one].show(ways[one])}' for one in far)}", yes=False
        )


def inside(hand: InHand, present: Mapping[str, float], goals: Mapping[str, float]) -> None:
    """Raise LimitExceeded for the first goal outside the limits of its axis, or of its device."""
    from motorbus.motion import limits

    for name, goal in goals.items():
        axis = hand.robot[name]
        at_once = None if "stream" in axis.able else present[name]
        limits.check_goal(
            name, axis.spec, goal, measured=at_once, device=axis.bus.run(limits.of_device(axis))
        )


# -- a rehearsal -------------------------------------------------------------------------------------------------------


def plan(
    hand: InHand, command: str, present: Mapping[str, float], goals: Mapping[str, float], how: How
) -> None:
    """Show how they would go: no frames, for those are made on the way, many times a second, from what is read then.

    Raises LimitExceeded and RequestError for what the movement would be refused for.
    """
    from motorbus.motion import limits
    from motorbus.motion.profile import Move, synchronised

    inside(hand, present, goals)
    axes = hand.robot.machine.axes
    moves = {
        name: Move(present[name], goal, limits.limits_for(name, axes[name], speed=how.speed))
        for name, goal in goals.items()
    }
    found = synchronised(moves, kind=how.kind, duration=how.duration)
    facts = [{"name": name, "present": present[name], "goal": goal} for name, goal in goals.items()]
    limited = found.limited_by._asdict()
    hand.output.document(
        f"motorbus.{command}.plan/1", {"axes": facts, "duration": found.duration, "limited_by": limited}
    )
    rows = [
        (
            name,
            place(hand.robot, name, present[name]),
            axes[name].show(goal),
            axes[name].show(goal - present[name]),
        )
        for name, goal in goals.items()
    ]
    hand.output.table("", ["axis", ">present", ">goal", ">way"], rows)
    hand.output.text(
        f"would take {found.duration:.3g} s ({_why(limited)}); nothing was sent. "
        "Its frames are made on the way, from what is read then, so none can be shown."
    )


# -- the movement ------------------------------------------------------------------------------------------------------


def lead(hand: InHand, command: str, goals: Mapping[str, float], how: How) -> None:
    """Move them and tell what came of it. Raises what the movement raises."""
    with hand.working("moving"):
        moved = hand.robot.move(dict(goals), **how._asdict())
    tell(hand, command, moved)


def step(hand: InHand, command: str, name: str, way: float, *, yes: bool, dry_run: bool) -> None:
    """Move one axis by so far (rad, m), of which nobody knows where it is: so it gets off its switch."""
    axis, spec = hand.robot[name], hand.robot.machine.axes[name]
    if dry_run:
        rehearse(hand, [name], lambda one: one.move_by(way))
        return
    if abs(way) > (FAR_LINEAR if spec.linear else FAR) and not yes:
        rehearse(hand, [name], lambda one: one.move_by(way), show=False)
        hand.output.consent(f"move {name} by {spec.show(way)}", yes=False)
    with hand.working("moving"):
        gone = axis.move_by(way)
    hand.output.document(f"motorbus.{command}.by/1", {"axis": name, "by": gone, "estimated": True})
    hand.output.text(f"{name}: by {spec.show(gone)} (estimated); where it stands is not known")


def go(
    hand: InHand, command: str, goals: Mapping[str, Goal], how: How, known: Known, *, yes: bool, dry_run: bool
) -> None:
    """All of it: where they are, who agrees, the movement or its plan, and what came of it."""
    settle(hand, goals, known, yes=yes, dry_run=dry_run)
    lone = next(iter(goals)) if len(goals) == 1 else ""
    if (
        lone
        and goals[lone].way
        and hand.robot.positions([lone])[lone] is None
        and "move_by" in hand.robot[lone].able
    ):
        step(hand, command, lone, goals[lone].value, yes=yes, dry_run=dry_run)
        return
    present, wanted = absolute(hand, goals)
    if dry_run:
        plan(hand, command, present, wanted, how)
        return
    consent_to_far(hand, present, wanted, yes=yes)
    lead(hand, command, wanted, how)


def tell(hand: InHand, command: str, moved: Moved) -> None:
    """Print what came of a movement."""
    axes, output = hand.robot.machine.axes, hand.output
    facts = [
        {"name": name, "goal": one.goal, "present": one.present, "error": one.present - one.goal}
        | {"estimated": one.estimated}
        for name, one in moved.axes.items()
    ]
    limited = moved.limited_by._asdict()
    whole = {"duration": moved.duration, "limited_by": limited}
    apart = {"started_apart": moved.started_apart, "ended_apart": moved.ended_apart}
    output.document(f"motorbus.{command}.axes/1", {"axes": facts, **whole, **apart})
    rows = [_row(name, axes[name], one) for name, one in moved.axes.items()]
    output.table("", ["axis", ">goal", ">present", ">error", ""], rows)
    text = f"{moved.duration:.3g} s ({_why(limited)})"
    if len(moved.axes) > 1:
        text += f"; orders left within {_ms(moved.started_apart)}, ended within {_ms(moved.ended_apart)} of each other"
    output.text(text)


def _row(name: str, spec: Any, one: Any) -> tuple[str, ...]:
    places = (_unsigned(spec.show(value)) for value in (one.goal, one.present, one.present - one.goal))
    return (name, *places, "estimated" if one.estimated else "")


def _unsigned(text: str) -> str:
    """A place as it is shown; one that is shown as nothing has no sign."""
    return text if set(text) & set("123456789") else text.removeprefix("-")


def _why(limited: Mapping[str, str]) -> str:
    if limited["axis"]:
        return f"{limited['reason']} of {limited['axis']}"
    return {"duration": "as asked for", "nothing": "all are there"}.get(limited["reason"], limited["reason"])


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.3g} ms"
