"""The blocking pump: threads share a bus, and an interrupt at any line leaves it usable."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import motorbus
from motorbus.core.operation import Exchange, Operation
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import async_bus, memory_bus, position, positions

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
