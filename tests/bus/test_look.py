"""What must be asked before an order can be judged is asked first, once more where the answer is doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Thread
from typing import Any

import pytest

from motorbus.bus.look import questions
from motorbus.bus.pump import Bus
from motorbus.bus.run import LOOKS
from motorbus.core.operation import Alone, Effect, Exchange, Operation, Runnable, Together
from motorbus.errors import MotorbusError, OutcomeUnknown
from motorbus.families.feetech import wire
from tests.bus.responder import Responder, memory_bus, position, write

GOAL = 42


def test_nobody_else_sends_or_looks_meanwhile() -> None:
    bus, _ = memory_bus()
    free: list[bool] = []

    def look(exchange: Exchange[Any]) -> Sequence[Runnable[Any]]:
        def other() -> None:
            free.append(bus.turns.lock.acquire(blocking=False))

        thread = Thread(target=other)
        thread.start()
        thread.join()
        return []

    bus.turns.look = look
    assert bus.run(order()) == 7  # by the short way
    assert bus.run(iter(order())) == 7
    assert free
    assert not any(free)
    bus.turns.look = None
    assert questions(bus.turns, order()) == ()


class Looking:
    """Wants to look before each order, until it has looked so many `times`."""

    def __init__(self, bus: Bus, times: int, node: int = 1) -> None:
        self.left = times
        self.node = node
        bus.turns.look = self

    def __call__(self, exchange: Exchange[Any]) -> Sequence[Runnable[Any]]:
        return [self._question()] if self.left and exchange.effect is Effect.MOTION else []

    def _question(self) -> Operation[object]:
        self.left -= 1
        return (yield from position(self.node))


def order(value: int = 7) -> Exchange[int]:
    """A write that moves, whose value is what the answer says."""
    plain = write(1, GOAL, value)
    return Exchange(plain.request, plain.replies, lambda _: value, effect=Effect.MOTION)


def heard(simulator: Responder) -> list[str]:
    return [wire.Instruction(packet.instruction).name for packet in simulator.heard]


@pytest.mark.parametrize(("times", "asked"), [(0, 0), (1, 1), (2, 2), (5, LOOKS)])
def test_it_looks_as_often_as_it_must_and_not_for_ever(times: int, asked: int) -> None:
    bus, simulator = memory_bus()
    Looking(bus, times)
    assert bus.run(order()) == 7
    assert heard(simulator) == ["READ"] * asked + ["WRITE"]


def test_what_does_not_move_is_not_looked_after() -> None:
    bus, simulator = memory_bus()
    Looking(bus, 5)
    bus.run(write(1, GOAL, 7))
    bus.run(position(1))
    assert heard(simulator) == ["WRITE", "READ"]


def test_inside_any_operation_the_order_gets_its_own_value() -> None:
    bus, _ = memory_bus()
    looking = Looking(bus, 3)

    def work() -> Operation[tuple[int, list[int], int]]:
        one = yield from order(1)
        looking.left = 2
        two = yield from Together([order(2), order(3)])
        looking.left = 1
        three = yield from Alone(order(4))
        return one, two, three

    assert bus.run(work()) == (1, [2, 3], 4)


def test_a_look_that_fails_leaves_the_judgement_to_the_gate() -> None:
    bus, simulator = memory_bus()
    Looking(bus, 1, node=9)
    simulator.dead.add(9)
    assert bus.run(order()) == 7


def test_what_the_order_raises_reaches_who_gave_it() -> None:
    bus, simulator = memory_bus()
    Looking(bus, 1, node=2)
    simulator.dead.add(1)

    def work() -> Operation[str]:
        try:
            yield from order()
        except OutcomeUnknown:
            return "told"
        return "silent"

    assert bus.run(work()) == "told"


def test_an_interruption_while_it_looks_keeps_the_order_from_leaving() -> None:
    bus, simulator = memory_bus()

    def asks() -> Operation[object]:
        yield from position(1)
        raise KeyboardInterrupt

    bus.turns.look = lambda exchange: [asks()] if exchange.effect is Effect.MOTION else []
    with pytest.raises(KeyboardInterrupt):
        bus.run(order())
    assert heard(simulator) == ["READ"]


def test_a_refusal_of_the_gate_is_raised_after_the_look() -> None:
    bus, simulator = memory_bus()
    Looking(bus, 1)

    def refuse(exchange: Exchange[Any]) -> None:
        raise MotorbusError("no")

    bus.turns.admit = refuse
    with pytest.raises(MotorbusError, match="no"):
        bus.run(order())
    assert heard(simulator) == ["READ"]
