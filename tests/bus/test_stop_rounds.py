"""How often a stop is said, and for how long, where the port is slow or full and where it is interrupted."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.errors import LinkError
from tests.bus.responder import Responder, memory_bus, position


def known(count: int) -> tuple[Bus, Responder, list[float]]:
    """A bus that knows so many servos, and where the moments at which everyone is told to stop will be."""
    bus, responder = memory_bus()
    for node in range(1, count + 1):
        bus.run(position(node))
    told: list[float] = []
    receive = responder.receive

    def hear(data: Any, at: float) -> None:
        receive(data, at)
        if responder.heard[-1].id == 254:
            told.append(at)

    responder.receive = hear  # type: ignore[method-assign]
    return bus, responder, told


def slow(bus: Bus, seconds: float) -> None:
    """Every frame holds up whoever writes it for so long."""
    link: Any = bus.link
    write = link.write

    def take_time(data: Any) -> None:
        write(data)
        link.advance(seconds)

    link.write = take_time


def test_over_a_port_that_is_slow_everyone_is_told_again_within_half_a_second() -> None:
    bus, responder, told = known(20)
    responder.dead = set(range(1, 21))
    slow(bus, 0.1)
    assert len(bus.estop().silent) == 20
    assert len(told) == 5
    assert max(later - before for before, later in pairwise(told)) < 0.5


def test_over_a_port_that_is_slow_eight_servos_are_stopped_one_after_the_other() -> None:
    bus, _, _ = known(8)
    slow(bus, 0.1)
    assert bus.estop().acknowledged == tuple(range(1, 9))


def test_where_a_port_stays_full_whoever_stops_is_told_soon() -> None:
    bus, _, told = known(1)
    link: Any = bus.link

    def full(data: Any) -> None:
        raise LinkError("full")

    link.write, begun = full, link.now()
    assert bus.estop().silent == (1,)
    assert link.now() - begun < 0.4
    assert told == []


def test_a_stop_waits_for_the_end_of_a_long_frame_through_more_than_one_round() -> None:
    bus, responder = memory_bus(pace=True)
    bus.run(position(1))
    free = bus.turns.free_at = bus.link.now() + 0.6
    outcome = bus.estop()
    assert outcome.acknowledged == (1,)
    assert outcome.rounds == 3
    assert [packet.id for packet in responder.heard[-2:]] == [254, 1]
    assert free < bus.link.now() < free + 0.01


@pytest.mark.parametrize(("cuts", "through"), [(1, True), (2, True), (3, False)])
def test_a_stop_goes_through_although_it_is_cut_short_twice_and_gives_up_after_the_third_time(
    cuts: int, through: bool
) -> None:
    bus, _, told = known(1)
    latch, left = bus.turns.latch, [KeyboardInterrupt] * cuts

    def cut(now: float) -> Any:
        if left:
            raise left.pop()
        return latch(now)

    bus.turns.latch = cut  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        bus.stopper.stop()
    assert left == []
    assert len(told) == through
