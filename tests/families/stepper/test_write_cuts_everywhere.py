"""Writing a project while the supply goes or the host dies, at every byte; and again while that is mended.

Whatever was cut, the other projects are as they were and the one that was written is old or new, or the host was told
what it holds; the next write ends with what was meant. `make test` takes some of the cuts, `make soak` every one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import islice
from math import ceil, inf
from typing import Any, NamedTuple

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.operation import Data
from motorbus.errors import LinkLost, MotorbusError, OutcomeUnknown, VerificationFailed
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.driver.writing import Proof, Written
from motorbus.families.stepper.simulator import simulate
from motorbus.families.stepper.table import Project, decode_image
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.conftest import Figures
from tests.families.stepper.test_power_cuts import KINDS, MEANT, OTHER
from tests.families.stepper.written import LONGER, PICK, Supply, program, stored
from tests.faults.off import are_off

BYTE = 10 / 9600
"""s for one byte."""
REQUEST = 11 * BYTE
WHO = ("host", "supply")
SAMPLE = [
    kind
    for kind in KINDS
    if (kind["select"] == "load")
    == (kind["selected_at_boot"] == (1 if kind["read_view"] == "working" else 2))
    and (kind["selected_at_boot"], kind["save_cut"]) in ((1, "empty"), (2, "old"))
]
"""One of each way in which edits are kept, and of each two values together but two; the long runs have all of them."""

Rounds = Callable[[int], int]


class Cut(NamedTuple):
    """Who goes, so many seconds after the write has begun."""

    who: str
    after: float


class Watched(MemoryLink):
    """Notes when something was sent."""

    def __init__(self, *given: Any, **options: Any) -> None:
        self.sent_at: list[float] = []
        super().__init__(*given, **options)

    def write(self, data: Data) -> None:
        self.sent_at.append(self.now())
        super().write(data)


class World:
    """A controller that outlives its hosts. `length` is how long the last of them took (s), `sent` when it spoke.

    `before` is what it had stored when the last of them began, `told` whether it holds neither old nor new in the end,
    which its host was told, or an earlier one. `struck` says that the last cut has come, `lost` that it has
    ended as it must not.
    """

    def __init__(self, kind: dict[str, Any]) -> None:
        self.simulator = simulate((1,), turnaround=0.002, **kind)
        self.simulated = self.simulator.nodes[1]
        self.simulated.put(1, OTHER)
        self.simulated.put(2, LONGER)
        self.before = LONGER
        self.told = self.struck = self.lost = False
        self.now = 0.0
        self.length = 0.0
        self.sent: list[float] = []

    def write(self, cut: Cut | None = None) -> Written | MotorbusError:
        """A host that writes the project and is cut, or its controller is."""
        self.before = decode_image(self.simulated.store.stored[2])
        link = Watched(self.simulator, rate=9600, pace=True, start=self.now)
        bus = Bus(link, FAMILY.configured(motor=3), admit=Gate(), report=lambda event: None)
        if cut is not None and cut.who == "host":
            link.unplug(self.now + cut.after)
        elif cut is not None:
            link.simulator = Supply(self.simulator, self.now + cut.after)
        try:
            return Controller(bus).write_project(program(PICK))
        except MotorbusError as error:
            self.struck = isinstance(error, LinkLost)
            return error
        finally:
            if isinstance(link.simulator, Supply):
                self.struck = link.simulator.at == inf and not are_off()
            self.length = link.now() - self.now
            self.sent = [at - self.now for at in link.sent_at]
            bus.close()
            self.now = link.now() + 2.0
            self.simulator.advance(self.now)

    @property
    def state(self) -> object:
        """All that a controller remembers."""
        store = self.simulated.store
        return tuple(store.stored.values()), store.working, store.selected, tuple(store.flags.values())

    def faults(self, told: Written | MotorbusError) -> list[str]:
        """What must not be. Looking takes its supply away, so this is the last that is asked of a world."""
        before = self.before
        held, found = stored(self.simulated, 2), []
        if stored(self.simulated, 1) != OTHER:
            found.append("another project has changed")
        if isinstance(told, Written):
            true = held == MEANT if told.saved else told.proof is Proof.UNCHANGED and held in (LONGER, MEANT)
            return found if true else [*found, "success, and it is not so"]
        said = isinstance(told, VerificationFailed | OutcomeUnknown)
        self.told = held not in (LONGER, MEANT)
        if (
            held not in (LONGER, MEANT, Project(), before) and not said
        ):  # a save that is cut may leave an empty slot
            found.append(f"it holds something else, and what was said is {told!r}")
        return found

    def mended(self) -> list[str]:
        """The next host writes, and once more after a power cycle where it cannot know what is stored."""
        told = self.write()
        if isinstance(told, Written) and told.proof is Proof.UNCHANGED:
            if stored(self.simulated, 2) == MEANT:
                return []
            told = self.write()
        return self.faults(told) if isinstance(told, Written) else [f"it ended with {told}"]


def every_byte(kind: dict[str, Any]) -> Iterator[Cut]:
    """In the middle of each byte time of a whole write, and a little longer."""
    whole = World(kind)
    whole.write()
    for who in WHO:
        for number in range(ceil(whole.length / BYTE) + 3):
            yield Cut(who, (number + 0.5) * BYTE)


def every_exchange(world: World) -> Iterator[Cut]:
    """While each request is under way, and when it has just been carried out."""
    world.write()
    for at in world.sent:
        for after in (0.5 * REQUEST, REQUEST + 0.5 * BYTE):
            yield from (Cut(who, at + after) for who in WHO)


def is_thorough(rounds: Rounds) -> bool:
    return rounds(1_000_000) == 1_000_000


def cuts(found: Iterator[Cut], rounds: Rounds, usual: int, first: int) -> Iterator[Cut]:
    """Every one of them in a long run, else every so manyth."""
    return found if is_thorough(rounds) else islice(found, first % usual, None, usual)


def judged(world: Callable[[], World], cut: Cut, recovered: set[object]) -> World:
    """Cut it so, and look; and write again, unless one that remembered just the same has been written to already."""
    one = world()
    told, state = one.write(cut), one.state
    wrong = one.faults(told)
    one.lost = bool(wrong)
    assert wrong == [], cut
    if state not in recovered:
        recovered.add(state)
        other = world()
        other.write(cut)
        assert other.state == state, "the same cut leaves the same behind"
        assert other.mended() == [], cut
    return one


def named(kind: dict[str, Any]) -> str:
    """This kind in words, for a name."""
    return " ".join(f"{name}={value}" for name, value in kind.items())


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", KINDS, ids=named)
def test_d10_a_write_cut_at_every_byte(kind: dict[str, Any], rounds: Rounds, figures: Figures) -> None:
    recovered: set[object] = set()
    whole = World(kind)
    whole.write()
    ends: list[bool] = []
    struck, lost = Counter[str](), 0
    for cut in cuts(every_byte(kind), rounds, 419, 37 * KINDS.index(kind)):
        end = judged(lambda: World(kind), cut, recovered)
        assert end.struck == (cut.after < whole.length), cut
        struck[cut.who] += end.struck
        ends.append(end.told)
        lost += end.lost
    assert min(struck[who] for who in WHO) > 0
    assert len(recovered) > 1, "cuts leave it in different states"
    what = f"D10 project write cut at every byte, {named(kind)}"
    states = len(recovered)
    figures(
        what,
        family="stepper",
        promise=4,
        states=states,
        cuts=len(ends),
        neither_but_told=sum(ends),
        lost=lost,
    )


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(
    "kind",
    [kind if kind in SAMPLE else pytest.param(kind, marks=pytest.mark.soak) for kind in KINDS],
    ids=named,
)
def test_d10_a_write_cut_and_cut_again_while_it_is_mended(
    kind: dict[str, Any], rounds: Rounds, figures: Figures
) -> None:
    """From each state that a first cut can leave, every exchange of the next write, and one more write after that."""
    seen: set[object] = set()
    recovered: set[object] = set()
    ends: list[bool] = []
    struck, lost = Counter[str](), 0
    for cut in cuts(every_byte(kind), rounds, 419, 37 * KINDS.index(kind)):

        def wreck(cut: Cut = cut) -> World:
            world = World(kind)
            world.write(cut)
            return world

        state = wreck().state
        if state in seen:
            continue
        seen.add(state)
        for second in cuts(every_exchange(wreck()), rounds, 31, len(seen)):
            end = judged(wreck, second, recovered)
            struck[second.who] += end.struck
            ends.append(end.told)
        lost += end.lost
    assert min(struck[who] for who in WHO) > 0.3 * len(ends), "most cuts of either kind have come"
    assert len(seen) > 1, "cuts leave it in different states"
    what = f"D10 project write cut and cut again while it is mended, {named(kind)}"
    states = len(seen)
    figures(
        what,
        family="stepper",
        promise=4,
        states=states,
        cuts=len(ends),
        neither_but_told=sum(ends),
        lost=lost,
    )
