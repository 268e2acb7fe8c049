"""One thing done to each of several axes on a bus, and what came of it told for all of them together.

A machine with a dead axis still has others. So everyone is visited, what went wrong is kept until then, and one error
names all whom it befell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from re import escape, search
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from motorbus.core.steps import Runnable, catch, gather, with_cleanup
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

T = TypeVar("T")

Act: TypeAlias = "Callable[[AxisVerbs], Runnable[T]]"
Told: TypeAlias = "dict[str, Any]"
"""What came of each axis, by its name: a value, or the MotorbusError that came instead."""


async def everyone(axes: Sequence[AxisVerbs], act: Act[Any]) -> Told:
    """Do it to each, at the same time where the bus allows it; an interruption ends it."""
    told = await gather(*[catch(act(axis)) for axis in axes])
    return {axis.name: one for axis, one in zip(axes, told, strict=True)}


async def insisted(axes: Sequence[AxisVerbs], act: Act[Any]) -> Told:
    """Do it to each whatever happens: an interruption is raised when everybody has been visited.

    Doing it must be harmless to repeat.
    """
    told: Told = {}

    async def one(axis: AxisVerbs) -> None:
        told[axis.name] = await catch(act(axis))

    async def rest() -> None:
        await gather(*[one(axis) for axis in axes if axis.name not in told])

    async def all_of_them() -> None:
        await gather(*[one(axis) for axis in axes])

    await with_cleanup(all_of_them(), rest)
    return told


def of_each(parts: Mapping[str, Iterable[AxisVerbs]], results: Mapping[str, Any]) -> Told:
    """What came of each axis, from what came of each bus; an error of a bus is one of each axis on it."""
    told: Told = {}
    for bus, axes in parts.items():
        for axis in axes:
            found = results[bus]
            told[axis.name] = found if isinstance(found, MotorbusError) else found[axis.name]
    return told


def errors_of(told: Mapping[str, Any]) -> dict[str, MotorbusError]:
    """The errors among what came of each, by the names of the axes."""
    return {name: one for name, one in told.items() if isinstance(one, MotorbusError)}


def raised(told: Mapping[str, T | MotorbusError]) -> dict[str, T]:
    """What came of each. Raises the first error there is, with a note for each other one; all axes are named."""
    errors = errors_of(told)
    if errors:
        raise gathered(errors)
    return dict(told)  # type: ignore[arg-type]


def gathered(errors: Mapping[str, MotorbusError]) -> MotorbusError:
    """One error of the kind of the first, that names its axes; the others are its notes."""
    alike: dict[str, list[str]] = {}
    first: dict[str, MotorbusError] = {}
    for name, error in errors.items():
        alike.setdefault(str(error), []).append(name)
        first.setdefault(str(error), error)
    named_ = [named(", ".join(alike[text]), first[text]) for text in alike]
    for other in named_[1:]:
        named_[0].add_note(f"also: {other}")
    return named_[0]


def names(error: MotorbusError, name: str) -> bool:
    """Whether an error tells of this one."""
    return search(rf"(?<!\w){escape(name)}(?!\w)", error.summary) is not None


def named(name: str, error: MotorbusError) -> MotorbusError:
    """The same error, whose summary begins with the name of what it befell; the error itself stays as it is."""
    if error.summary.startswith((f"{name}: ", f"axis.{name}.", f"{name} ")):
        return error
    found = copy(error)
    found.summary = f"{name}: {error.summary}"
    found.__cause__ = error
    if hasattr(error, "__notes__"):
        found.__notes__ = list(error.__notes__)
    return found
