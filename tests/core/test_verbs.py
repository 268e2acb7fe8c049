"""One list of verbs gives a blocking and an async face with the names and types of the driver functions."""

from __future__ import annotations

import asyncio
import copy
import inspect
import pydoc
import sys
from typing import Any, TypeVar, assert_type

from motorbus.core.operation import Exchange, Runnable
from motorbus.core.verbs import Awaiting, Blocking, verb

T = TypeVar("T")


class Node:
    id = 7


def scaled(node: Node, by: int, *, plus: int = 0) -> Exchange[int]:
    """Documented once."""
    return Exchange(bytes([node.id]), (), lambda answer: node.id * by + plus)


class Verbs(Node):
    scaled = verb(scaled)


class BlockingBus:
    def run(self, operation: Runnable[T], /) -> T:
        assert isinstance(operation, Exchange)
        value: T = operation.read(None)  # type: ignore[misc, arg-type]  # this reader ignores its answer
        return value


class AsyncBus:
    async def run(self, operation: Runnable[T], /) -> T:
        return BlockingBus().run(operation)


class Device(Verbs, Blocking): ...


class AsyncDevice(Verbs, Awaiting): ...


def test_a_blocking_device_returns_the_plain_value() -> None:
    value = Device(BlockingBus()).scaled(3, plus=1)
    assert_type(value, int)
    assert value == 22


def test_an_async_device_returns_an_awaitable() -> None:
    async def main() -> int:
        value = await AsyncDevice(AsyncBus()).scaled(3, plus=1)
        assert_type(value, int)
        return value

    assert asyncio.run(main()) == 22


def test_a_method_is_found_once_and_shows_what_it_takes() -> None:
    device = Device(BlockingBus())
    assert device.scaled is device.scaled
    assert str(inspect.signature(device.scaled)) == "(by: 'int', *, plus: 'int' = 0) -> 'int'"
    assert device.scaled.__name__ == "scaled"
    assert "scaled(by: 'int', *, plus: 'int' = 0)" in pydoc.plain(pydoc.render_doc(device.scaled))


def test_a_class_shows_the_methods_of_its_face() -> None:
    for kind in (Device, AsyncDevice):
        method: Any = kind.scaled
        assert str(inspect.signature(method)) == "(self, by: 'int', *, plus: 'int' = 0) -> 'int'"
        assert method.__qualname__ == f"{kind.__name__}.scaled"
        assert method.function is scaled
        assert "Documented once." in pydoc.plain(pydoc.render_doc(kind))
    unbound: Any = Device.scaled
    assert unbound(Device(BlockingBus()), 3) == 21
    if sys.version_info >= (3, 12):
        assert inspect.iscoroutinefunction(AsyncDevice.scaled)
        assert not inspect.iscoroutinefunction(Device.scaled)


def test_a_copy_has_methods_of_its_own() -> None:
    first = Device(BlockingBus())
    assert first.scaled(3) == 21
    second = copy.copy(first)
    second.id = 8
    assert (first.scaled(3), second.scaled(3)) == (21, 24)
