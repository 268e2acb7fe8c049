"""Work on several buses at the same time, said once and run blocking or async.

A driver function awaits steps on one bus. What a machine does is one such operation on each bus that it needs, all
begun together, and what becomes of their results. They know of each other only by what they share in memory, as a
`Meeting`; who carries them out is `conductor`.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator, Mapping
from dataclasses import dataclass
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, Self, TypeAlias, TypeVar, overload

from motorbus.core.device import MethodDescriptor
from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Parallel(Generic[T]):
    """An operation for each bus, by its name, and what the whole comes to.

    `combine` gets what each returned, or the MotorbusError that it raised; it raises what is to be raised.
    """

    operations: Mapping[str, Runnable[Any]]
    combine: Callable[[Mapping[str, Any]], T]

    def __await__(self) -> Generator[Parallel[Any], Any, T]:
        value: T = yield self
        return value


Works: TypeAlias = Coroutine[Parallel[Any], Any, T]
"""A procedure on several buses: it awaits pieces of work, one after the other."""


class BlockingConductor(Protocol):
    """What a blocking machine needs to carry its work out."""

    def run(self, work: Parallel[T], /) -> T: ...


class AsyncConductor(Protocol):
    """What an async machine needs to carry its work out."""

    async def run(self, work: Parallel[T], /) -> T: ...


class Led:
    """Carries out its verbs at once, blocking."""

    conductor: BlockingConductor


class LedAsync:
    """Carries out its verbs when they are awaited."""

    _is_async = True
    conductor: AsyncConductor


class together(MethodDescriptor[P, T]):  # noqa: N801 - reads as a word in a list of verbs
    """Makes a method of a function that gives an `Parallel`: blocking on what is `Led`, awaitable on `LedAsync`."""

    returns = "Parallel"

    def __init__(self, function: Callable[Concatenate[Any, P], Parallel[T]]) -> None:
        super().__init__(function)

    @overload
    def __get__(self, machine: None, owner: type) -> Self: ...
    @overload
    def __get__(self, machine: Led, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, machine: LedAsync, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, machine: Any, owner: type) -> Any:
        return self.bind(machine, owner)

    def make_method(self) -> Callable[..., Any]:
        function: Callable[..., Any] = self.function

        def method(machine: Any, /, *args: Any, **kwargs: Any) -> Any:
            return machine.conductor.run(function(machine, *args, **kwargs))

        return method


def settled(results: Mapping[str, Any]) -> dict[str, Any]:
    """What each bus returned. Raises the first error there is, with a note for each of the others.

    One that has another among them for its cause comes after it: who waited in vain is not who is to be helped.
    """
    errors = [told for told in results.values() if isinstance(told, MotorbusError)]
    if errors:
        first = next((error for error in errors if error.__cause__ not in errors), errors[0])
        said = {str(first)}
        for other in errors:
            if str(other) not in said:
                said.add(str(other))
                first.add_note(f"also: {other.summary if other.__cause__ is first else other}")
        raise first
    return dict(results)
