"""Commands that are cut off at any moment, and what the next host finds.

A `Command` is a row of the catalogue (`tests/support/catalogue/cuts.py`). A `World` is a simulated bus with the journal
of its port; hosts use it one after the other. A `Cut` happens before a frame leaves, after it has arrived, at its
reply, or in the middle of a store. States are read from the memory of the simulator, never from the driver.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from math import inf
from random import Random
from typing import Any, NamedTuple

from motorbus.core.family import Family
from motorbus.core.request import Data
from motorbus.errors import LinkError, MotorbusError
from motorbus.journal import BusJournal
from motorbus.link.memory import MemoryLink
from tests.support.subjects import tables_of
from tests.support.world import make_async_bus, make_bus

PAUSE = 20.0
"""s between two hosts; a motor that was left moving comes to rest."""
SPARSE = 200
"""Before the device changes for the first time only every so-many-th cut is made: nothing can be left half done."""
ROUNDS, SECONDS = 4, 5
"""How often a first cut is chosen at most, and second cuts for each choice."""


class Kind(Enum):
    """What a cut does."""

    POWER = "the device loses its supply for a moment"
    DEATH = "the process of the host is killed"
    BLACKOUT = "host and device lose their supply"
    INTERRUPT = "KeyboardInterrupt in the host"
    CANCEL = "the asyncio task is cancelled"
    UNPLUG = "the link is lost"


class Moment(Enum):
    """When a cut happens."""

    BEFORE = "before a frame leaves"
    AFTER = "after it has arrived"
    REPLY = "when its reply was taken from the link"
    STORE = "in the middle of a store"


KINDS: Mapping[Moment, tuple[Kind, ...]] = {
    Moment.BEFORE: (Kind.POWER, Kind.DEATH, Kind.BLACKOUT, Kind.INTERRUPT, Kind.UNPLUG),
    Moment.AFTER: tuple(Kind),
    Moment.REPLY: (Kind.INTERRUPT,),
    Moment.STORE: (Kind.POWER, Kind.BLACKOUT),
}
"""The kinds that make a difference at each moment."""


class Cut(NamedTuple):
    """This happens at that moment, counted from the begin of the command or from the previous cut."""

    kind: Kind
    number: int


class Call(NamedTuple):
    """A method of a device."""

    method: str
    arguments: tuple[Any, ...] = ()
    options: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Command:
    """One row of the catalogue.

    `subject`    the family, with a kind of simulated device
    `ids`        of the simulated devices; the first one executes the command
    `state`      what a device keeps: the command changes it, a power cycle must not
    `address`    id and bit rate at which a simulated device answers
    `contents`   all that a device holds, except times: a recovery is judged once for equal contents. None: each time
    `quirks`     options of the simulator
    `prepare`    prepares the simulated device, before the first host opens the bus
    `react`      what the user does with the device at an event of the command
    `restart`    after so many cuts the user restarts the device before the command is called again, for it may show
                 values that it does not keep; 0: never
    `then`       a call that must succeed after the recovery; None: the command once more
    `journalled` the next host calls `recover()` with the entry of the journal; else it calls the command again
    `guarded`    an interrupted command restores the device, its lock and the journal before it ends
    `atomic`     a loss of supply leaves the old state or the new one, and nothing else
    `cuts`       number of single cuts in `make test`, chosen at random; 0: all
    `pairs`      number of double cuts in `make test`
    """

    name: str
    subject: Family
    ids: tuple[int, ...]
    call: Call
    state: Callable[[Any], object]
    address: Callable[[Any], tuple[int, int]]
    contents: Callable[[Any], object] | None = None
    quirks: Mapping[str, Any] = field(default_factory=dict)
    prepare: Callable[[Any], None] = lambda device: None
    react: Callable[[Any, object], None] = lambda device, event: None
    restart: int = 0
    then: Call | None = None
    journalled: bool = False
    guarded: bool = True
    atomic: bool = False
    cuts: int = 0
    pairs: int = 0

    @cached_property
    def whole(self) -> World:
        """The world after the command without a cut."""
        world = World(self)
        world.watched = world.memory
        outcome = world.execute(self.call)
        assert not isinstance(outcome, BaseException), outcome
        return world

    @cached_property
    def judged(self) -> set[str]:
        """The contents from which a recovery was right."""
        return set()

    def single_cuts(self) -> list[Cut]:
        """Every cut; few of those before the device changes for the first time."""
        cuts = [
            Cut(kind, number) for number, moment in enumerate(self.whole.moments) for kind in KINDS[moment]
        ]
        early = [cut for cut in cuts if cut.number < self.whole.unchanged - 1]
        return early[::SPARSE] + cuts[len(early) :]

    def double_cuts(self, count: int) -> list[tuple[Cut, Cut]]:
        """So many pairs, chosen at random: the second cut is in the clean-up or in the recovery after the first."""
        random, pairs = Random(self.name), list[tuple[Cut, Cut]]()
        firsts = self.single_cuts() * ROUNDS
        random.shuffle(firsts)
        for first in firsts:
            if len(pairs) >= count:
                break
            second = random.choice(list(Kind))
            world = World(self, first, is_async=second is Kind.CANCEL)
            world.execute(self.call)
            world.recover()
            moments = range(len(world.moments))
            pairs += [
                (first, Cut(second, number)) for number in random.sample(moments, min(SECONDS, len(moments)))
            ]
        return pairs[:count]


class World:
    """A simulated bus and the journal of its port.

    `cuts`      are still to be made, `made` is the number of those that were
    `moments`   those since the last cut, `unchanged` of them before `memory` differed from `watched`
    """

    def __init__(self, command: Command, *cuts: Cut, is_async: bool = False) -> None:
        self.command = command
        self.cuts = list(cuts)
        self.is_async = is_async or any(cut.kind is Kind.CANCEL for cut in cuts)
        self.made = self.unchanged = 0
        self.moments: list[Moment] = []
        self.watched: object = None
        self.simulator = command.subject.simulator(command.ids, **command.quirks)
        self.device: Any
        self.device, *self.others = self.simulator.nodes.values()
        command.prepare(self.device)
        self.simulator.advance(0.0)
        self.now = 0.0
        self.address = command.address(self.device)
        self.before = self.state
        self.journal = BusJournal(f"{command.subject.name}:/dev/ttyUSB7")
        self.task: asyncio.Task[Any] | None = None

    @property
    def state(self) -> object:
        return self.command.state(self.device)

    @property
    def memory(self) -> object:
        """The state, and all that a host can write to the device."""
        rows = tables_of(self.command.subject)[0].values()
        return self.state, [self.device.memory[row.name] for row in rows if row.writable]

    @property
    def contents(self) -> str:
        """All that the next host depends on, except times; "" if the command does not say."""
        if self.command.contents is None:
            return ""
        change = self.journal.unfinished()
        devices = [self.command.contents(device) for device in self.simulator.nodes.values()]
        restarts = 0 < self.command.restart <= self.made
        return repr((restarts, change and (change.verb, change.facts), devices))

    # -- hosts ---------------------------------------------------------------------------------------------------

    def execute(self, call: Call, at: tuple[int, int] | None = None) -> Any:
        """Open the bus, call a method of the device at this id and rate; its value, or what it has raised."""
        node, rate = at or self.address
        self.link = link = CutLink(self, rate)
        self.task = None
        try:
            value = asyncio.run(self._call_async(node, call)) if self.is_async else self._call(node, call)
            return LinkError("the process was killed") if link.dead else value
        except (MotorbusError, KeyboardInterrupt, asyncio.CancelledError) as error:
            return error
        finally:
            self.now = link.now()
            self.pause()

    def _call(self, node: int, call: Call) -> Any:
        family = self.command.subject
        bus = make_bus(self.link, family.open(), report=self._react, journal=self._record)
        try:
            return getattr(family.devices.blocking(bus, node), call.method)(*call.arguments, **call.options)
        finally:
            bus.close()

    async def _call_async(self, node: int, call: Call) -> Any:
        family = self.command.subject
        bus = make_async_bus(self.link, family.open(), report=self._react, journal=self._record)
        self.task = asyncio.current_task()
        try:
            device = family.devices.awaiting(bus, node)
            return await getattr(device, call.method)(*call.arguments, **call.options)
        finally:
            await bus.close()

    def recover(self) -> Any:
        """What the next host does after a cut; gives its outcome, None where nothing is left to be done."""
        change = self.journal.unfinished()
        if change is not None:
            return self.execute(Call("recover", (change.verb, change.facts)))
        if self.command.journalled:
            return None
        if 0 < self.command.restart <= self.made:
            self.restart()
        return self.execute(self.command.call)

    def restart(self) -> None:
        """Take the supply of the device away, give it back, and wait."""
        self.device.power_cycle()
        self.pause()

    def pause(self) -> None:
        self.now += PAUSE
        self.simulator.advance(self.now)

    def _react(self, event: object) -> None:
        if not self.link.dead:
            self.command.react(self.device, event)

    def _record(self, event: object) -> None:
        if self.link.dead:
            raise LinkError("the process was killed")
        self.journal(event)

    # -- cuts ----------------------------------------------------------------------------------------------------

    def reach(self, moment: Moment) -> None:
        """Note this moment, and cut if it is that of the next cut."""
        if self.watched is not None and self.watched != self.memory:
            self.unchanged, self.watched = len(self.moments), None
        self.moments.append(moment)
        if self.cuts and self.cuts[0].number < len(self.moments):
            self.made += 1
            self.moments.clear()
            self._cut(self.cuts.pop(0).kind)

    def _cut(self, kind: Kind) -> None:
        if kind in (Kind.POWER, Kind.BLACKOUT):
            self.device.power_cycle()
        if kind in (Kind.DEATH, Kind.BLACKOUT):
            self.link.dead = True
        if kind in (Kind.DEATH, Kind.BLACKOUT, Kind.UNPLUG):
            self.link.lose()
        if kind is Kind.INTERRUPT and self.task is None:
            raise KeyboardInterrupt
        if kind in (Kind.INTERRUPT, Kind.CANCEL):  # asyncio cancels the main task at Ctrl-C
            assert self.task is not None
            self.task.cancel()


class CutLink(MemoryLink):
    """A link that tells its world each moment. `dead`: the process that uses it was killed."""

    def __init__(self, world: World, rate: int) -> None:
        super().__init__(world.simulator, rate=rate, start=world.now)
        self.world = world
        self.dead = False

    def write(self, data: Data) -> None:
        self.world.reach(Moment.BEFORE)
        super().write(data)
        self.advance(0.0)  # the frame arrives
        self.world.reach(Moment.AFTER)

    def read(self, until: float) -> list[Data]:
        midway = getattr(self.world.device, "midway", lambda: inf)()
        if self.now() < midway <= until:
            received = super().read(midway)
            if self.now() >= midway:
                self.world.reach(Moment.STORE)
        else:
            received = super().read(until)
        if received:
            self.world.reach(Moment.REPLY)
        return received

    def lose(self) -> None:
        """Unplug the adapter; what has arrived and was not read is lost."""
        super().read(self.now())
        self.unplug()


# -- judgement -------------------------------------------------------------------------------------------------------


def violations(command: Command, *cuts: Cut, then: bool = False) -> list[str]:
    """What is wrong after these cuts and the recovery; `then`: and after the call that must succeed afterwards."""
    old, new = command.whole.before, command.whole.state
    world, wrong = World(command, *cuts), list[str]()
    others = [command.state(device) for device in world.others]
    outcome = world.execute(command.call)

    def expect(condition: bool, what: str) -> None:
        if not condition:
            state = "old" if world.state == old else "new" if world.state == new else repr(world.state)
            wrong.append(f"{what}; state: {state}, outcome: {outcome!r}")

    expect(isinstance(outcome, BaseException) or world.state == new, "a success must be one")
    kind = cuts[0].kind if len(cuts) == 1 else None
    if kind in (Kind.INTERRUPT, Kind.CANCEL) or (kind is Kind.POWER and command.journalled):
        expect(world.link.rate == world.address[1], "the link must have its rate again")
        if command.guarded:
            expect(world.state in (old, new), "an interrupted command must leave the old or the new state")
            expect(world.journal.unfinished() is None, "an interrupted command must close its journal")
    if kind is Kind.BLACKOUT and command.atomic:
        expect(world.state in (old, new), "a loss of supply must leave the old or the new state")

    while True:
        is_cut = bool(world.cuts)
        contents = "" if is_cut else f"{world.contents}, then={then}"
        if contents in command.judged:
            return wrong
        outcome = world.recover()
        if not (is_cut and isinstance(outcome, BaseException)):
            break
    expect(not isinstance(outcome, BaseException), "the recovery must succeed")
    expect(not world.cuts, "each cut must be reached")
    expect(world.state == new or (command.journalled and world.state == old), "the state must be old or new")
    expect(
        {"old": old, "new": new}.get(str(outcome), world.state) == world.state,
        "the recovery must tell the truth",
    )
    expect(world.journal.unfinished() is None, "the journal must be closed")
    expect(world.execute(Call("ping"), command.address(world.device)) is True, "the device must answer")
    state = world.state
    world.restart()
    expect(world.state == state, "a power cycle must not change the state")
    if then and command.journalled:
        outcome = world.execute(command.then or command.call, command.address(world.device))
        expect(not isinstance(outcome, BaseException), "the next command must succeed")
        expect(world.state == new, "the next command must have its effect")
    expect(
        [command.state(device) for device in world.others] == others, "other devices must stay as they were"
    )
    if command.contents is not None and not wrong and not is_cut:
        command.judged.add(contents)
    return wrong
