"""One list of verbs, blocking and awaitable, and nothing sent before the first of them."""

from __future__ import annotations

import asyncio
from typing import TypeVar

import pytest

from motorbus.core.family import State
from motorbus.core.operation import Runnable
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import AsyncServo, Promise, Servo, ServoVerbs
from tests.families.feetech.driver_script import Line, Played, low_high, prepares, reads, writes

T = TypeVar("T")

SCRIPT = (
    prepares(),
    reads(3, 56, *low_high(1304)),
    reads(3, 62, 121, error=0x01),
    writes(3, 40, 0, error=0x01),
)


class BlockingBus(Played):
    """Carries out operations from a script."""


class AwaitedBus:
    """The same, awaited."""

    def __init__(self, script: tuple[Line, ...]) -> None:
        self.played = Played(script)

    async def run(self, operation: Runnable[T], /) -> T:
        await asyncio.sleep(0)
        return self.played.run(operation)


def test_the_blocking_face() -> None:
    bus = BlockingBus(SCRIPT)
    servo = Servo(bus, 3)
    assert servo.position() == pytest.approx(2.0003, abs=1e-4)
    assert servo.voltage() == pytest.approx(12.1)
    assert servo.alarm == ("voltage",)
    servo.disable_torque()
    assert bus.script == []


def test_the_awaitable_face() -> None:
    bus = AwaitedBus(SCRIPT)

    async def talk() -> None:
        servo = AsyncServo(bus, 3)
        assert await servo.position() == pytest.approx(2.0003, abs=1e-4)
        assert await servo.voltage() == pytest.approx(12.1)
        assert servo.alarm == ("voltage",)
        await servo.disable_torque()

    asyncio.run(talk())
    assert bus.played.script == []


def test_verbs_have_the_types_of_their_functions() -> None:
    stop = [prepares(), reads(3, 56, 0, 0), writes(3, 42, 0, 0)]
    bus = BlockingBus([prepares(), reads(3, 56, *[0] * 15), *stop])
    servo = Servo(bus, 3)
    state: State = servo.telemetry()
    promise: Promise = servo.stop()
    assert state.position == 0
    assert promise is Promise.HOLD_ACCEPTED


@pytest.mark.parametrize("id", [-1, 254, 255])
def test_an_impossible_id_is_refused_before_there_is_anything_to_send(id: int) -> None:
    with pytest.raises(RequestError):
        Servo(BlockingBus([]), id)
    with pytest.raises(RequestError):
        AsyncServo(AwaitedBus(()), id)


def test_every_verb_says_what_it_does() -> None:
    verbs = [name for name in vars(ServoVerbs) if not name.startswith("_")]
    assert len(verbs) > 20
    assert [name for name in verbs if not getattr(ServoVerbs, name).__doc__] == []
