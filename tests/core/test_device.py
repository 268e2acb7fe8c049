"""One list of verbs gives a blocking and an async face with the names and types of the driver functions."""

from __future__ import annotations

import asyncio
import copy
import inspect
import pydoc
import sys
from typing import Any, TypeVar, assert_type

import pytest

import motorbus
from motorbus.core.device import AsyncDevice, BlockingDevice, device_method
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.errors import RequestError

T = TypeVar("T")


class Node:
    id = 7


def scaled(node: Node, by: int, *, plus: int = 0) -> Request[int]:
    """Documented once."""
    return Request(bytes([node.id]), (), lambda answer: node.id * by + plus)


class Verbs(Node):
    scaled = device_method(scaled)


class BlockingBus:
    def run(self, operation: Runnable[T], /) -> T:
        assert isinstance(operation, Request)
        value: T = operation.decode(None)  # type: ignore[misc, arg-type]  # this reader ignores its answer
        return value


class AsyncBus:
    async def run(self, operation: Runnable[T], /) -> T:
        return BlockingBus().run(operation)


class Servo(Verbs, BlockingDevice): ...


class AsyncServo(Verbs, AsyncDevice): ...


def test_a_blocking_device_returns_the_plain_value() -> None:
    value = Servo(BlockingBus()).scaled(3, plus=1)
    assert_type(value, int)
    assert value == 22


def test_an_async_device_returns_an_awaitable() -> None:
    async def main() -> int:
        value = await AsyncServo(AsyncBus()).scaled(3, plus=1)
        assert_type(value, int)
        return value

    assert asyncio.run(main()) == 22


@pytest.mark.parametrize("device", [motorbus.feetech.Servo, motorbus.feetech.AsyncServo])
def test_a_device_refuses_the_other_kind_of_bus(device: Any) -> None:
    with motorbus.simulate("feetech", ids="1") as sim:
        opened = motorbus.open if issubclass(device, AsyncDevice) else motorbus.open_async
        bus: Any = opened(sim.url)
        with pytest.raises(RequestError, match="needs an? (async|blocking) bus"):
            device(bus, 1)
        if issubclass(device, AsyncDevice):
            bus.close()


def test_method_of_a_device_shows_its_parameters() -> None:
    device = Servo(BlockingBus())
    assert str(inspect.signature(device.scaled)) == "(by: 'int', *, plus: 'int' = 0) -> 'int'"
    assert device.scaled.__name__ == "scaled"
    assert "scaled(by: 'int', *, plus: 'int' = 0)" in pydoc.plain(pydoc.render_doc(device.scaled))


def test_a_class_shows_the_methods_of_its_face() -> None:
    for kind in (Servo, AsyncServo):
        method: Any = kind.scaled
        assert str(inspect.signature(method)) == "(self, by: 'int', *, plus: 'int' = 0) -> 'int'"
        assert method.__qualname__ == f"{kind.__name__}.scaled"
        assert method.function is scaled
        assert "Documented once." in pydoc.plain(pydoc.render_doc(kind))
    unbound: Any = Servo.scaled
    assert unbound(Servo(BlockingBus()), 3) == 21
    if sys.version_info >= (3, 12):
        assert inspect.iscoroutinefunction(AsyncServo.scaled)
        assert inspect.iscoroutinefunction(AsyncServo(AsyncBus()).scaled)
        assert not inspect.iscoroutinefunction(Servo.scaled)


def test_reading_a_method_of_a_base_class_leaves_its_subclasses_alone() -> None:
    base: Any = Verbs.scaled
    method: Any = AsyncServo.scaled
    assert base.__qualname__ == "Verbs.scaled"
    assert method.__qualname__ == "AsyncServo.scaled"
    assert sys.version_info < (3, 12) or inspect.iscoroutinefunction(method)


def test_method_may_be_replaced_in_a_base_class_after_its_use(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Servo(BlockingBus()).scaled(3) == 21
    monkeypatch.setattr(Verbs, "scaled", lambda self, by: -by)
    assert Servo(BlockingBus()).scaled(3) == -3


def test_method_may_be_added_to_a_class() -> None:
    class Later(Verbs, BlockingDevice): ...

    Later.added = device_method(scaled)  # type: ignore[attr-defined]
    device: Any = Later(BlockingBus())
    assert device.added(3) == 21


def test_an_override_may_call_the_method_of_its_base_class() -> None:
    class Doubled(Servo):
        def scaled(self, by: int, *, plus: int = 0) -> int:
            return 2 * super().scaled(by, plus=plus)

    device = Doubled(BlockingBus())
    assert [device.scaled(3), device.scaled(3)] == [42, 42]


def test_a_copy_has_methods_of_its_own() -> None:
    first = Servo(BlockingBus())
    assert first.scaled(3) == 21
    second = copy.copy(first)
    second.id = 8
    assert (first.scaled(3), second.scaled(3)) == (21, 24)
