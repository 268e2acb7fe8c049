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
from inspect import Parameter, signature
from types import MethodType
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
    _is_async: ClassVar[bool]
    _family: ClassVar[str] = ""
    """The family of its bus; "" for a device of any family."""

    def __init__(self, bus: Any) -> None:
        if getattr(bus, "is_async", self._is_async) is not self._is_async:
            needed, opener = ("an async", "open_async") if self._is_async else ("a blocking", "open")
            raise RequestError(
                f"{type(self).__name__} needs {needed} bus, not {bus!r}",
                advice=f"open the bus with motorbus.{opener}; nothing was sent",
            )
        family: str = getattr(getattr(bus, "family", None), "name", self._family)
        if self._family and family != self._family:
            raise RequestError(
                f"{bus!r} is a bus of {family} devices, and this {type(self).__name__} is one of {self._family}",
                advice=f"use a device of motorbus.{family}, or open {self._family}:PORT; nothing was sent",
            )
        self.bus = bus

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {getattr(self, 'node', '')} on {getattr(self, 'bus', None)!r}>"


class BlockingDevice(_Device):
    """A device whose methods run on a blocking bus. Raises RequestError for an async bus, or one of another family."""

    _is_async = False
    bus: BlockingRunner


class AsyncDevice(_Device):
    """A device whose methods return coroutines of an async bus.

    Raises RequestError for a blocking bus, or one of another family.

    A method calls its driver function at once; what that refuses by itself is raised before the `await`.
    """

    _is_async = True
    bus: AsyncRunner


class MethodDescriptor(Generic[P, T]):
    """Base of descriptors that make a method of a driver function; a subclass says how the method runs it.

    The method has the signature of the driver function, which is its attribute `function`. `returns` names the types in
    which a driver function returns its value.
    """

    returns: ClassVar[str] = "Request|Procedure|Runnable"

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.name = getattr(function, "__name__", "")
        self.__doc__ = function.__doc__
        self._methods: dict[type, Any] = {}

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def make_method(self) -> Callable[..., Any]:
        """A function that calls the driver function and runs its result."""
        raise NotImplementedError

    def bind(self, one: Any, owner: type) -> Any:
        """The method of this object, or that of the class if `one` is None."""
        found = self._methods.get(owner)
        if found is None:
            method: Any = self.make_method()
            shown = signature(self.function)
            first, *rest = shown.parameters.values()
            method.__name__ = self.name
            method.__qualname__ = f"{owner.__name__}.{self.name}"
            method.__doc__ = self.function.__doc__
            method.__signature__ = shown.replace(
                parameters=[first.replace(name="self", annotation=Parameter.empty), *rest],
                return_annotation=re.sub(
                    rf"^(?:{self.returns})\[(.*)\]$", r"\1", str(shown.return_annotation)
                ),
            )
            method.function = self.function
            if getattr(owner, "_is_async", False) and sys.version_info >= (3, 12):
                inspect.markcoroutinefunction(method)
            found = self._methods[owner] = method
        return found if one is None else MethodType(found, one)


class device_method(MethodDescriptor[P, T]):  # noqa: N801 - used like a function
    """Make a method that returns `device.bus.run(function(device, ...))`.

    `run` of a blocking bus returns the value, `run` of an async bus a coroutine.
    """

    function: Callable[Concatenate[Any, P], Runnable[T]]

    def __init__(self, function: Callable[Concatenate[Any, P], Runnable[T]]) -> None:
        super().__init__(function)

    def make_method(self) -> Callable[..., Any]:
        function: Callable[..., Any] = self.function

        def method(self: Any, /, *args: Any, **kwargs: Any) -> Any:
            # A call without arguments costs less than one with empty ones.
            procedure = function(self, *args, **kwargs) if args or kwargs else function(self)
            return self.bus.run(procedure)

        return method

    @overload
    def __get__(self, device: None, owner: type) -> Self: ...
    @overload
    def __get__(self, device: BlockingDevice, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, device: AsyncDevice, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, device: Any, owner: type) -> Any:
        return self.bind(device, owner)
