"""One list of verbs, two faces; names, arguments and types are those of the driver function."""

from __future__ import annotations

import asyncio
import inspect
import pickle
import pydoc
from copy import copy, deepcopy
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


class Counting(BlockingBus):
    """Tells how often it was asked."""

    def __init__(self) -> None:
        self.times = 0

    def run(self, operation: Runnable[T], /) -> T:
        self.times += 1
        return super().run(operation)


class Louder(Device):
    def scaled(self, by: int, *, plus: int = 0) -> int:
        return 100 * super().scaled(by, plus=plus)


def test_a_method_is_found_once_and_shows_what_it_takes() -> None:
    device = Device(BlockingBus())
    assert device.scaled is device.scaled
    assert str(inspect.signature(device.scaled)) == "(by: 'int', *, plus: 'int' = 0) -> 'Exchange[int]'"
    assert device.scaled.__name__ == "scaled"
    assert "scaled(by: 'int', *, plus: 'int' = 0)" in pydoc.plain(pydoc.render_doc(device.scaled))


def test_a_copy_speaks_for_itself() -> None:
    first, other = Counting(), Counting()
    device = Device(first)
    assert device.scaled(1) == 7
    for again in (copy(device), deepcopy(device)):
        again.bus = other
        again.id = 8
        assert again.scaled(1) == 8
    assert (device.scaled(1), first.times, other.times) == (7, 2, 2)


def test_what_is_kept_is_not_pickled() -> None:
    device = Device(Counting())
    device.scaled(1)
    device.id = 9
    again = pickle.loads(pickle.dumps(device))
    assert (again.scaled(1), again.bus.times) == (9, 2)


def test_a_class_that_says_more_is_asked_again_and_again() -> None:
    device = Louder(BlockingBus())
    assert [device.scaled(1), device.scaled(1), device.scaled(1)] == [700] * 3
