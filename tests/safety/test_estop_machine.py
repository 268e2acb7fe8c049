"""An emergency stop of a whole machine when everything is wrong at once: a bus full of garbage, a bus whose port takes
nothing, thousands of orders on each, and an event loop that hangs. In virtual time, where a delay is a number.

What the wall clock says of it, over real pseudo-terminals, is measured by `make bench`.
"""

from __future__ import annotations

import asyncio
from threading import Event, Thread
from typing import Any, NamedTuple

import pytest

from motorbus import AsyncRobot
from motorbus.core.operation import Data
from motorbus.simulation.named import Simulation
from tests.safety.test_estop import MOST, is_stop, is_target, queued
from tests.support.machines import machine
from tests.support.world import is_stopping

CHUNK = 0.001  # s of the line that one piece of garbage fills
FAMILIES = {"arm": "feetech", "can": "kst", "stage": "stepper"}
LIMITS = {"arm": MOST["feetech"], "can": MOST["kst"], "stage": MOST["stepper"]}
NODES = {"arm": (1, 2, 3), "can": (0x25, 0x26), "stage": (1,)}
LONG = 60.0  # s until a test that hangs says so


class Went(NamedTuple):
    """What left on each bus, and when (s after the stop was asked for); and who was still waiting then."""

    sent: dict[str, list[tuple[float, Data]]]
    outcomes: dict[str, Any]
    while_blocked: set[str]


def babble(sim: Simulation, link: Any) -> None:
    """From now on somebody on this line talks without a pause."""
    inner = sim.simulator.advance
    piece = b"\xff\xff\x02\x99" * 25  # 100 bytes: 1 ms at 1 Mbaud
    told = link.now()

    def advance(to: float) -> list[tuple[float, Data]]:
        nonlocal told
        found = inner(to)
        while told + CHUNK <= to:
            told += CHUNK
            found.append((told, piece))
        return sorted(found, key=lambda one: one[0])

    sim.simulator.advance = advance  # type: ignore[method-assign]
    sim.simulator.due = lambda: told + CHUNK  # type: ignore[method-assign]


def stopped(can: str, *, hold: bool = False) -> Went:
    """Stop such a machine; its bus `can` is well, its port is "blocked", or it is "gone"."""
    ready, freed, go_on = Event(), Event(), Event()
    there: list[AsyncRobot] = []
    with machine(arm="1-3", can="0x25,0x26", lift=True, axes={"a2": {"estop": "hold"}} if hold else {}) as (
        made,
        sims,
    ):
        for sim in sims.values():
            sim.pace = True

        async def main() -> None:
            async with AsyncRobot.of(made) as robot:
                await robot.enable_torque()
                prepared(robot, sims, can, freed)
                there.append(robot)
                ready.set()
                assert go_on.wait(LONG), "the event loop hangs here, until the stop is over"

        looping = Thread(target=lambda: asyncio.run(main()), daemon=True)
        looping.start()
        assert ready.wait(LONG)
        try:
            return measured(there[0], freed)
        finally:
            go_on.set()
            looping.join(LONG)


def prepared(robot: AsyncRobot, sims: dict[str, Simulation], can: str, freed: Event) -> None:
    for name, bus in robot.buses.items():
        queued(bus, NODES[name])
    babble(sims["arm"], robot.buses["arm"].link)
    link: Any = robot.buses["can"].link
    if can == "blocked":
        write = link.write

        def blocks(data: Data) -> None:
            assert freed.wait(LONG)
            write(data)

        link.write = blocks
    elif can == "gone":
        link.close()


def measured(robot: AsyncRobot, freed: Event) -> Went:
    asked = {name: bus.link.now() for name, bus in robot.buses.items()}
    records = {name: bus.trace.subscribe(limit=100_000) for name, bus in robot.buses.items()}
    found: dict[str, Any] = {}
    stopping = Thread(target=lambda: found.update(robot.estop()), daemon=True)
    stopping.start()
    others = [bus for name, bus in robot.buses.items() if name != "can"]
    for _ in range(int(LONG / 0.01)):
        stopping.join(0.01)
        if all(bus.latched and not is_stopping(bus) for bus in others):
            break
    waiting = {name for name, bus in robot.buses.items() if is_stopping(bus) or not bus.latched}
    freed.set()
    stopping.join(LONG)
    assert not stopping.is_alive()
    sent = {
        name: [(one.at - asked[name], one.data) for one in records[name] if one.direction == "tx"]
        for name in robot.buses
    }
    return Went(sent, found, waiting)


@pytest.mark.parametrize("hold", [False, True], ids=["torque off", "one holds"])
def test_06_the_first_byte_is_in_time_on_every_bus_with_everything_wrong_at_once(hold: bool) -> None:
    went = stopped("blocked", hold=hold)
    assert went.while_blocked == {"can"}, (
        "the others were over while that one still hung, and so did the loop"
    )
    for name, most in LIMITS.items():
        at, first = went.sent[name][0]
        assert at <= most, name
        assert is_stop(FAMILIES[name], first), name
        assert all(is_stop(FAMILIES[name], data) for _, data in went.sent[name]) or (hold and name == "arm")
        assert went.outcomes[name].rounds <= 5
    assert next(at for at, data in went.sent["can"] if is_target(data)) <= LIMITS["can"]
    assert went.outcomes["stage"].acknowledged == (1,)
    assert set(went.outcomes["can"].acknowledged) == {0x25, 0x26}


@pytest.mark.parametrize("can", ["blocked", "gone"])
def test_06_a_bus_that_is_dead_delays_the_others_by_nothing(can: str) -> None:
    well, dead = stopped("well"), stopped(can)
    for name in ("arm", "stage"):
        assert dead.sent[name] == well.sent[name], "the same frames at the same instants"
