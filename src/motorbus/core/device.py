"""Methods of blocking and async devices, made from the same driver functions.

    class Methods:
        position = device_method(driver.position)

    class Servo(Methods, BlockingDevice): ...      # position() -> float
    class AsyncServo(Methods, AsyncDevice): ...    # await position() -> float

A device method does I/O; a plain attribute of a device never does.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, Concatenate, Generic, ParamSpec, Protocol, TypeVar, overload

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

    A method calls its driver function at once. A plain driver function raises its refusals before the `await`.
    """

    _is_async = True
    bus: AsyncRunner


if TYPE_CHECKING:

    class device_method(Generic[P, T]):  # noqa: N801 - used like a function
        """The type of a device method: a blocking device returns the value, an async one a coroutine."""

        function: Callable[..., Runnable[T]]

        def __init__(self, function: Callable[Concatenate[Any, P], Runnable[T]]) -> None: ...
        @overload
        def __get__(self, device: None, owner: type) -> device_method[P, T]: ...
        @overload
        def __get__(self, device: BlockingDevice, owner: type) -> Callable[P, T]: ...
        @overload
        def __get__(self, device: AsyncDevice, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
        def __get__(self, device: Any, owner: type) -> Any: ...

else:

    def device_method(function: Callable[..., Runnable[T]]) -> Callable[..., Any]:
        """Make a method that returns `device.bus.run(function(device, ...))`; `function` is its attribute as well."""

        @wraps(function)
        def method(self: Any, /, *args: Any, **kwargs: Any) -> Any:
            # A call without arguments costs less than one with empty ones.
            procedure = function(self, *args, **kwargs) if args or kwargs else function(self)
            return self.bus.run(procedure)

        method.function = function
        return method
