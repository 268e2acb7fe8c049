"""The blocking pump: threads share a bus, and an interrupt at any line leaves it usable."""

from __future__ import annotations

import sys
import threading
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import motorbus
from motorbus.bus.pump import Bus
from motorbus.core.operation import Exchange, Operation
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import LOCK, Responder, async_bus, guarded, memory_bus, position, positions
from tests.conftest import Rounds
from tests.faults.cutting import Outcome, Twice, cut

PACKAGE = Path(motorbus.__file__).parent
BUS_FILES = {str(path) for path in (PACKAGE / "bus").glob("*.py")} | {str(PACKAGE / "core" / "operation.py")}


def single(node: int) -> Operation[int]:
    return (yield from position(node))


def test_the_short_path_and_the_queue_leave_equal_traces() -> None:
    traces = []
    for make in (position, single):
        bus, _ = memory_bus()
        watch = bus.trace.subscribe()
        values = [bus.run(make(node)) for node in (1, 2, 3, 1)]
        traces.append((values, list(watch)))
    assert traces[0] == traces[1]
    assert len(traces[0][1]) == 8


def test_a_prepared_exchange_can_be_run_again() -> None:
    bus, _ = memory_bus()
    prepared = positions(1, 2, 3)
    for _ in range(3):
        assert bus.run(prepared).missing == ()


def test_a_lost_link_raises_link_lost_everywhere_and_at_once() -> None:
    bus, _ = memory_bus()
    link: Any = bus.link
    link.unplug()
    for operation in (position(1), single(1)):
        with pytest.raises(LinkLost):
            bus.run(operation)
    link.plug()
    assert bus.run(position(2)) == 2


def test_many_threads_share_one_bus() -> None:
    bus, _ = memory_bus(virtual=False)
    wrong: list[object] = []

    def work(node: int) -> None:
        for index in range(20):
            make = position if index % 2 else single
            value = bus.run(make(node))
            if value != node:
                wrong.append((node, value))

    threads = [threading.Thread(target=work, args=(1 + index % 20,)) for index in range(64)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in threads)
    assert wrong == []
    ledgers = bus.statistics.nodes.values()
    assert sum(ledger.ok for ledger in ledgers) >= 64 * 20, "more when a busy machine made one late"
    assert all(ledger.sent == ledger.ok + sum(ledger.errors.values()) for ledger in ledgers)
    bus.close()


def test_a_closed_bus_says_so() -> None:
    bus, _ = memory_bus()
    with bus:
        assert bus.run(position(1)) == 1
    with pytest.raises(LinkLost, match="closed"):
        bus.run(position(1))


class Interrupt:
    """Raises KeyboardInterrupt at the nth executed line of the bus's own files, once."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code.co_filename not in BUS_FILES:
            return None
        if event == "line":
            self.count += 1
            if self.count == self.at:
                raise KeyboardInterrupt
        return self


def run_interrupted(bus: Any, operation: Any, at: int) -> bool:
    """True when the interrupt fell inside the run."""
    tracer = Interrupt(at)
    before = sys.gettrace()
    sys.settrace(tracer)
    try:
        bus.run(operation)
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
    return tracer.count >= at


def check_usable(bus: Any, responder: Responder, at: int) -> None:
    """The next exchanges are right, from this thread and from another."""
    assert bus.run(position(1)) == 1, f"interrupted at line {at}"
    assert bus.run(single(2)) == 2, f"interrupted at line {at}"
    others: list[int] = []
    thread = threading.Thread(target=lambda: others.append(bus.run(position(3))))
    thread.start()
    thread.join(20)
    assert others == [3], f"interrupted at line {at}: the lock is still held"
    assert responder.memory[1][LOCK] == 1, f"interrupted at line {at}: the lock register is open"


@pytest.mark.parametrize("make", [lambda: position(1), lambda: single(1), lambda: guarded(1, 9)])
def test_an_interrupt_at_any_line_leaves_the_bus_usable(make: Any) -> None:
    at = 0
    while True:
        at += 1
        bus, responder = memory_bus()
        inside = run_interrupted(bus, make(), at)
        check_usable(bus, responder, at)
        if not inside:
            break
    assert at > 100, "the whole path was walked"


class InterruptTwice(Interrupt):
    """Once more, some lines after the first; but Python puts away a tracer that raises, so `Twice` is what strikes."""

    def __init__(self, at: int, later: int) -> None:
        super().__init__(at)
        self.later = later

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        again = super().__call__(frame, event, argument)
        if event == "line" and again is not None and self.count == self.at + self.later:
            raise KeyboardInterrupt
        return again


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("later", [1, 2, 3, 5, 8, 13, 21, 34, 55, 89])
def test_a_second_interrupt_shortens_the_clean_up_and_never_skips_it(later: int, rounds: Rounds) -> None:
    cuts, twice = 0, 0
    for at in range(1, 600, 600 // rounds(600, 86)):
        bus, responder = memory_bus()
        came = twice_cut(bus, at, later)
        assert isinstance(came.error, KeyboardInterrupt), (came.where, came.again)
        assert left_over(bus) == [], (came.where, came.again)
        check_usable(bus, responder, at)
        cuts += 1
        twice += came.again is not None
    assert twice >= cuts * 2 / 3  # the others were over by then


def twice_cut(bus: Bus, at: int, later: int) -> Outcome:
    """A guarded change on this bus, cut there and so many lines later."""
    return cut(lambda: bus.run(guarded(1, 9)), at, KeyboardInterrupt, later, Twice)


def left_over(bus: Bus) -> list[object]:
    """What still waits on this bus."""
    turns = bus.turns
    return [*chain(*turns._queues), *turns._timers, *turns._claims.waiting, *turns._claims.held]


def test_a_dead_node_among_threads_fails_only_its_own() -> None:
    bus, responder = memory_bus(virtual=False)
    responder.dead = {7}
    results: dict[int, object] = {}

    def work(node: int) -> None:
        try:
            results[node] = bus.run(position(node))
        except NoReply as error:
            results[node] = error

    threads = [threading.Thread(target=work, args=(node,)) for node in range(1, 11)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert isinstance(results.pop(7), NoReply)
    assert results == {node: node for node in range(1, 11) if node != 7}
    bus.close()


def test_the_blocking_and_the_async_bus_share_everything_but_waiting() -> None:
    blocking, _ = memory_bus()
    awaiting, _ = async_bus()
    assert set(vars(blocking)) >= {"link", "family", "turns", "stopper"}
    assert type(blocking).__mro__[1] is type(awaiting).__mro__[1]
    exchange: Exchange[int] = position(1)
    assert blocking.run(exchange) == 1


@pytest.mark.parametrize("name", ["pump.py", "aio.py"])
def test_the_pumps_stay_small(name: str) -> None:
    """Under 80 lines with everything in them: whoever waits for bytes has no business with policy."""
    assert len((PACKAGE / "bus" / name).read_text().splitlines()) < 80
