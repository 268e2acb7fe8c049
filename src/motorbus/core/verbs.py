"""One list of verbs gives a blocking and an awaitable face, both typed, with no mirror.

A device class lists driver functions: `position = verb(driver.position)`. `Servo` and `AsyncServo` are two-line
classes over one list. What is a method here is always I/O; nothing that costs a frame is an attribute.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar, overload

from motorbus.core.operation import Runnable

P = ParamSpec("P")
T = TypeVar("T")


class BlockingRunner(Protocol):
    """What a blocking device needs of its bus."""

    def run(self, operation: Runnable[T], /) -> T: ...


class AsyncRunner(Protocol):
    """What an async device needs of its bus."""

    async def run(self, operation: Runnable[T], /) -> T: ...


class Spoken:
    """What verbs are said to. A copy has methods of its own: those that are kept here speak for this one."""

    def __getstate__(self) -> dict[str, Any]:
        kind = type(self)
        return {
            name: value
            for name, value in self.__dict__.items()
            if not isinstance(getattr(kind, name, None), Said)
        }


class Blocking(Spoken):
    """Carries out verbs by a blocking bus."""

    def __init__(self, bus: BlockingRunner) -> None:
        self.bus = bus


class Awaiting(Spoken):
    """Carries out verbs by an async bus."""

    def __init__(self, bus: AsyncRunner) -> None:
        self.bus = bus


def dressed(
    call: Callable[P, T], name: str, function: Callable[..., object], owner: object
) -> Callable[P, T]:
    """A method that shows its name, what its function says of itself, and what it takes, without the first of it."""
    call.__name__ = name
    call.__qualname__ = f"{type(owner).__name__}.{name}"
    call.__doc__ = function.__doc__
    call.__wrapped__ = partial(function, owner)  # type: ignore[attr-defined]
    return call


class Said(Generic[P, T]):
    """A function in a list of verbs, and the method that it becomes; what carries it out, its kinds say."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.name = getattr(function, "__name__", "")
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def method(self, owner: Any, carry_out: Callable[[Any], Any]) -> Any:
        """The method of this object: what the function says of it is carried out when it is called."""
        function = self.function

        def call(*args: Any, **kwargs: Any) -> Any:
            return carry_out(function(owner, *args, **kwargs))

        return dressed(call, self.name, function, owner)


class verb(Said[P, T]):  # noqa: N801 - reads as a word in a list of verbs
    """Makes a method of a driver function: blocking on a `Blocking` device, awaitable on an `Awaiting` one."""

    function: Callable[Concatenate[Any, P], Runnable[T]]

    def __init__(self, function: Callable[Concatenate[Any, P], Runnable[T]]) -> None:
        super().__init__(function)

    @overload
    def __get__(self, device: None, owner: type) -> Self: ...
    @overload
    def __get__(self, device: Blocking, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, device: Awaiting, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, device: Any, owner: type) -> Any:
        if device is None:
            return self
        function: Callable[..., Any] = self.function

        def call(*args: Any, **kwargs: Any) -> Any:
            said = function(device, *args, **kwargs) if args or kwargs else function(device)
            return device.bus.run(said)

        method = dressed(call, self.name, function, device)
        if (
            getattr(type(device), self.name, None) is self
        ):  # not where a subclass says more and asks for this one
            device.__dict__[self.name] = method  # from now on it is found there, without coming here
        return method
