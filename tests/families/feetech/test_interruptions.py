"""Ctrl-C in the middle of a change of id or rate: at every record, and at every line that takes part in it.

Wherever it falls, the servo ends under its old id or rate or under its new one, reachable and locked, the bus has its
own rate, and the journal is closed, or the interruption itself says that it is not.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.core.operation import ASKED, INTENT, Journal
from motorbus.families.feetech.driver import changing, jobs, placing, recovery
from motorbus.journal import BusJournal
from tests.conftest import Rounds
from tests.families.feetech.cuts import NEVER, VERBS, Cut, World

PACKAGE = Path(motorbus.__file__).parent
FILES = {
    *(str(module.__file__) for module in (changing, jobs, placing, recovery)),
    str(PACKAGE / "journal.py"),
    str(PACKAGE / "core" / "operation.py"),
}
MODELS = ("sts3215", "hls3925")
Kept = Callable[[], BusJournal]


class Interrupt:
    """Raises KeyboardInterrupt before the nth line of these files that is executed; `later` lines on, once more."""

    def __init__(self, at: int, later: int = 0) -> None:
        self.at = {at, at + later}
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code.co_filename not in FILES:
            return None
        if event == "line":
            self.count += 1
            if self.count in self.at:
                raise KeyboardInterrupt
        return self


def run_interrupted(world: World, work: Callable[[Any], Any], interrupt: Interrupt, cut: Cut = NEVER) -> bool:
    """True when there were so many lines; what was added to the interruption is in `world.notes`."""
    before = sys.gettrace()
    sys.settrace(interrupt)
    try:
        world.run(work, cut)
    except KeyboardInterrupt as error:
        world.notes = list(getattr(error, "__notes__", ()))
    finally:
        sys.settrace(before)
    return interrupt.count >= min(interrupt.at)


def faults(world: World) -> list[str]:
    """What is wrong afterwards: with a journal that is open and says so, after the next host has recovered."""
    wrong = [] if world.link.rate == world.rate else [f"the bus has been left at {world.link.rate} bit/s"]
    if world.journal.unfinished() is None:
        return wrong + world.faults(None)
    if not any("recover() ends it" in note for note in world.notes):
        wrong.append("the journal is open and nobody has said so")
    outcome = world.run(world.recovery)
    return wrong + world.faults(outcome)


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    """Journals on the disk, one after the other."""

    def make() -> BusJournal:
        path = tmp_path / "one.journal"
        path.unlink(missing_ok=True)
        return BusJournal("feetech:/dev/ttyACM7", path)

    return make


def lines_of(verb: str, model: str, kept: Kept) -> int:
    world = World(verb, {"model": model}, kept())
    never = Interrupt(1_000_000)
    assert not run_interrupted(world, world.change, never)
    return never.count


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("verb", VERBS)
def test_at_every_line_of_a_change(verb: str, model: str, kept: Kept, rounds: Rounds) -> None:
    """Every third one in `make test`."""
    total = lines_of(verb, model, kept)
    assert total > 300, "the whole path is walked"
    for at in range(1, total + 1, 1 if rounds(total, 0) else 3):
        world = World(verb, {"model": model}, kept())
        assert run_interrupted(world, world.change, Interrupt(at))
        assert faults(world) == [], f"line {at}: {world.notes}"


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("later", [1, 2, 3, 5, 8, 13, 21, 34, 55, 89])
def test_twice(verb: str, later: int, kept: Kept) -> None:
    for at in range(1, lines_of(verb, "", kept), 17):
        world = World(verb, {}, kept())
        run_interrupted(world, world.change, Interrupt(at, later))
        if world.journal.unfinished() is None:
            assert world.faults(None) == [], f"line {at} and {later} on: {world.notes}"
        else:
            assert world.faults(world.run(world.recovery)) == [], f"line {at} and {later} on: {world.notes}"


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("verb", VERBS)
def test_at_every_line_of_a_recovery(verb: str, model: str, kept: Kept) -> None:
    """The journal stays open, which an interruption of the recovery itself says, and the next one ends it."""

    def wreck() -> World:
        world = World(verb, {"model": model, "torn": "erased"}, kept())
        world.run(world.change, Cut(record=2, kept=False, supply=True))
        assert world.journal.unfinished() is not None
        return world

    at, inside = 0, True
    told: set[str] = set()
    while inside:
        at += 7
        world = wreck()
        inside = run_interrupted(world, world.recovery, Interrupt(at))
        told |= set(world.notes)
        outcome = world.run(world.recovery)
        assert world.faults(outcome) == [], f"line {at}: {world.notes}"
    assert at > 100
    assert told == {"the change may still be unfinished: recover() ends it"}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_whoever_listens_raises_at_every_record(verb: str, model: str, error: type[BaseException]) -> None:
    """The record is on the disk when the listener hears of it."""
    states: list[str] = []
    for at in range(10):
        with motorbus.simulate("feetech", ids="3", model=model) as simulation:
            told: list[str] = []

            def listen(event: object, told: list[str] = told, at: int = at) -> None:
                if isinstance(event, Journal) and event.state != ASKED:
                    told.append(event.state)
                    if len(told) == at + 1:
                        raise error

            with motorbus.open(simulation.url, report=listen) as bus:
                servo = motorbus.feetech.Servo(bus, 3)
                notes = cancelled(servo, verb, error)
                if notes is None:
                    break
                assert "locked" in notes[0]
                states.append(told[at])
                assert session.unfinished(bus) is None
                assert bus.rate == 1_000_000
            (one,) = simulation.simulator.servos  # type: ignore[attr-defined]
            one.power_cycle()
            assert (one.id, one.baud_rate) in ((3, 1_000_000), (7, 1_000_000), (3, 500_000))
            assert one.second_id in (None, one.id if verb == "set_id" else 3)
            assert one.locked
    assert states[0] == INTENT
    assert len(states) > 3


@pytest.mark.parametrize("verb", VERBS)
def test_whoever_listens_raises_at_all_records(verb: str) -> None:
    """Nothing can be told any more, and the servo and the rate of the bus are brought to an end all the same."""

    def listen(event: object) -> None:
        if isinstance(event, Journal) and event.state not in (ASKED, INTENT, "writing 7", "writing 1"):
            raise ValueError(event.state)

    with (
        motorbus.simulate("feetech", ids="3") as simulation,
        motorbus.open(simulation.url, report=listen) as bus,
    ):
        notes = cancelled(motorbus.feetech.Servo(bus, 3), verb, ValueError)
        assert notes == ["the change may be unfinished: recover() ends it"]
        assert bus.rate == 1_000_000
        assert session.unfinished(bus) is None
        (one,) = simulation.simulator.servos  # type: ignore[attr-defined]
        assert one.locked


def cancelled(servo: Any, verb: str, error: type[BaseException]) -> list[str] | None:
    """What the interruption of the change says; None when it came to its end."""
    try:
        getattr(servo, verb)(7 if verb == "set_id" else 500_000, among=[3])
    except error as caught:
        return caught.__notes__
    return None
