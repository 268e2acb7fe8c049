"""Row L16: 64 threads, or 64 tasks, on one bus, whose interpreter changes threads as often as it can.

The device counts: every question it is asked has an answer of its own, so an answer that is lost, that comes twice or
to somebody else is known by its number. What it hears is judged byte by byte: one whole request after the other.
"""

from __future__ import annotations

import asyncio
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from motorbus.bus.aio import AsyncBus
from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.core.operation import Answer, Data, Due, Exchange, Operation
from motorbus.errors import NoReply
from motorbus.families.feetech import FAMILY, wire
from motorbus.families.kst import Servo
from motorbus.link.base import Link
from motorbus.link.memory import MemoryLink
from motorbus.link.pty import PtyMaster
from motorbus.link.serial import SerialLink
from motorbus.simulation.mount import Mount
from tests.bus.responder import Responder
from tests.bus.script import admit_all
from tests.conftest import Figures, Rounds
from tests.support.mounts import served
from tests.support.rigs import kst as kst_rig

CROWD = 64
NODES = range(1, 21)


class Counting(Responder):
    """Servos that answer a number: how often each has been asked. `garbled` counts what was no whole request."""

    def __init__(self) -> None:
        super().__init__(NODES)
        self.asked: Counter[int] = Counter()
        self.garbled = self.pieces = 0
        self._judge = wire.Splitter("instruction")

    def receive(self, data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        self.pieces += 1
        self.garbled += sum(not isinstance(one, wire.InstructionPacket) for one in self._judge.feed(data))
        super().receive(data, at)

    def _read(self, node: int, address: int, count: int) -> bytes:
        if address != 56:
            return super()._read(node, address, count)
        self.asked[node] += 1
        return self.asked[node].to_bytes(8, "little")[:count]


def number(node: int) -> Exchange[int]:
    """How often this servo has been asked by now."""

    def read(answer: Answer) -> int:
        return int.from_bytes(answer.replies[0].data[5:9], "little")

    return Exchange(wire.read(node, 56, 4), (Due(node, node, 10),), read, repeatable=True)


def longer(node: int) -> Operation[int]:
    """The same as an operation of several steps."""
    return (yield from number(node))


class Crowd:
    """What everybody was told, by node; `silent` counts who was told that nothing came, as a busy computer may."""

    def __init__(self) -> None:
        self.told: dict[int, Counter[int]] = {node: Counter() for node in NODES}
        self.silent: list[NoReply] = []
        self.failed: list[BaseException] = []

    @property
    def returned(self) -> int:
        """How many answers reached somebody."""
        return sum(told.total() for told in self.told.values())

    @property
    def doubled(self) -> int:
        """How many of them had reached somebody before."""
        return sum(count - 1 for told in self.told.values() for count in told.values())

    def question(self, who: int, index: int) -> tuple[int, Exchange[int] | Operation[int]]:
        """The node and the question that is this member's next."""
        node = 1 + (who + index) % len(NODES)
        return node, number(node) if index % 2 else longer(node)

    def judge(self, device: Counting, bus: BusFace, total: int) -> int:
        """Every answer reached one who asked, in one piece, and the ledger balances; how many had to be asked again."""
        assert self.failed == []
        assert device.garbled == 0
        ledgers = bus.statistics.nodes.values()
        strange = [(node, n) for node, told in self.told.items() for n in told if n > device.asked[node]]
        doubled, returned = self.doubled, self.returned
        assert (doubled, strange, returned + len(self.silent)) == (0, [], total)
        failed = sum(sum(ledger.errors.values()) for ledger in ledgers)
        assert device.asked.total() - returned <= failed, "no answer was lost but where it is said"
        for ledger in ledgers:
            assert ledger.sent == ledger.ok + sum(ledger.errors.values())
        assert sum(ledger.sent for ledger in ledgers) >= total
        return sum(ledger.retries for ledger in ledgers)


@pytest.fixture
def restless() -> Iterator[None]:
    """Threads are changed as often as the interpreter can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def threads(crowd: Crowd, bus: Bus, times: int) -> None:
    """64 threads, so many questions each."""

    def member(who: int) -> None:
        try:
            for index in range(times):
                node, question = crowd.question(who, index)
                try:
                    crowd.told[node][bus.run(question)] += 1
                except NoReply as silence:
                    crowd.silent.append(silence)
        except BaseException as error:
            crowd.failed.append(error)

    everyone = [threading.Thread(target=member, args=(who,)) for who in range(CROWD)]
    for thread in everyone:
        thread.start()
    for thread in everyone:
        thread.join()


def tasks(crowd: Crowd, bus: AsyncBus, times: int) -> None:
    """64 tasks, so many questions each."""

    async def member(who: int) -> None:
        for index in range(times):
            node, question = crowd.question(who, index)
            try:
                crowd.told[node][await bus.run(question)] += 1
            except NoReply as silence:
                crowd.silent.append(silence)

    async def main() -> None:
        async with bus:
            await asyncio.gather(*(member(who) for who in range(CROWD)))

    asyncio.run(main())


@contextmanager
def at_the_end_of(port: bool, device: Counting) -> Iterator[Link]:
    """A link to it in virtual time, or by a pseudo-terminal that a thread serves."""
    if not port:
        yield MemoryLink(device)
        return
    master = PtyMaster()
    try:
        with served(Mount(device, master)):
            link = SerialLink(master.slave_name, rate=1_000_000)
            try:
                yield link
            finally:
                link.close()
    finally:
        master.close()


@pytest.mark.timeout(3600)
@pytest.mark.usefixtures("restless")
@pytest.mark.parametrize("port", [False, True], ids=["virtual", "pseudo-terminal"])
@pytest.mark.parametrize("kind", ["threads", "tasks"])
def test_l16_a_crowd_on_one_bus(kind: str, port: bool, rounds: Rounds, figures: Figures) -> None:
    full, usual = (25_600, 320) if port else (200_000 if kind == "threads" else 800_000, 3_200)
    times = rounds(full, usual) // CROWD
    device, crowd = Counting(), Crowd()
    with at_the_end_of(port, device) as link:
        if kind == "threads":
            blocking = Bus(link, FAMILY, admit=admit_all)
            threads(crowd, blocking, times)
            retries = crowd.judge(device, blocking, times * CROWD)
            blocking.close()
        else:
            awaiting = AsyncBus(link, FAMILY, admit=admit_all)
            tasks(crowd, awaiting, times)
            retries = crowd.judge(device, awaiting, times * CROWD)
    assert port or (retries, crowd.silent) == (0, [])
    where = "a pseudo-terminal" if port else "virtual time"
    figures(
        f"L16 a crowd of {CROWD} {kind} on {where}",
        family="feetech",
        transactions=times * CROWD,
        interleaved=device.garbled,
        lost=times * CROWD - crowd.returned - len(crowd.silent),
        doubled=crowd.doubled,
        retries=retries,
        said_to_be_silent=len(crowd.silent),
    )


@pytest.mark.timeout(3600)
@pytest.mark.usefixtures("restless")
def test_l16_a_crowd_where_several_fly_at_once(rounds: Rounds, figures: Figures) -> None:
    """On CAN every node has a lane of its own: each value is where the servo was during that very call."""
    times = max(1, rounds(128_000, 1_280) // CROWD)
    rig = kst_rig.Rig(tuple(range(1, 9)))
    wrong: list[object] = []

    def member(who: int) -> None:
        node = 1 + who % 8
        servo = Servo(rig.bus, node)
        for _ in range(times):
            before = rig.servos.heard
            place = round(servo.position() * 572.957795) + 900
            after = rig.servos.heard
            if not any(asked % kst_rig.PLACES == place for asked in range(before, after + 1)):
                wrong.append((node, place, before, after))

    everyone = [threading.Thread(target=member, args=(who,)) for who in range(CROWD)]
    for thread in everyone:
        thread.start()
    for thread in everyone:
        thread.join()
    assert wrong == []
    ledgers = rig.bus.statistics.nodes.values()
    assert all(ledger.sent == ledger.ok + sum(ledger.errors.values()) for ledger in ledgers)
    assert sum(ledger.ok for ledger in ledgers) >= times * CROWD
    figures(f"L16 a crowd of {CROWD} threads", family="kst", transactions=times * CROWD, wrong=len(wrong))
