"""Who waits for the bus when an emergency stop comes has not begun, and does not begin when the stop is reset."""

from __future__ import annotations

from motorbus.core.operation import Alone, Effect, Operation, Pause, Together, outcome
from motorbus.errors import Interrupted, MotorbusError
from tests.bus.responder import memory_bus, position, write

TORQUE = 40


def test_what_waited_for_the_bus_does_not_begin_after_the_reset() -> None:
    bus, responder = memory_bus()
    bus.run(position(1))
    began: list[str] = []

    def holding() -> Operation[None]:
        began.append("holding")
        yield from Pause(1.0)
        bus.turns.latch(bus.link.now())
        bus.reset()
        yield from Alone(iter(Pause(1.0)))  # what belongs to the holder goes on

    def moving() -> Operation[None]:
        began.append("moving")
        yield from write(1, TORQUE, 1, Effect.TORQUE)

    def both() -> Operation[list[MotorbusError | None]]:
        return (yield from Together([outcome(iter(Alone(one()))) for one in (holding, moving)]))

    first, second = bus.run(both())
    assert first is None
    assert isinstance(second, Interrupted)
    assert began == ["holding"]
    assert responder.memory[1][TORQUE] == 0
    assert bus.run(iter(Alone(position(1)))) == 1, "and the bus is free again"
