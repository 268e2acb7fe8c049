"""One list of verbs, two faces; names, arguments and types are those of the driver function."""

from __future__ import annotations

import asyncio
from typing import TypeVar, assert_type

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


def test_the_documentation_is_that_of_the_driver_function() -> None:
    assert Verbs.scaled.__doc__ == "Documented once."
    assert Device(BlockingBus()).scaled.__doc__ == "Documented once."
