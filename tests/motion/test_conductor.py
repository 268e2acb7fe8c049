"""Work on several buses, carried out on three families' simulators and on pseudo-terminals of other processes."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.bus.pump import Bus
from motorbus.cli.simulated import Simulated
from motorbus.core.operation import Due, Exchange, Operation, Pause, Report
from motorbus.errors import Interrupted, LinkLost, NoReply
from motorbus.families.feetech import wire
from motorbus.motion.abreast import Abreast, settled
from motorbus.motion.conductor import Conductor, LoopConductor
from motorbus.motion.meeting import Beat
from motorbus.simulation.named import Simulation
from tests.bus.responder import LOCK, guarded, position
from tests.bus.several import Several, SeveralAsync, origins, single
from tests.bus.test_concert_interrupted import run_interrupted
from tests.bus.test_pump import Interrupt

KINDS = {"feetech": 3, "kst": 0x25, "stepper": 1}


@pytest.fixture
def simulations() -> Iterator[dict[str, Simulation]]:
    """One of each family, in virtual time."""
    with ExitStack() as stack:
        yield {
            family: stack.enter_context(motorbus.simulate(family, ids=(node,)))
            for family, node in KINDS.items()
        }


def model(bus: Any) -> Operation[str]:
    """What is there, as it says itself."""
    found = yield from bus.family.identify(KINDS[bus.family.name])
    return str(found.model)


def start(beat: Beat, bus: Any, name: str, origin: float, needs: float) -> Operation[tuple[float, float]]:
    """What every part of a movement does first; gives the agreed duration, and the moment of the start."""
    yield from model(bus)
    seat = beat.of(name, origin)
    duration = yield from seat.agreed(needs, lambda longest: longest)
    moment = yield from seat.start(0.02)
    return duration, moment - origin


def test_three_families_begin_at_one_moment_on_clocks_that_differ(simulations: dict[str, Simulation]) -> None:
    with ExitStack() as stack:
        buses = {name: stack.enter_context(motorbus.open(one.url)) for name, one in simulations.items()}
        began = origins(buses)
        conductor = Conductor(buses, began)
        models = conductor.run(Abreast({name: model(bus) for name, bus in buses.items()}, settled))
        assert all(models.values())
        beat = Beat(buses)
        parts = {
            name: start(beat, bus, name, began[name], 0.1 * number)
            for number, (name, bus) in enumerate(buses.items(), 1)
        }
        told = conductor.run(Abreast(parts, settled))
    assert [duration for duration, _ in told.values()] == pytest.approx([0.3] * 3)
    moments = [moment for _, moment in told.values()]
    assert max(moments) - min(moments) < 1e-9


def test_three_families_on_an_event_loop(simulations: dict[str, Simulation]) -> None:
    async def main() -> Mapping[str, Any]:
        buses = {name: motorbus.open_async(one.url) for name, one in simulations.items()}
        for bus in buses.values():
            await bus.__aenter__()
        began = origins(buses)
        conductor = LoopConductor(buses, began)
        beat = Beat(buses)
        told = await conductor.run(
            Abreast({name: start(beat, bus, name, began[name], 0.1) for name, bus in buses.items()}, settled)
        )
        for bus in buses.values():
            await bus.close()
        return told

    told = asyncio.run(main())
    moments = [moment for _, moment in told.values()]
    assert max(moments) - min(moments) < 1e-9


@pytest.mark.parametrize("make", [position, single])
def test_one_bus_is_used_as_if_there_were_no_conductor(make: Any) -> None:
    traces = []
    for conducted in (False, True):
        several = Several(True, True)
        bus = several.buses["a"]
        watch = bus.trace.subscribe()
        if conducted:
            conductor = Conductor(several.buses, several.origins)
            assert conductor.run(Abreast({"a": make(1)}, settled)) == {"a": 1}
        else:
            assert bus.run(make(1)) == 1
        traces.append(list(watch))
    assert traces[0] == traces[1]


@pytest.mark.parametrize("names", ["a", "ab"])
def test_combine_gets_values_and_errors_and_decides(names: str) -> None:
    several = Several(True, True)
    several.responders["a"].dead = {1}
    conductor = Conductor(several.buses, several.origins)

    def count(results: Mapping[str, Any]) -> list[str]:
        return [type(told).__name__ for told in results.values()]

    told = conductor.run(Abreast({name: single(1) for name in names}, count))
    assert told == ["NoReply", "int"][: len(names)]
    with pytest.raises(NoReply):
        conductor.run(Abreast({name: single(1) for name in names}, settled))


@pytest.mark.parametrize("names", ["a", "ab"])
def test_combine_gets_values_and_errors_on_an_event_loop_too(names: str) -> None:
    async def main() -> None:
        several = SeveralAsync(True, True)
        several.responders["a"].dead = {1}
        conductor = LoopConductor(several.buses, several.origins)
        with pytest.raises(NoReply):
            await conductor.run(Abreast({name: single(1) for name in names}, settled))
        assert await conductor.run(Abreast({name: single(2) for name in names}, len)) == len(names)

    asyncio.run(main())


def test_nothing_to_do_is_combined_too() -> None:
    several = Several(True)
    assert Conductor(several.buses, several.origins).run(Abreast({}, len)) == 0


# -- real pseudo-terminals, their simulators in processes of their own ------------------------------------------------


class Terminals(Several):
    """Two buses that are served by other processes."""

    def __init__(self, buses: dict[str, Bus]) -> None:
        self.responders = {}
        self.buses = buses
        self.origins = origins(buses)
        self.conductor = Conductor(buses, self.origins)
        self.concert = self.conductor._concert


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Simulated]]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with ExitStack() as stack:
        yield [stack.enter_context(Simulated("feetech", ids="1-6", link=tmp_path / name)) for name in "ab"]


@pytest.fixture
def terminals(served: list[Simulated]) -> Iterator[Terminals]:
    with ExitStack() as stack:
        a, b = (stack.enter_context(motorbus.open(one.bus)) for one in served)
        yield Terminals({"a": a, "b": b})


def own_id(node: int) -> Exchange[int]:
    """The id in its reply."""
    return position(node).reading(lambda answer: answer.replies[0].data[2])


def is_locked(bus: Bus) -> bool:
    """Is the lock register of node 1 closed?"""
    return bool(
        bus.run(Exchange(wire.read(1, LOCK, 1), (Due(1, 1, 7),), lambda answer: answer.replies[0].data[5]))
    )


@pytest.mark.usefixtures("unhurried")
def test_two_terminals_at_once(terminals: Terminals) -> None:
    for number in range(1, 7):
        work = {"a": own_id(number), "b": own_id(7 - number)}
        assert terminals.conductor.run(Abreast(work, settled)) == {"a": number, "b": 7 - number}


@pytest.mark.usefixtures("unhurried")
def test_a_silent_node_on_one_terminal_holds_up_no_other(terminals: Terminals) -> None:
    heard: list[float] = []
    failed: list[float] = []

    def ask() -> Operation[None]:
        for _ in range(5):
            yield from own_id(1)
        heard.append((yield from Pause(0)))

    def ask_nobody() -> Operation[None]:
        try:
            yield from own_id(17)
        except NoReply:
            failed.append((yield from Pause(0)))
            raise

    told = terminals.conductor.run(Abreast({"a": ask_nobody(), "b": ask()}, dict))
    assert isinstance(told["a"], NoReply)
    assert heard[0] < failed[0]


def test_interrupts_at_many_lines_leave_both_terminals_usable(terminals: Terminals) -> None:
    at, inside = 1, True
    while inside:
        inside = run_interrupted(terminals, {name: guarded(1, 60) for name in "ab"}, Interrupt(at))
        assert all(map(is_locked, terminals.buses.values())), f"interrupted at line {at}"
        told = terminals.conductor.run(Abreast({"a": own_id(2), "b": own_id(3)}, settled))
        assert told == {"a": 2, "b": 3}, f"interrupted at line {at}"
        at += 23
    assert at > 300, "the whole path was walked"


@pytest.mark.usefixtures("unhurried")
def test_threads_share_terminals_with_a_conductor(terminals: Terminals) -> None:
    wrong: list[object] = []

    def alone(name: str) -> None:
        for index in range(60):
            node = 1 + index % 6
            if (told := terminals.buses[name].run(own_id(node))) != node:
                wrong.append(told)

    def together() -> None:
        for index in range(60):
            node = 1 + index % 6
            told = terminals.conductor.run(Abreast({"a": own_id(node), "b": own_id(node)}, settled))
            if told != {"a": node, "b": node}:
                wrong.append(told)

    threads = [threading.Thread(target=alone, args=(name,)) for name in "ab"]
    threads += [threading.Thread(target=together) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(100)
    assert not any(thread.is_alive() for thread in threads)
    assert wrong == []


def test_an_emergency_stop_from_another_thread_reaches_a_terminal_meanwhile(terminals: Terminals) -> None:
    waiting = threading.Event()
    terminals.buses["b"].report = lambda event: waiting.set()
    told: dict[str, Any] = {}

    def wait() -> Operation[None]:
        yield from Report("waiting")
        yield from Pause(60.0)

    def stay() -> Operation[int]:
        while not terminals.buses["b"].turns.latched:
            yield from own_id(1)
        return (yield from own_id(4))

    thread = threading.Thread(
        target=lambda: told.update(terminals.conductor.run(Abreast({"a": stay(), "b": wait()}, dict)))
    )
    terminals.buses["b"].run(own_id(1))  # so that somebody is known there
    thread.start()
    assert waiting.wait(60)
    assert terminals.buses["b"].estop().acknowledged == (1,)
    thread.join(60)
    assert isinstance(told["b"], Interrupted)
    assert told["a"] == 4


@pytest.mark.usefixtures("unhurried")
def test_a_terminal_whose_process_ends_is_lost_and_the_other_goes_on(
    terminals: Terminals, served: list[Simulated]
) -> None:
    terminals.buses["b"].report = lambda event: served[0].process.terminate()

    def wait() -> Operation[int]:
        yield from Report("now")
        yield from Pause(0.05)
        return (yield from own_id(1))

    told = terminals.conductor.run(Abreast({"a": iter(Pause(60.0)), "b": wait()}, dict))
    assert isinstance(told["a"], LinkLost)
    assert told["b"] == 1


@pytest.mark.usefixtures("unhurried")
def test_two_terminals_on_an_event_loop(served: list[Simulated]) -> None:
    async def main() -> None:
        async with motorbus.open_async(served[0].bus) as a, motorbus.open_async(served[1].bus) as b:
            conductor = LoopConductor({"a": a, "b": b}, origins({"a": a, "b": b}))
            for number in range(1, 7):
                work = {"a": own_id(number), "b": own_id(7 - number)}
                assert await conductor.run(Abreast(work, settled)) == {"a": number, "b": 7 - number}

    asyncio.run(main())
