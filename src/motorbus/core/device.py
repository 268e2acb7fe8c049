"""One list of driver functions for a blocking and an async device class.

    class Methods:
        position = device_method(driver.position)

    class Servo(Methods, BlockingDevice): ...      # position() -> float
    class AsyncServo(Methods, AsyncDevice): ...    # await position() -> float

A device method does I/O; a plain attribute of a device never does.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Coroutine
from functools import cached_property
from inspect import Parameter, Signature, getattr_static, signature
from typing import Any, ClassVar, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar, overload

from motorbus.core.steps import Runnable
from motorbus.errors import RequestError

P = ParamSpec("P")
T = TypeVar("T")


class BlockingRunner(Protocol):
    """The bus of a blocking device."""

    def run(self, runnable: Runnable[T], /) -> T: ...


class AsyncRunner(Protocol):
    """The bus of an async device."""

    async def run(self, runnable: Runnable[T], /) -> T: ...


class _Device:
    """Base of devices. A copy of a device drops the cached methods: they are bound to the original."""

    _is_async: ClassVar[bool] = False

    def _check_bus(self, bus: object) -> None:
        if getattr(bus, "is_async", self._is_async) is not self._is_async:
            needed, opener = ("an async", "open_async") if self._is_async else ("a blocking", "open")
            raise RequestError(
                f"{type(self).__name__} needs {needed} bus, not {bus!r}",
                advice=f"open the bus with motorbus.{opener}; nothing was sent",
            )

    def __getstate__(self) -> dict[str, Any]:
        kind = type(self)
        cached = {
            name for name in self.__dict__ if isinstance(getattr_static(kind, name, None), MethodDescriptor)
        }
        return {name: value for name, value in self.__dict__.items() if name not in cached}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {getattr(self, 'node', '')} on {getattr(self, 'bus', None)!r}>"


class BlockingDevice(_Device):
    """A device whose methods run on a blocking bus. Raises RequestError for an async bus."""

    def __init__(self, bus: BlockingRunner) -> None:
        self._check_bus(bus)
        self.bus = bus


class AsyncDevice(_Device):
    """A device whose methods return coroutines of an async bus. Raises RequestError for a blocking bus.

    A method calls its driver function at once; what that refuses by itself is raised before the `await`.
    """

    _is_async = True

    def __init__(self, bus: AsyncRunner) -> None:
        self._check_bus(bus)
        self.bus = bus


class MethodDescriptor(Generic[P, T]):
    """Base of descriptors that make a method of a driver function; a subclass says how the method runs it.

    On a class it gives a function with the signature of the method; `function` of that is the driver function.
    `returns` names the types in which a driver function returns its value.
    """

    returns: ClassVar[str] = "Request|Procedure|Runnable"

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.name = getattr(function, "__name__", "")
        self.__doc__ = function.__doc__
        self._of_class: dict[type, Any] = {}

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @cached_property
    def signature(self) -> Signature:
        """Of the method, with the type of its value."""
        found = signature(self.function)
        first, *rest = found.parameters.values()
        parameters = [first.replace(name="self", annotation=Parameter.empty), *rest]
        return found.replace(
            parameters=parameters,
            return_annotation=re.sub(rf"^(?:{self.returns})\[(.*)\]$", r"\1", str(found.return_annotation)),
        )

    def of_class(self, owner: type) -> Any:
        """The method as an attribute of this class."""
        if owner not in self._of_class:
            descriptor: Any = self

            def method(self: Any, *args: Any, **kwargs: Any) -> Any:
                return descriptor.__get__(self, type(self))(*args, **kwargs)

            self._describe(method, owner, self.signature)
            method.function = self.function  # type: ignore[attr-defined]
            self._of_class[owner] = method
        return self._of_class[owner]

    def method(self, owner: Any, carry_out: Callable[[Any], Any]) -> Any:
        """The method of `owner`: calls the function and passes the result to `carry_out`."""
        function = self.function

        def call(*args: Any, **kwargs: Any) -> Any:
            return carry_out(function(owner, *args, **kwargs))

        return self._described(call, owner)

    def _described(self, call: Callable[..., Any], owner: object) -> Callable[..., Any]:
        shown = self.signature
        self._describe(call, type(owner), shown.replace(parameters=list(shown.parameters.values())[1:]))
        return call

    def _describe(self, method: Any, owner: type, shown: Signature) -> None:
        method.__name__ = self.name
        method.__qualname__ = f"{owner.__name__}.{self.name}"
        method.__doc__ = self.function.__doc__
        method.__signature__ = shown
        if getattr(owner, "_is_async", False) and sys.version_info >= (3, 12):
            inspect.markcoroutinefunction(method)


class device_method(MethodDescriptor[P, T]):  # noqa: N801 - used like a function
    """Make a method that returns `device.bus.run(function(device, ...))`.

    `run` of a blocking bus returns the value, `run` of an async bus a coroutine.
    """

    function: Callable[Concatenate[Any, P], Runnable[T]]

    def __init__(self, function: Callable[Concatenate[Any, P], Runnable[T]]) -> None:
        super().__init__(function)

    @overload
    def __get__(self, device: None, owner: type) -> Self: ...
    @overload
    def __get__(self, device: BlockingDevice, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, device: AsyncDevice, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, device: Any, owner: type) -> Any:
        if device is None:
            return self.of_class(owner)
        function: Callable[..., Any] = self.function

        # As `method` does for the descriptors of `motion`, with one call less per use.
        def call(*args: Any, **kwargs: Any) -> Any:
            procedure = function(device, *args, **kwargs) if args or kwargs else function(device)
            return device.bus.run(procedure)

        method = self._described(call, device)
        # Cache it, so that the next call skips this descriptor; not if a subclass overrides it and calls `super`.
        if getattr_static(type(device), self.name, None) is self:
            device.__dict__[self.name] = method
        return method
