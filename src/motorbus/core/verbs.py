"""Methods of device classes, blocking and async, made of one list of driver functions, with their types.

A class lists the functions: `position = verb(driver.position)`; `Servo` and `AsyncServo` derive from it. Every verb
does I/O and is a method; an attribute never does.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar, overload

from motorbus.core.operation import Runnable

P = ParamSpec("P")
T = TypeVar("T")


class BlockingRunner(Protocol):
    """The bus of a blocking device."""

    def run(self, operation: Runnable[T], /) -> T: ...


class AsyncRunner(Protocol):
    """The bus of an async device."""

    async def run(self, operation: Runnable[T], /) -> T: ...


class _Owner:
    """Base of devices with verbs. A copy drops the cached methods: they are bound to the original."""

    def __getstate__(self) -> dict[str, Any]:
        cached = {name for name in self.__dict__ if isinstance(getattr(type(self), name, None), Said)}
        return {name: value for name, value in self.__dict__.items() if name not in cached}


class Blocking(_Owner):
    """A device whose verbs run on a blocking bus."""

    def __init__(self, bus: BlockingRunner) -> None:
        self.bus = bus


class Awaiting(_Owner):
    """A device whose verbs run on an async bus."""

    def __init__(self, bus: AsyncRunner) -> None:
        self.bus = bus


def _bound(call: Callable[P, T], name: str, function: Callable[..., object], owner: object) -> Callable[P, T]:
    """Give a method the name, docstring and signature (without the first parameter) of its function."""
    call.__name__ = name
    call.__qualname__ = f"{type(owner).__name__}.{name}"
    call.__doc__ = function.__doc__
    call.__wrapped__ = partial(function, owner)  # type: ignore[attr-defined]
    return call


class Said(Generic[P, T]):
    """Base of descriptors that make a method of a driver function; a subclass says how the method runs it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.name = getattr(function, "__name__", "")
        self.__doc__ = function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def method(self, owner: Any, carry_out: Callable[[Any], Any]) -> Any:
        """The method of `owner`: calls the function and passes the result to `carry_out`."""
        function = self.function

        def call(*args: Any, **kwargs: Any) -> Any:
            return carry_out(function(owner, *args, **kwargs))

        return _bound(call, self.name, function, owner)


class verb(Said[P, T]):  # noqa: N801 - used like a function
    """Makes a method of a driver function: blocking on a `Blocking` device, a coroutine on an `Awaiting` one."""

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
            procedure = function(device, *args, **kwargs) if args or kwargs else function(device)
            return device.bus.run(procedure)

        method = _bound(call, self.name, function, device)
        # Cache it, so that the next call skips this descriptor; not if a subclass overrides the verb and calls `super`.
        if getattr(type(device), self.name, None) is self:
            device.__dict__[self.name] = method
        return method
