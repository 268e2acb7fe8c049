"""A volley in two halves: what leaves, what may happen in between, and what comes of it."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from motorbus.bus.loosed import Behind, Loosed
from motorbus.bus.pump import Bus
from motorbus.core.aimed import Aim
from motorbus.core.operation import Exchange
from motorbus.errors import Interrupted, LinkLost, NoReply, Refused
from tests.bus.responder import position
from tests.bus.struck import AIM, LATE, Landings, Struck, Train, kept, order, passing, struck_bus
from tests.bus.test_straight_ends import in_another_thread

FORGIVEN = (NoReply,)
VALUE = [(1, 0, 1, 0), (2, 0, 2, 0)], ()


def ready() -> tuple[Bus, Train, Struck, Exchange[Any]]:
    """A bus on which this exchange goes straight by now."""
    bus, simulator, line = struck_bus(start=100.0)
    bus.turns.passes = passing
    exchange = kept(1, 2)
    for _ in range(2):
        bus.volley(order(), exchange)
    line.sent.clear()
    return bus, simulator, line, exchange


def both(exchange: Exchange[Any]) -> bytes:
    return bytes(order().request) + bytes(exchange.request)  # type: ignore[arg-type]


def test_it_has_left_in_one_write_before_anybody_waits_and_its_answer_comes_when_it_is_asked_for() -> None:
    bus, simulator, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    assert line.sent == [both(exchange)]
    assert bus.statistics.nodes[1].ok == 3  # nobody has waited
    bus.link.advance(0.0001)  # type: ignore[attr-defined]
    assert volley.land() == [None, VALUE]
    assert bus.statistics.nodes[1].ok == 4
    assert simulator.heard[-2:] == simulator.heard[-4:-2]


def test_a_question_alone_can_be_let_loose_too() -> None:
    bus, _, line, exchange = ready()
    assert Loosed(bus, (exchange,)).land() == [VALUE]
    assert line.sent == [exchange.request]


@pytest.mark.parametrize("exchanges", [2, 3])
def test_what_cannot_be_halved_is_over_when_it_was_let_loose(exchanges: int) -> None:
    bus, _, line, exchange = ready()
    several = [order(), *[position(3), exchange][: exchanges - 1]]
    volley = Loosed(bus, several)
    bus.link.unplug(0.0)  # type: ignore[attr-defined]
    assert len(volley.land()) == exchanges
    assert b"".join(map(bytes, line.sent)) == b"".join(bytes(one.request) for one in several)  # type: ignore[arg-type]


def test_meanwhile_the_bus_is_free_for_others_and_everybody_gets_his_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bus, simulator, _, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    simulator.memory[3][56] = 77
    assert in_another_thread(lambda: bus.run(position(3))) == 77
    landings = Landings(monkeypatch)
    assert volley.land() == [None, VALUE]
    assert landings.ids == []  # the other one has made a usual flight of it, and has brought it down
    assert bus.volley(order(), exchange) == [None, VALUE]


def test_an_emergency_stop_meanwhile_leaves_at_once() -> None:
    bus, _, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    in_another_thread(lambda: bus.estop())
    assert len(line.sent) > 1
    with pytest.raises(Interrupted):
        volley.land()
    with pytest.raises(Interrupted):
        Loosed(bus, (order(), exchange))


@pytest.mark.parametrize("fault", ["late", "drop", "corrupt"])
def test_an_answer_that_does_not_come_in_time_is_not_taken_for_the_next_one(fault: str) -> None:
    bus, simulator, line, exchange = ready()
    line.fault = fault
    volley = Loosed(bus, (order(), exchange), FORGIVEN)
    _, (found, missing) = volley.land()
    assert (found, missing) == ([], (1, 2))
    for node in (1, 2):
        simulator.memory[node][57] = 99
    bus.link.advance(LATE)  # type: ignore[attr-defined]
    _, (found, _) = Loosed(bus, (order(), exchange), FORGIVEN).land()
    assert all(value == 99 for _, _, _, value in found)


def test_a_link_that_is_lost_meanwhile_is_told_once_it_is_asked_for() -> None:
    bus, _, _, exchange = ready()
    volley = Loosed(bus, (order(), exchange), (Exception,))
    bus.link.unplug(-inf)  # type: ignore[attr-defined]
    with pytest.raises(LinkLost):
        volley.land()
    assert bus.turns.idle


@pytest.mark.parametrize("nodes", [(1,), (1, 2)])
def test_whoever_is_interrupted_while_he_waits_leaves_no_question_behind(nodes: tuple[int, ...]) -> None:
    for stop_at in range(1, 12):
        bus, _, line, _ = ready()
        exchange = kept(*nodes)
        for _ in range(2):
            bus.volley(order(), exchange)
        line.fault = "drop"
        volley, read, looks = Loosed(bus, (order(), exchange), FORGIVEN), bus.link.read, iter(range(1, 99))

        def struck(until: float, read: Any = read, looks: Any = looks, stop_at: int = stop_at) -> Any:
            if next(looks) == stop_at:
                raise KeyboardInterrupt
            return read(until)

        bus.link.read = struck  # type: ignore[method-assign]
        try:
            volley.land()
        except KeyboardInterrupt:
            bus.link.read = read  # type: ignore[method-assign]
            assert not bus.turns.waiting, stop_at
            line.sent.clear()
            for _ in range(2):
                bus.link.advance(0.3)  # type: ignore[attr-defined]
                assert bus.run(position(3)) is not None
            assert exchange.request not in line.sent, stop_at
            assert bus.turns.idle
        else:
            assert stop_at > 2
            return
    raise AssertionError("it was interrupted each time")


# -- what leaves behind an answer --------------------------------------------------------------------------------


def test_what_is_ready_leaves_right_behind_the_answer_and_lands_next() -> None:
    bus, simulator, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    behind = volley.behind((order(),), -inf, passing)
    assert behind is not None
    line.sent.clear()
    assert volley.land(behind) == [None, VALUE]
    assert line.sent == [both(exchange)]
    assert behind.at == pytest.approx(bus.link.now())
    for node in (1, 2):
        simulator.memory[node][57] = 99
    bus.link.advance(0.001)  # type: ignore[attr-defined]
    assert volley.land() == [None, ([(1, 0, 1, 99), (2, 0, 2, 99)], ())]


def changed(bus: Bus, _: Behind) -> None:
    """Somebody has been there meanwhile."""
    assert in_another_thread(lambda: bus.run(position(3))) is not None


def stopped(_: Bus, behind: Behind) -> None:
    """Somebody else has the command by now."""
    aim = Aim(AIM.ordered, AIM.goals, lambda _: Refused("stopped"))
    behind.order = order().under(aim)


def watched(bus: Bus, _: Behind) -> None:
    bus.trace.subscribe()


def too_soon(bus: Bus, behind: Behind) -> None:
    behind.begins = bus.link.now() + 1.0


def unfit(_: Bus, behind: Behind) -> None:
    behind.fits = lambda value: value != VALUE


@pytest.mark.parametrize("against", [changed, stopped, watched, too_soon, unfit])
def test_it_does_not_leave_where_anything_is_against_it(against: Callable[[Bus, Behind], None]) -> None:
    bus, _, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    behind = volley.behind((order(),), -inf, passing)
    assert behind is not None
    against(bus, behind)
    line.sent.clear()
    assert volley.land(behind) == [None, VALUE]
    assert behind.at is None
    assert line.sent == []
    assert volley.land() == [None]  # nothing else has left


def test_what_is_ready_leaves_later_where_nothing_has_happened_since() -> None:
    bus, _, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    behind = volley.behind((order(),), inf, passing)
    assert behind is not None
    assert volley.land(behind) == [None, VALUE]
    line.sent.clear()
    bus.link.advance(0.001)  # type: ignore[attr-defined]
    assert volley.leave(behind)
    assert line.sent == [both(exchange)]
    assert behind.at == pytest.approx(bus.link.now())
    assert volley.land() == [None, VALUE]


@pytest.mark.parametrize("against", [changed, stopped, watched])
@pytest.mark.parametrize("landed", [False, True])
def test_it_does_not_leave_later_where_anything_has_happened(
    against: Callable[[Bus, Behind], None], landed: bool
) -> None:
    bus, _, line, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    behind = volley.behind((order(),), inf, passing)
    assert behind is not None
    for step in (volley.land, lambda: against(bus, behind))[:: 1 if landed else -1]:
        step()
    line.sent.clear()
    assert not volley.leave(behind)
    assert line.sent == []
    assert bus.volley(order(), exchange) == [None, VALUE]


def test_a_link_that_is_lost_before_it_leaves_is_told() -> None:
    bus, _, _, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    behind = volley.behind((order(),), inf, passing)
    assert behind is not None
    volley.land(behind)
    bus.link.unplug(-inf)  # type: ignore[attr-defined]
    with pytest.raises(LinkLost):
        volley.leave(behind)
    assert bus.turns.idle
    assert bus.relay.pumper is None


def test_nothing_is_ready_that_might_not_leave() -> None:
    bus, _, _, exchange = ready()
    volley = Loosed(bus, (order(), exchange))
    assert volley.behind((), -inf, passing) is None
    assert volley.behind((order(), order()), -inf, passing) is None
    bus.turns.passes = lambda _: False
    assert volley.behind((order(),), -inf, passing) is None
    volley.land()
    bus.turns.passes = passing
    assert volley.behind((order(),), -inf, passing) is None
