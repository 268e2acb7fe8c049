"""Row L16 on the straight way: 64 threads, or tasks, that keep what they ask, alone and in groups, and share some.

The device counts as in `test_crowd`: an answer that is lost, that comes twice or to somebody else is known by its
number. A crowd meets a flight that goes straight at every line of it.
"""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

from motorbus.bus.aio import AsyncBus
from motorbus.bus.pump import Bus
from motorbus.core.operation import ANY, UNLIKE, Answer, Due, Exchange, Unlike
from motorbus.errors import NoReply
from motorbus.families.feetech import FAMILY, wire
from motorbus.families.feetech.driver.gauge import Packets
from tests.bus.script import admit_all
from tests.bus.struck import Landings, Train
from tests.conftest import Figures, Rounds
from tests.faults.test_crowd import CROWD, NODES, Counting, Crowd, at_the_end_of, restless

__all__ = ["restless"]
Numbers = dict[int, int]
COUNT = 4
GROUP = 3


class Numbered(Counting, Train):
    """Counts, and says a train at once."""


def kept(*nodes: int, count: int = COUNT) -> Exchange[Numbers]:
    """How often each of these has been asked by now; kept as a control loop does."""
    packets = Packets(nodes, count)

    def read(answer: Answer) -> Numbers:
        return {
            reply.data[2]: int.from_bytes(reply.data[5 : 5 + COUNT], "little") for reply in answer.replies
        }

    def whole(data: bytes, at: float) -> Numbers | Unlike:
        if not packets.are_sound(data):
            return UNLIKE
        parts = [data[part] for part in packets.parts]
        return {part[2]: int.from_bytes(part[5 : 5 + COUNT], "little") for part in parts}

    return Exchange(
        wire.read(nodes[0], 56, count) if len(nodes) == 1 else wire.sync_read(56, count, nodes),
        tuple(Due(node, node, 6 + count) for node in nodes),
        read,
        repeatable=True,
        whole=whole,
        other=lambda: kept(*nodes, count=2 * COUNT + 1 - count),
    )


def answers(exchange: Exchange[Numbers]) -> int:
    """How many numbers it brings."""
    assert exchange.replies is not ANY
    return len(exchange.replies)


class Kept(Crowd):
    """Every second member has questions of its own, the others share theirs; every fourth asks a group."""

    def __init__(self) -> None:
        super().__init__()
        self._all: dict[Any, Exchange[Numbers]] = {}
        self.answers = 0

    def asks(self, who: int, index: int) -> Exchange[Numbers]:
        """What this member asks next; the same for some time, as a loop does."""
        first = 1 + (who + index // 8) % (len(NODES) - GROUP)
        nodes = tuple(range(first, first + (GROUP if who % 4 == 3 else 1)))
        return self._all.setdefault((nodes, who if who % 2 else -1), kept(*nodes))

    def note(self, told: Numbers) -> None:
        for node, number in told.items():
            self.told[node][number] += 1

    def due(self, times: int) -> int:
        """How many numbers all of them are to be told."""
        return sum(answers(self.asks(who, index)) for who in range(CROWD) for index in range(times))


def threads(crowd: Kept, bus: Bus, times: int) -> None:
    """Two of them have the bus at a time: where all of them press on to it, hardly anything goes straight."""
    lock, turn = threading.Lock(), threading.Semaphore(2)

    def member(who: int) -> None:
        try:
            with turn:
                for index in range(times):
                    told = bus.run(crowd.asks(who, index))
                    with lock:
                        crowd.note(told)
        except BaseException as error:
            crowd.failed.append(error)

    everyone = [threading.Thread(target=member, args=(who,)) for who in range(CROWD)]
    for thread in everyone:
        thread.start()
    for thread in everyone:
        thread.join()


@pytest.mark.faultless("the line is perfect: what goes wrong would be the crowd's own doing")
@pytest.mark.timeout(3600)
@pytest.mark.usefixtures("restless")
def test_l16_a_crowd_of_threads_whose_questions_go_straight(
    rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = rounds(200_000, 960) // CROWD
    device, crowd, landings = Numbered(), Kept(), Landings(monkeypatch)
    with at_the_end_of(False, device) as link:
        bus = Bus(link, FAMILY, admit=admit_all)
        bus.turns.echo.excluded()
        for node in NODES:
            crowd.note(bus.run(kept(node)))
        threads(crowd, bus, times)
        bus.turns.made_good()
        due = crowd.due(times) + len(NODES)
        retries = crowd.judge(device, bus, due)
        bus.close()
    figures(
        f"L16 a crowd of {CROWD} threads on the straight way in virtual time",
        family="feetech", answers=due, straight=len(landings.ids), retries=retries,
        said_to_be_silent=len(crowd.silent),
    )  # fmt: skip
    assert (retries, crowd.silent) == (0, [])
    assert len(landings.ids) > 2 * CROWD


@pytest.mark.faultless("the line is perfect: what goes wrong would be the crowd's own doing")
@pytest.mark.timeout(3600)
@pytest.mark.usefixtures("restless")
def test_l16_a_crowd_of_tasks_whose_questions_go_straight(
    rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a pseudo-terminal. A group whose train is held up may be told without some, who are asked again later."""
    times = rounds(25_600, 320) // CROWD
    device, crowd, landings = Numbered(), Kept(), Landings(monkeypatch)
    missed = 0

    async def main(bus: AsyncBus) -> None:
        nonlocal missed

        async def member(who: int) -> None:
            nonlocal missed
            for index in range(times):
                exchange = crowd.asks(who, index)
                try:
                    told = await bus.run(exchange)
                except NoReply as silence:
                    crowd.silent.append(silence)
                    told = {}
                crowd.note(told)
                missed += answers(exchange) - len(told)

        async with bus:
            for node in NODES:
                crowd.note(await bus.run(kept(node)))
            for who in range(CROWD):  # one after the other, as one task alone: that goes straight
                await member(who)
            await asyncio.gather(*(member(who) for who in range(CROWD)))

    with at_the_end_of(True, device) as link:
        bus = AsyncBus(link, FAMILY, admit=admit_all)
        bus.turns.echo.excluded()
        asyncio.run(main(bus))
        bus.turns.made_good()
        due = 2 * crowd.due(times) + len(NODES)
        crowd.silent.clear()
        retries = crowd.judge(device, bus, due - missed)
    figures(
        f"L16 a crowd of {CROWD} tasks on the straight way on a pseudo-terminal",
        family="feetech", answers=due, straight=len(landings.ids), retries=retries, missed=missed,
    )  # fmt: skip
    assert len(landings.ids) > times * CROWD // 2
    assert missed < 0.1 * due
