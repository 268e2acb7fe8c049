"""However a straight flight ends, the bus is usable and doubts whom it must: an interrupt at any line, a lost link."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from motorbus.bus.loosed import Loosed
from motorbus.bus.pump import Bus
from motorbus.errors import LinkLost
from tests.bus.responder import position
from tests.bus.struck import Struck, Train, kept, one_behind_the_other, order, passing, struck_bus
from tests.bus.test_pump import Interrupt

CALLS: dict[str, tuple[tuple[int, ...], Callable[[Bus, Any], Any]]] = {
    "one": ((1,), lambda bus, exchange: bus.run(exchange)),
    "group": ((1, 2, 3), lambda bus, exchange: bus.run(exchange)),
    "volley": ((1, 2), lambda bus, exchange: bus.volley(order(), exchange)),
    "cast": ((1,), lambda bus, exchange: bus.run(order())),
    "loosed": ((1, 2), lambda bus, exchange: Loosed(bus, (order(), exchange)).land()),
    "behind": ((1, 2), lambda bus, exchange: one_behind_the_other(bus, exchange)),
    "later": ((1, 2), lambda bus, exchange: one_behind_the_other(bus, exchange, inf)),
}


def interrupted(call: Callable[[], Any], at: int) -> bool:
    """Call this, and interrupt it at that line of the bus; False when it was over before."""
    tracer = Interrupt(at)
    before = sys.gettrace()
    sys.settrace(tracer)
    try:
        call()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
    return tracer.count >= at


def in_another_thread(call: Callable[[], Any]) -> Any:
    """What comes of it there; a lock that is not free keeps it waiting, and this fails."""
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(call()), daemon=True)
    thread.start()
    thread.join(20)
    assert found, "the lock is still held"
    return found[0]


def has_the_lock(bus: Bus) -> bool:
    taken = bus.turns.lock.acquire(timeout=10)
    if taken:
        bus.turns.lock.release()
    return taken


def flown(nodes: tuple[int, ...]) -> tuple[Bus, Train, Struck, Any]:
    """A bus on which this exchange has gone straight, and a reply of it that has another value than the next."""
    bus, simulator, line = struck_bus(start=100.0)
    bus.turns.passes = passing  # what leaves behind an answer was judged before
    exchange = kept(*nodes)
    for _ in range(3):
        bus.run(exchange)
        bus.link.advance(0.001)  # type: ignore[attr-defined]
    assert exchange.course is not None
    return bus, simulator, line, exchange


def unanswered(bus: Bus) -> list[int]:
    """Whose answers are still due."""
    with bus.turns.lock:
        flights = [flight for flight in bus.turns.flying.values() if not flight.complete]
    return [due.node for flight in flights for due in flight.exchange.replies]  # type: ignore[union-attr]


def heard_of_all(bus: Bus, exchange: Any) -> Any:
    """A group says who is missing, and does not wait; who was silent twice is left alone for a while."""
    value = bus.run(exchange)
    if value[1]:
        bus.link.advance(1.0)  # type: ignore[attr-defined]
        value = bus.run(exchange)
    return value


CASES = [(what, "", rest) for what in CALLS for rest in (0.0, 0.01)]
CASES += [
    (what, fault, 0.0)
    for what in ("one", "group", "volley", "loosed", "behind", "later")
    for fault in ("late", "drop", "split", "apart", "bytes")
]


@pytest.mark.parametrize(("what", "fault", "rest"), CASES)
def test_an_interrupt_at_any_line_leaves_the_bus_usable_and_believes_nobody(
    what: str, fault: str, rest: float, rounds: Any
) -> None:
    step = 1 if not fault else 1000 // rounds(1000, 100)  # most of the lines are those of the usual way then
    nodes, call = CALLS[what]
    at = 1 - step
    while True:
        at += step
        bus, simulator, line, exchange = flown(nodes)
        line.fault = fault
        line.sent.clear()
        if not interrupted(lambda: call(bus, exchange), at):  # noqa: B023 - called at once
            break
        assert bus.relay.pumper is None, f"line {at}"
        assert in_another_thread(lambda: has_the_lock(bus)), f"line {at}"  # noqa: B023 - called at once
        assert all(bus.turns.trust.nodes[node].tainted for node in unanswered(bus)), f"line {at}"
        line.fault = line.fault if line.sent else ""
        bus.link.advance(rest)  # type: ignore[attr-defined]  # what has left is there, and answered with 0
        for node in nodes:
            simulator.memory[node][57] = 99
        value = in_another_thread(lambda: bus.run(exchange))  # noqa: B023 - called at once
        value = value if not value[1] else heard_of_all(bus, exchange)
        assert value == ([(node, 0, node, 99) for node in nodes], ()), f"line {at}"
        assert bus.run(position(6)) == 6
    assert at > 20


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("nodes", [(1,), (1, 2, 3)])
def test_a_link_that_is_lost_is_told(nodes: tuple[int, ...], ahead: bool) -> None:
    bus, _, _, exchange = flown(nodes)
    for moment in (-inf, bus.link.now() + 0.00005):  # before it is written, and before the answer is here
        bus.link.unplug(moment)  # type: ignore[attr-defined]
        with pytest.raises(LinkLost):
            bus.volley(order(), exchange) if ahead else bus.run(exchange)
        assert bus.relay.pumper is None
        assert in_another_thread(lambda: has_the_lock(bus))
        bus.link.plug()  # type: ignore[attr-defined]
        assert in_another_thread(lambda: bus.run(exchange))[1] == ()
        bus.run(exchange)


@pytest.mark.parametrize("when", ["look", "write", "wait"])
@pytest.mark.parametrize("what", ["one", "volley"])
def test_a_link_that_is_lost_at_any_call_is_told_and_all_that_was_asked_fails(what: str, when: str) -> None:
    nodes, call = CALLS[what]
    bus, _, _, exchange = flown(nodes)
    link: Any = bus.link
    name = "write" if when == "write" else "read"
    true, calls = getattr(link, name), [when == "wait"]

    def gone(given: Any) -> Any:
        if calls.pop():  # the first look finds nothing
            return true(given)
        raise LinkLost("the adapter was unplugged")

    setattr(link, name, lambda given: gone(given) if calls else true(given))
    calls[:] = [False, True] if when == "wait" else [False]
    before = {node: bus.statistics.nodes[node].sent for node in nodes}
    with pytest.raises(LinkLost, match="unplugged"):
        call(bus, exchange)
    assert not calls
    assert not bus.turns.flying
    assert (bus.turns.aloft, bus.relay.pumper) == (None, None)
    for node in nodes:
        one = bus.statistics.nodes[node]
        assert one.sent - before[node] == one.errors["lost"] == (0 if when == "look" else 1)
        assert bus.turns.trust.nodes[node].tainted == (when != "look")
    assert in_another_thread(lambda: bus.run(exchange))[1] == ()


def test_a_cast_over_a_lost_link_is_told() -> None:
    bus, _, line, _ = flown((1,))
    bus.run(order())
    bus.link.unplug()  # type: ignore[attr-defined]
    line.sent.clear()
    with pytest.raises(LinkLost):
        bus.run(order())
    assert in_another_thread(lambda: has_the_lock(bus))
    bus.link.plug()  # type: ignore[attr-defined]
    bus.run(order())
    assert line.sent[-1] == order().request
