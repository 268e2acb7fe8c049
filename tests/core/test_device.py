"""One list of verbs gives a blocking and an async face with the names and types of the driver functions."""

from __future__ import annotations

import asyncio
import inspect
import pydoc
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


def test_method_shows_its_parameters_and_its_docstring() -> None:
    device = Servo(BlockingBus())
    assert list(inspect.signature(device.scaled).parameters) == ["by", "plus"]
    assert "scaled(by: 'int', *, plus: 'int' = 0)" in pydoc.plain(pydoc.render_doc(device.scaled))
    method: Any = Servo.scaled
    assert method.function is scaled
    assert method(device, 3) == 21


def test_an_override_may_call_the_method_of_its_base_class() -> None:
    class Doubled(Servo):
        def scaled(self, by: int, *, plus: int = 0) -> int:
            return 2 * super().scaled(by, plus=plus)

    device = Doubled(BlockingBus())
    assert [device.scaled(3), device.scaled(3)] == [42, 42]
