"""Several blocking buses at once: results, clocks in step, threads beside it, and links of every kind."""

from __future__ import annotations

import threading
import time
from itertools import pairwise
from typing import Any

import pytest

from motorbus.bus.concert import Bell
from motorbus.bus.pump import Bus
from motorbus.core.operation import Listen, Operation, Pause, Report
from motorbus.errors import Interrupted, LinkLost, NoReply
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import guarded, position
from tests.bus.script import admit_all
from tests.bus.several import Several, single, wander

CLOCKS = [(True, True), (False, False), (True, False), (False, True, True)]
AS_GOOD_AS_EQUAL = 1e-9  # s; each clock has an origin of its own, and sums of floats are rounded


@pytest.mark.parametrize("virtual", CLOCKS)
def test_each_bus_has_its_own_result(virtual: tuple[bool, ...]) -> None:
    several = Several(*virtual)
    for make in (position, single):
        told = several.concert.run({name: make(number) for number, name in enumerate(several.buses, 1)})
        assert told == {name: number for number, name in enumerate(several.buses, 1)}
    several.close()


@pytest.mark.parametrize("virtual", CLOCKS)
def test_an_error_on_one_is_its_result_and_disturbs_no_other(virtual: tuple[bool, ...]) -> None:
    several = Several(*virtual)
    several.responders["a"].dead = {1}
    told = several.concert.run({"a": single(1), "b": guarded(1, 9)})
    assert isinstance(told["a"], NoReply)
    assert told["b"] is None
    assert several.responders["b"].memory[1][20] == 9
    several.close()


def test_nothing_to_do_is_done_at_once() -> None:
    assert Several(True).concert.run({}) == {}


def test_who_acts_acts_at_the_time_that_all_clocks_show() -> None:
    several = Several(True, True, True)
    log: list[tuple[float, str]] = []
    told = several.concert.run(
        {name: wander(seed, name, several.origins[name], log) for seed, name in enumerate(several.buses, 1)}
    )
    assert told == {"a": 1, "b": 2, "c": 3}
    assert len(log) == 90
    assert all(later[0] - sooner[0] > -AS_GOOD_AS_EQUAL for sooner, later in pairwise(log))
    assert {name for _, name in log[:20]} == {"a", "b", "c"}, "they were under way together"


def test_the_same_seed_gives_the_same_bytes_at_the_same_moments() -> None:
    traces = []
    for _ in range(2):
        several = Several(True, True, True)
        watches = [bus.trace.subscribe() for bus in several.buses.values()]
        several.concert.run({name: wander(7, name, 0.0, []) for name in several.buses})
        traces.append([list(watch) for watch in watches])
    assert traces[0] == traces[1]
    assert all(traces[0])


def test_a_bus_gets_the_same_bytes_alone_and_in_company() -> None:
    alone, together = Several(True), Several(True, True)
    watches = [one.buses["a"].trace.subscribe() for one in (alone, together)]
    alone.buses["a"].run(wander(3, "a", 0.0, []))
    together.concert.run({name: wander(seed, name, 0.0, []) for seed, name in ((3, "a"), (4, "b"))})
    first, second = (list(watch) for watch in watches)
    assert [record.data for record in first] == [record.data for record in second]
    assert [record.at for record in first] == pytest.approx([record.at for record in second])


def test_nobody_begins_before_the_latest_of_them() -> None:
    several = Several(True, True)
    several.buses["b"].run(Pause(5.0).__iter__())
    begun: dict[str, float] = {}

    def begin(name: str) -> Operation[None]:
        begun[name] = (yield from Pause(0)) - several.origins[name]

    several.concert.run({name: begin(name) for name in several.buses})
    assert begun == pytest.approx({"a": 5.0, "b": 5.0})


def test_clocks_end_together_also_that_of_a_bus_that_was_ready_long_before() -> None:
    several = Several(True, True)
    several.concert.run({"a": single(1), "b": iter(Pause(3.0))})
    ends = [bus.link.now() - several.origins[name] for name, bus in several.buses.items()]
    assert ends == pytest.approx([3.0, 3.0])


def test_a_virtual_clock_beside_a_real_one_never_runs_ahead_of_it() -> None:
    several = Several(True, False)
    ahead: list[float] = []

    def work(name: str) -> Operation[None]:
        for _ in range(10):
            now = yield from Pause(0.002)
            wall = several.buses["b"].link.now() - several.origins["b"]
            ahead.append(now - several.origins[name] - wall)
            yield from position(1)

    several.concert.run({name: work(name) for name in several.buses})
    assert len(ahead) == 20
    assert max(ahead) < AS_GOOD_AS_EQUAL
    several.close()


def test_a_virtual_clock_that_has_run_ahead_is_waited_for_by_a_real_one() -> None:
    several = Several(True, False)
    several.buses["a"].run(iter(Pause(0.05)))
    begun: dict[str, float] = {}

    def begin(name: str) -> Operation[None]:
        begun[name] = (yield from Pause(0)) - several.origins[name]

    several.concert.run({name: begin(name) for name in several.buses})
    assert min(begun.values()) >= 0.05 - AS_GOOD_AS_EQUAL
    several.close()


class Untold(MemoryLink):
    """Like a port without descriptor: nobody knows when something will come."""

    due = None  # type: ignore[assignment]


@pytest.mark.parametrize("virtual", [True, False])
def test_links_that_cannot_tell_when_something_comes_are_looked_at(virtual: bool) -> None:
    several = Several(virtual, virtual)
    link = Untold(several.responders["a"], virtual=virtual)
    several.buses["a"] = Bus(link, FAMILY, admit=admit_all)
    several.origins["a"] = link.now()
    told = several.concert.run({"a": guarded(1, 9), "b": wander(1, "b", several.origins["b"], [])})
    assert told == {"a": None, "b": 1}
    assert several.responders["a"].memory[1][20] == 9
    several.close()


@pytest.mark.parametrize("virtual", CLOCKS)
def test_a_bus_that_is_closed_meanwhile_says_so_and_the_others_go_on(virtual: tuple[bool, ...]) -> None:
    several = Several(*virtual)

    def close() -> Operation[int]:
        yield from Report("now")
        return (yield from single(2))

    several.buses["a"].report = lambda event: several.buses["b"].close()
    told = several.concert.run({"b": iter(Pause(60.0)), "a": close()})
    assert told["a"] == 2
    assert isinstance(told["b"], LinkLost)
    several.close()


def test_a_bus_that_was_closed_before_hinders_nobody() -> None:
    several = Several(True, True)
    several.buses["a"].run(iter(Pause(1.0)))
    several.buses["b"].close()
    told = several.concert.run({name: single(1) for name in several.buses})
    assert told["a"] == 1
    assert isinstance(told["b"], LinkLost)


def test_an_emergency_stop_of_another_thread_gets_through() -> None:
    several = Several(False, False)
    waiting = threading.Event()
    several.buses["b"].report = lambda event: waiting.set()
    told: dict[str, Any] = {}

    def wait() -> Operation[object]:
        yield from Report("waiting")
        return (yield from Listen(lambda notice: False, 60.0))

    def stay() -> Operation[int]:
        while not several.buses["a"].turns.latched:
            yield from Pause(0.001)
        return (yield from single(3))

    def work() -> None:
        told.update(several.concert.run({"a": stay(), "b": wait()}))

    several.buses["b"].run(guarded(1, 2))  # so that somebody is known there
    thread = threading.Thread(target=work)
    thread.start()
    assert waiting.wait(60)
    assert several.buses["b"].estop().acknowledged == (1,)
    several.buses["a"].estop()
    thread.join(60)
    assert not thread.is_alive()
    assert isinstance(told["b"], Interrupted)
    assert isinstance(told["a"], Interrupted)
    several.close()


def test_other_threads_may_use_the_same_buses() -> None:
    several = Several(False, False)
    wrong: list[object] = []

    def alone(name: str, node: int) -> None:
        for _ in range(20):
            value = several.buses[name].run(position(node))
            if value != node:
                wrong.append((name, node, value))

    def together(node: int) -> None:
        for index in range(20):
            make = position if index % 2 else single
            told = several.concert.run({"a": make(node), "b": make(node + 1)})
            if told != {"a": node, "b": node + 1}:
                wrong.append((node, told))

    threads = [threading.Thread(target=alone, args=("ab"[index % 2], index + 1)) for index in range(6)]
    threads += [threading.Thread(target=together, args=(10 + index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(100)
    assert not any(thread.is_alive() for thread in threads)
    assert wrong == []
    assert all(bus.relay.pumper is None and not bus.relay.bells for bus in several.buses.values())
    several.close()


@pytest.mark.parametrize("virtual", [True, False])
def test_a_thread_that_pumps_one_of_the_buses_hinders_nobody(virtual: bool) -> None:
    several = Several(virtual, virtual)
    relay = several.buses["a"].relay
    relay.pumper = -1
    told: list[dict[str, Any]] = []
    work = {"a": single(1), "b": single(2)}
    thread = threading.Thread(target=lambda: told.append(several.concert.run(work)))
    thread.start()
    if virtual:  # time there passes by the one who pumps alone
        while not several.buses["a"].statistics.of(1).sent:
            time.sleep(0.001)
        relay.hand_over()
    thread.join(60)
    assert told == [{"a": 1, "b": 2}]
    relay.pumper = None
    several.close()


def test_a_report_may_do_work_of_its_own_on_the_same_buses() -> None:
    several = Several(False, False)
    inner: list[dict[str, Any]] = []
    several.buses["a"].report = lambda event: inner.append(
        several.concert.run({"a": single(3), "b": single(4)})
    )

    def outer() -> Operation[int]:
        yield from Report("now")
        return (yield from single(1))

    assert several.concert.run({"a": outer(), "b": single(2)}) == {"a": 1, "b": 2}
    assert inner == [{"a": 3, "b": 4}]
    several.close()


def test_a_bell_is_heard_from_other_threads_only_and_once() -> None:
    bell = Bell()
    bell.thread = threading.get_ident()
    bell.ring()
    assert bell.wait([], 0.0) == []

    def ring() -> None:
        for _ in range(100_000):
            bell.ring()

    thread = threading.Thread(target=ring)
    thread.start()
    thread.join()
    assert bell.wait([], 60.0) == [bell.descriptor]
    while bell.wait([], 0.0):
        pass
    assert bell.wait([-1, 3], 60.0) == [-1, 3], "a closed one is for its reader to tell of"
