"""What nobody answers leaves with what follows it, where it can; where it cannot, what comes of it is the same."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.bus.volley import volley
from motorbus.core.operation import Answer, Data, Effect, Exchange
from motorbus.errors import LinkLost, MotorbusError, NoReply, Refused, RequestError
from motorbus.families.feetech import wire
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.bus.responder import Responder, memory_bus, position, positions

FORGIVEN = (NoReply,)


class Heard(PerfectLine):
    """A wire that keeps what the host wrote, write by write."""

    def __init__(self) -> None:
        self.sent: list[Data] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.sent.append(data)
        return super().carry(sender, data, at)


def heard_bus() -> tuple[Bus, Responder, Heard]:
    """A bus, what answers on it, and what was written."""
    bus, simulator = memory_bus(line := Heard())
    return bus, simulator, line


def order(value: int = 7, effect: Effect = Effect.MOTION) -> Exchange[int]:
    """Goals for two, which nobody answers; its value is what was ordered."""
    data = bytes((value, 0))
    return Exchange(wire.sync_write(42, [(1, data), (2, data)]), (), lambda _: value, effect=effect)


def joined(*exchanges: Exchange[Any]) -> bytes:
    return b"".join(bytes(one.request) for one in exchanges if isinstance(one.request, bytes))


def test_goals_and_the_question_behind_them_leave_in_one_write() -> None:
    bus, simulator, line = heard_bus()
    read, other = positions(1, 2), position(3)
    with bus:
        told = volley(bus, (order(5), order(6), read, other))
    assert line.sent == [joined(order(5), order(6), read), other.request]
    assert told[:2] == [5, 6]
    assert [reply.key for reply in told[2].replies] == [1, 2]
    assert told[3] == 3
    assert len(simulator.heard) == 4
    assert bus.statistics.nodes[1].ok == 1


def test_it_comes_to_the_same_as_one_after_the_other() -> None:
    found, written = [], []
    for together in (True, False):
        bus, simulator, line = heard_bus()
        watch = bus.trace.subscribe()
        told = volley(bus, (order(), positions(1, 2, 3)), together=together)
        assert isinstance(told[1], Answer)
        said = [(record.direction, record.data) for record in watch]
        counts = {node: (one.sent, one.ok) for node, one in bus.statistics.nodes.items()}
        found.append((told[0], told[1].replies, simulator.heard, said, counts, bus.statistics.other))
        written.append(line.sent)
    assert found[0] == found[1]
    assert written == [
        [joined(order(), positions(1, 2, 3))],
        [order().request, positions(1, 2, 3).request],
    ]


def test_who_is_doubtful_is_probed_between_the_order_and_the_question() -> None:
    bus, simulator, line = heard_bus()
    simulator.dead.add(1)
    with bus:
        with pytest.raises(NoReply):
            bus.run(position(1))
        simulator.dead.clear()
        line.sent.clear()
        told = volley(bus, (order(), position(1)))
    assert told == [7, 1]
    assert line.sent[0] == order().request
    assert len(line.sent) == 3, "the order, a probe, the question"


def test_what_is_forgiven_takes_the_place_of_its_value_and_the_rest_goes_on() -> None:
    bus, simulator, _ = heard_bus()
    simulator.dead.add(1)
    with bus:
        told = volley(bus, (order(), position(1), position(2)), FORGIVEN)
        with pytest.raises(NoReply):
            volley(bus, (order(), position(1), position(2)))
    assert (told[0], type(told[1]), told[2]) == (7, NoReply, 2)


def test_an_order_that_is_refused_keeps_all_behind_it_from_leaving() -> None:
    bus, _, line = heard_bus()

    def refuse(exchange: Exchange[Any]) -> None:
        raise Refused("no", reason="limits")

    bus.turns.admit = refuse
    with bus:
        with pytest.raises(Refused, match="no"):
            volley(bus, (order(), positions(1, 2)), FORGIVEN)
        assert line.sent == []
        with pytest.raises(Refused, match="no"):  # what went before it has left
            volley(bus, (order(1, Effect.NONE), order(), positions(1, 2)), FORGIVEN)
    assert line.sent == [order(1).request]


def test_what_must_be_asked_is_asked_before_the_order() -> None:
    bus, simulator, _ = heard_bus()
    bus.turns.look = lambda order: [position(3)] if order.effect and not simulator.heard else []
    with bus:
        volley(bus, (order(), positions(1, 2)))
    assert [wire.Instruction(one.instruction).name for one in simulator.heard] == [
        "READ",
        "SYNC_WRITE",
        "SYNC_READ",
    ]


@pytest.mark.parametrize("line_number", range(1, 4))
def test_an_interruption_leaves_the_bus_usable(line_number: int) -> None:
    bus, _, _ = heard_bus()
    link: Any = bus.link
    write, read = link.write, link.read
    cut = [True]

    def interrupted(data: Any) -> Any:
        if cut.pop() if cut else False:
            raise KeyboardInterrupt
        return (write if line_number == 1 else read)(data)

    with bus:
        setattr(link, "write" if line_number == 1 else "read", interrupted)
        if line_number == 3:
            cut[:] = [True, False]  # not the look at the line, but the wait for the answer
        with pytest.raises(KeyboardInterrupt):
            volley(bus, (order(), positions(1, 2)), FORGIVEN)
        assert not cut
        link.write, link.read = write, read
        told = volley(bus, (order(), positions(1, 2)))
    assert [reply.key for reply in told[1].replies] == [1, 2]


def test_a_link_that_is_lost_in_the_write_is_told() -> None:
    bus, _, _ = heard_bus()

    def lost(_: Data) -> None:
        raise LinkLost("gone")

    bus.link.write = lost  # type: ignore[method-assign, assignment]
    with bus:
        with pytest.raises(MotorbusError, match="gone"):
            volley(bus, (order(), positions(1, 2)))
        for alone in (order(), iter(order())):  # nobody answers it, and it is no success all the same
            with pytest.raises(MotorbusError, match="gone"):
                bus.run(alone)


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("wrong", [5, None, "ab", [order()], iter(())], ids=range(5))
def test_what_is_no_exchange_is_refused_and_nothing_is_sent(wrong: Any, together: bool) -> None:
    bus, _, line = heard_bus()
    with bus:
        for row in ((wrong,), (wrong, positions(1, 2)), (order(), wrong), (order(), position(1), wrong)):
            with pytest.raises(RequestError, match="is no exchange") as caught:
                volley(bus, row, together=together)
            assert "nothing was sent" in caught.value.advice
        assert line.sent == []
        told = volley(bus, (order(), positions(1, 2)), together=together)
    assert told[0] == 7


def test_an_attribute_that_a_caller_lacks_is_told_as_it_is() -> None:
    """What is raised in words of ours is only what concerns the exchanges themselves."""
    bus, _, _ = heard_bus()
    read = position(1)
    lacking: Any = Exchange(read.request, read.replies, lambda answer: answer.nothing)  # type: ignore[attr-defined]
    with bus, pytest.raises(AttributeError, match="nothing"):
        volley(bus, (order(), lacking))
