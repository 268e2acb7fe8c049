"""What a loop says went wrong: it was asked for what cannot be, somebody else has the command, nobody was heard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from motorbus.core.register import shown
from motorbus.core.units import MAX_RATE, MIN_RATE
from motorbus.errors import Interrupted, NoReply, RequestError
from motorbus.motion.limits import check_number

if TYPE_CHECKING:
    from motorbus.motion.loop.place import Place


def check_loop(rate: float) -> None:
    """Raise RequestError for what cannot be."""
    check_number("rate", rate)
    if not MIN_RATE <= rate <= MAX_RATE:
        raise RequestError(
            f"rate is {shown(rate)}",
            expected=f"cycles per second: {MIN_RATE:g} to {MAX_RATE:g}",
            advice="choose such a rate; nothing was sent",
        )


def as_number(name: str, goal: object) -> float:
    """The goal of this axis as it is (rad, m). Raises RequestError for what is no number."""
    try:
        if isinstance(goal, int | float) and not isinstance(goal, bool):
            return float(goal)
    except OverflowError:
        pass
    raise RequestError(
        f"the goal of {name} is {shown(goal)}", expected="a number (rad, m)", advice="nothing was sent"
    )


def stopped(names: Sequence[str]) -> Interrupted:
    """The error for axes that somebody else has stopped, let go or told to move while they were led."""
    return Interrupted(
        f"{', '.join(names)}: stopped from elsewhere, so the loop gives no more goals",
        cause="while the loop led it, it was stopped, held, let go or told to move by somebody else",
        advice="set a new goal to lead it again; after an emergency stop, reset() first",
    )


def silence(names: Sequence[str], cycles: int, places: Mapping[str, Place], now: float) -> NoReply:
    """The error for axes that have not been heard for so many cycles."""
    ages = ", ".join(f"{name} for {now - places[name].heard:.3g} s" for name in names)
    return NoReply(
        f"{', '.join(names)}: no reading in {cycles} cycles of the loop",
        expected="a position of each axis in each cycle",
        cause=f"no power, a loose cable, or too much noise; silent: {ages}",
        advice="see to that; the other axes were left where their goals are",
    )
