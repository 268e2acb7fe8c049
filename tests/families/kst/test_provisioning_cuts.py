"""Provisioning a KST servo under power cuts and crashes, at every frame and in the save, and again while it is mended.

Nothing is remembered on the host: the next one asks where things stand. Whatever was cut, the servo has its old id and
rate or the new ones in every combination that was written, it answers there, nobody else has its id, and the next
provisioning ends with what was wanted. `make test` takes some of the cuts, `make soak` every one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple

import pytest

from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.errors import LinkLost, MotorbusError
from motorbus.families.kst import FAMILY, PowerCycleNeeded, Provisioned, Servo
from motorbus.families.kst.simulator import KstBus
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.conftest import Figures

OLD, NEW, STRANGER = 5, 9, 20
RATE = 500_000
FLASH = 0.05
"""s that the flash takes here; a save holds its lane longer than that."""
WAYS: tuple[dict[str, int], ...] = (
    {"new_id": NEW},
    {"new_rate": 250_000},
    {"new_id": NEW, "new_rate": 1_000_000},
)
KINDS: tuple[dict[str, Any], ...] = tuple(
    {"flash_cut": flash, "pending_id": pending}
    for flash in ("old", "new")
    for pending in ("pending", "active")
)
HOSTS = ("host", "supply", "both")


class Cut(NamedTuple):
    """Before (or behind) this frame, or so long (s) after the save has left, the host goes, the supply, or both."""

    who: str
    frame: int | None = None
    sent: bool = False
    later: float | None = None


class Doomed(MemoryLink):
    """A link that is struck as the cut says; `count` are the frames that have left."""

    def __init__(self, world: World, cut: Cut | None) -> None:
        self.world, self.cut, self.count, self.dead = world, cut, 0, False
        self.strikes_at: float | None = None
        self.fired = False
        super().__init__(world.simulator, rate=RATE, start=world.now)

    def write(self, data: Data) -> None:
        self._alive()
        cut, self.count = self.cut, self.count + 1
        here = cut is not None and cut.frame == self.count - 1
        if here and not cut.sent:  # type: ignore[union-attr]
            self.strike()
        super().write(data)
        if here and cut.sent:  # type: ignore[union-attr]
            self._process_until(self.now())
            self.strike()
        if cut is not None and cut.later is not None and "#22101001" in str(data):
            self.strikes_at = self.now() + cut.later

    def read(self, until: float) -> list[Data]:
        self._alive()
        moment = self.strikes_at
        if moment is not None and self.now() < moment <= until:
            found = super().read(moment)
            if not found or self.now() >= moment:
                self.strikes_at = None
                self.strike()
            return found
        return super().read(until)

    def strike(self) -> None:
        """Now it happens."""
        assert self.cut is not None
        self.fired = True
        self.dead = self.cut.who != "supply"
        if self.cut.who != "host":
            self.world.servo.power_cycle()
        self._alive()

    def _alive(self) -> None:
        if self.dead:
            raise LinkLost("this host is dead")


class World:
    """Servos that outlive their hosts."""

    def __init__(self, wanted: dict[str, int], options: dict[str, Any]) -> None:
        self.wanted = wanted
        ids = (OLD, STRANGER) if "new_rate" not in wanted else (OLD,)
        simulator = FAMILY.simulator(ids, flash_time=FLASH, **options)
        assert isinstance(simulator, KstBus)
        self.simulator = simulator
        self.servo = simulator.servos[0]
        self.now = 0.0
        self.link = Doomed(self, None)
        self.node, self.rate = wanted.get("new_id", OLD), wanted.get("new_rate", RATE)

    def host(self, cut: Cut | None = None) -> Provisioned | MotorbusError:
        """A host that provisions, with somebody beside it who takes the supply away when he is asked to."""
        link = self.link = Doomed(self, cut)
        family = FAMILY.open()
        bus = Bus(link, family, interlock=Gate(), report=self._asked)
        try:
            return Servo(bus, OLD).provision(**self.wanted, timeout=5.0)
        except MotorbusError as error:
            return error
        finally:
            bus.close()
            self.now = link.now() + 1.0
            self.simulator.advance(self.now)

    def _asked(self, event: object) -> None:
        if isinstance(event, PowerCycleNeeded):
            self.servo.power_cycle()

    @property
    def state(self) -> object:
        """Where the servo is, what it would be after a restart, and what it reads back."""
        now = self.now
        stored = self.servo.flash.stored(now)
        kept = stored["node_id"], stored["bit_rate_code"]
        live = self.servo.values["node_id"], self.servo.values["bit_rate_code"]
        return self.servo.node, self.servo.bit_rate, kept, live

    def faults(self) -> list[str]:
        """What must not be, whatever was cut: it is old or new, answers there, and nobody else does."""
        places = {OLD, self.node}, {RATE, self.rate}
        found = []
        if self.servo.node not in places[0] or self.servo.bit_rate not in places[1]:
            found.append(f"it is {self.servo.node} at {self.servo.bit_rate}")
        if sorted(servo.node for servo in self.simulator.servos[1:]) != [STRANGER] * (
            len(self.simulator.servos) - 1
        ):
            found.append("another servo has changed")
        return found

    def mended(self) -> list[str]:
        """The next host provisions; what is wrong then, and after one more power cycle."""
        told = self.host()
        wrong = [] if isinstance(told, Provisioned) else [f"it ended with {told}"]
        for _ in range(2):
            if (self.servo.node, self.servo.bit_rate) != (self.node, self.rate):
                wrong.append(f"it is {self.servo.node} at {self.servo.bit_rate}")
            self.servo.power_cycle()
        return [*wrong, *self.faults()]


def cuts(world: Callable[[], World]) -> Iterator[Cut]:
    """Everything that can be cut of what a host does in this world."""
    whole = world()
    whole.host()
    for who in HOSTS:
        for frame in range(whole.link.count):
            yield from (Cut(who, frame, sent) for sent in (False, True))
        yield from (Cut(who, later=FLASH * part) for part in (0.01, 0.25, 0.5, 0.75, 0.99, 1.01))


def is_thorough(rounds: Callable[[int], int]) -> bool:
    return rounds(1_000_000) == 1_000_000


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("wanted", WAYS, ids=str)
def test_d10_provisioning_cut_anywhere_ends_old_or_new(
    wanted: dict[str, int], rounds: Callable[[int], int], figures: Figures
) -> None:
    counted = fired = lost = 0
    states = set()
    for number, options in enumerate(KINDS):
        found = list(cuts(lambda options=options: World(wanted, options)))  # type: ignore[misc]
        for cut in found if is_thorough(rounds) else islice(found, number, None, 11):
            world = World(wanted, options)
            told = world.host(cut)
            fired += world.link.fired
            counted += 1
            states.add(world.state)
            assert not (isinstance(told, Provisioned) and world.link.dead)
            wrong = world.faults() or world.mended()
            lost += bool(wrong)
            assert wrong == [], f"{options} {cut}"
    assert fired == counted
    assert len(states) > 3, "the cuts strike in different states"
    what = f"D10 D11 provisioning cut once, {' and '.join(wanted)}"
    figures(what, family="kst", cuts=counted, states=len(states), lost=lost)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("wanted", WAYS, ids=str)
def test_d10_provisioning_cut_while_it_is_mended_too(
    wanted: dict[str, int], rounds: Callable[[int], int], figures: Figures
) -> None:
    """From every state that a first cut can leave, each cut of the next provisioning, and one more after that."""
    counted, lost, thorough = 0, 0, is_thorough(rounds)
    seen: set[object] = set()
    for options in KINDS if thorough else KINDS[:1]:
        for first in cuts(lambda options=options: World(wanted, options)):  # type: ignore[misc]

            def wreck(first: Cut = first, options: dict[str, Any] = options) -> World:
                world = World(wanted, options)
                world.host(first)
                return world

            state = str(options), wreck().state
            if state in seen:
                continue
            seen.add(state)
            for second in cuts(wreck) if thorough else islice(cuts(wreck), len(seen), None, 23):
                world = wreck()
                world.host(second)
                counted += world.link.fired
                wrong = world.faults() or world.mended()
                lost += bool(wrong)
                assert wrong == [], f"{options} {first} {second}"
    assert counted > 10
    what = f"D10 D11 provisioning cut and again while it is mended, {' and '.join(wanted)}"
    figures(what, family="kst", cuts=counted, states=len(seen), lost=lost)
