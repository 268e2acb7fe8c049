"""Crashes and power cuts on order: a host that dies at any byte or record, a servo that loses its supply at any moment.

What is under test runs on a bus of its own; what is cut is said beforehand as a `Cut`. A host that is dead neither
sends nor records anything; the next one is another bus on the same devices, with the journal that is left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from motorbus.core.request import Data
from motorbus.core.steps import Exclusive, JournalEntry
from motorbus.errors import LinkLost, MotorbusError
from motorbus.families.feetech import FAMILY
from motorbus.families.feetech.driver import Node, prepare, recover
from motorbus.families.feetech.driver.changing import changed
from motorbus.families.feetech.driver.jobs import SET_BAUD, SET_ID, Course, Job, Place
from motorbus.families.feetech.simulator import FeetechBus, Servo, simulate
from motorbus.journal import BusJournal
from motorbus.link.memory import MemoryLink
from tests.support.world import Bus, make_bus

OLD, NEW, STRANGER = 3, 7, 9
"""Ids: of the servo that changes, what it shall become, and of another one that nobody may touch."""


class Cut(NamedTuple):
    """Where it is cut: before so many bytes have left, at a moment (s), or around a journal record; and who is hit.

    `record` counts from 0; with `kept` the record is on disk and nothing after it happens.
    """

    byte: int | None = None
    moment: float | None = None
    record: int | None = None
    kept: bool = False
    host: bool = True
    supply: bool = False


NEVER = Cut(host=False)


class Doomed(MemoryLink):
    """A link whose host dies as the cut says; `sent` are the sizes of all that left, `commits` the moments of all that
    was stored, for enumerating; `struck` is whether it has happened."""

    def __init__(self, world: World, cut: Cut, rate: int) -> None:
        self.world = world
        self.cut = cut
        self.dead = self.struck = False
        self.sent: list[int] = []
        self.left = 0
        self.commits: set[float] = set()
        super().__init__(world.devices, rate=rate, start=world.now)

    def write(self, data: Data) -> None:
        assert isinstance(data, bytes)
        self._alive()
        self.sent.append(len(data))
        if self.cut.byte is not None and self.left <= self.cut.byte < self.left + len(data):
            gone = self.cut.byte - self.left
            self.left += len(data)
            self._pass(data[:gone])
            self.strike()
            self._alive()
            self._pass(data[gone:])
        else:
            self.left += len(data)
            super().write(data)

    def _pass(self, data: bytes) -> None:
        """Half of a packet reaches the devices before anything else happens."""
        if data:
            super().write(data)
            self.advance(0.0)

    def _process(self, moment: float) -> None:
        super()._process(moment)
        self.commits.update(commit.moment for commit in self.world.servo.memory.commits)

    def read(self, until: float) -> list[Data]:
        self._alive()
        moment = self.cut.moment
        if moment is not None and self.now() < moment <= until:
            found = super().read(moment)
            if found and self.now() < moment:
                return found
            self.strike()
            self.cut = NEVER
            self._alive()
            return found
        return super().read(until)

    def strike(self) -> None:
        """Now it happens."""
        self.struck = True
        self.dead = self.cut.host
        if self.cut.supply:
            self.world.servo.power_cycle()

    def _alive(self) -> None:
        if self.dead:
            raise LinkLost("this host is dead")


@dataclass
class World:
    """Devices that outlive their hosts, and the journal on the disk.

    Among the options: `ids`, the old one and the new one, and `volatile`, a setting that was written while the lock was
    closed, so that the next power-off loses it; the others are the simulator's.
    """

    verb: str
    options: dict[str, Any]
    journal: BusJournal = field(default_factory=lambda: BusJournal("feetech:sim"))
    devices: FeetechBus = field(init=False)
    servo: Servo = field(init=False)
    now: float = 0.0
    notes: list[str] = field(default_factory=list)
    link: Doomed = field(init=False)

    def __post_init__(self) -> None:
        options = dict(self.options)
        self.ids: tuple[int, int] = options.pop("ids", (OLD, NEW))
        volatile = options.pop("volatile", False)
        self.devices = simulate((self.ids[0], STRANGER), options.pop("model", ""), **options)
        self.servo = self.devices.servos[0]
        if volatile:
            self.servo.memory["max_temperature"] = 60
        self.rate = self.servo.baud_rate or 0
        self.other_rate = 500_000 if self.rate != 500_000 else 250_000

    @property
    def old(self) -> Place:
        return Place(self.ids[0], self.rate)

    @property
    def new(self) -> Place:
        return Place(self.ids[1], self.rate) if self.verb == SET_ID else Place(self.ids[0], self.other_rate)

    @property
    def place(self) -> Place:
        """Where the servo is."""
        return Place(self.servo.id, self.servo.baud_rate or 0)

    @property
    def state(self) -> object:
        """All that what comes next depends on: the servo's memory, and how far the journal has come."""
        memory, change = self.servo.memory, self.journal.unfinished()
        reached = tuple(change.facts["reached"]) if change is not None else ()
        return bytes(memory.live), bytes(memory.stored), tuple(memory.commits), reached

    def run(self, operation: Callable[[Bus], Any], cut: Cut = NEVER) -> Any:
        """A host does this until it is cut; its value, or the error it ended with."""
        self.link = link = Doomed(self, cut, self.rate)
        records = iter(range(1_000_000))

        def record(event: object) -> None:
            link._alive()
            if isinstance(event, JournalEntry) and event.state != "asked" and next(records) == cut.record:
                if cut.kept:
                    self.journal(event)
                link.strike()
                link._alive()
            self.journal(event)

        bus = make_bus(link, FAMILY.open(), journal=record)
        try:
            return operation(bus)
        except MotorbusError as error:
            return error
        finally:
            self.now = link.now() + 1.0  # until the next host is there
            self.devices.advance(self.now)

    def change(self, bus: Bus) -> None:
        """The guarded part of `set_id` or `set_baud`; what it looks at before changes nothing."""
        node = Node(self.ids[0])
        cut, self.link.cut = self.link.cut, NEVER
        bus.run(prepare(node))
        self.link.cut, self.link.left, self.link.sent = cut, 0, []
        bus.run(Exclusive(changed(self.job(), node, Course(self.job()))))

    def job(self) -> Job:
        return Job(self.verb, self.old, self.new, bytes(self.servo.memory.live[:40]), (STRANGER,))

    def recovery(self, bus: Bus, *, alone: bool = False) -> str | None:
        """What the next host does: end what the journal calls unfinished."""
        change = self.journal.unfinished()
        if change is None:
            return None
        return bus.run(recover(Node(change.node), change.verb, change.facts, alone=alone))

    def faults(self, outcome: object) -> list[str]:
        """What is not as it must be in the end, a power cycle included; `outcome` is what the recovery has said."""
        place, found = self.place, []
        if place not in (self.old, self.new):
            found.append(f"it is at {place}")
        if not self.servo.locked:
            found.append("its lock is open")
        if self.journal.unfinished() is not None:
            found.append("the journal is open")
        found += self._astray()
        self.devices.advance(self.now)
        self.servo.power_cycle()
        found += self._astray()
        if self.place != place:
            found.append(f"after a power cycle it is at {self.place}, not at {place}")
        if outcome is not None and {"old": self.old, "new": self.new}.get(str(outcome)) != place:
            found.append(f"the outcome was said to be {outcome}")
        if len({servo.id for servo in self.devices.servos}) < len(self.devices.servos):
            found.append("two servos have one id")
        return found

    def _astray(self) -> list[str]:
        """The second id of an HLS servo has not come along: it would obey whoever is told something there."""
        second = self.servo.second_id
        return [] if second in (None, self.servo.id) else [f"its second id is {second}"]


def cuts(world: Callable[[], World], work: Callable[[World], Callable[[Bus], Any]]) -> Iterator[Cut]:
    """Every cut of this work: at each byte it sends, around each record, and at each step of each commit."""
    whole = world()
    whole.run(work(whole))
    yield from _every(whole, whole.link.commits)


def _every(whole: World, commits: set[float]) -> Iterator[Cut]:
    for byte in range(sum(whole.link.sent)):
        for host, supply in ((True, False), (True, True), (False, True)):
            yield Cut(byte=byte, host=host, supply=supply)
    time = whole.servo.switches.store_time
    for moment in sorted(commits):
        for part in (-0.99, -0.5, -0.01, 0.01):
            for host in (True, False):
                yield Cut(moment=moment + part * time, host=host, supply=True)
    for record in range(10):
        for kept in (False, True):
            for supply in (False, True):
                yield Cut(record=record, kept=kept, supply=supply)


VERBS = (SET_ID, SET_BAUD)
