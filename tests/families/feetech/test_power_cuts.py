"""Ids and rates changed under power cuts and crashes, at every place, and again during the recovery.

Every cut must end with the servo under its old id or rate or under its new one, reachable, locked, at most one servo to
an id, the journal closed and telling the truth; and all of that must still hold after one more power cycle. `make test`
takes some of the cuts, `make soak` every one of them and prints how many there were.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice, product
from typing import Any

import pytest

from motorbus.core.steps import INTENT
from motorbus.errors import NoReply, RequestError
from tests.conftest import Figures
from tests.families.feetech.cuts import NEVER, OLD, VERBS, Cut, World, cuts

MODELS = ("sts3215", "scs0009", "scs215-2", "sm60-360m", "sm85blhv", "hls3925")
TORN = ("old", "new", "erased")
SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {"id_ack": "old", "baud_ack": "new"},
    {"eeprom_commit": "after_ack"},
    {"lock_drops": True},
    {"startup_time": 0.3},
    {"eeprom_commit": "after_ack", "lock_drops": True},
    {"volatile": True},
    {"ids": (1, 7), "volatile": True},
    {"ids": (3, 1)},
    {"ids": (3, 1), "volatile": True, "eeprom_commit": "after_ack"},
)
FEW = 8
"""Cuts of one kind of servo in `make test`."""

Rounds = Callable[[int], int]


def is_thorough(rounds: Rounds) -> bool:
    """In `make soak` nothing is left out."""
    return rounds(1_000_000) == 1_000_000


def some(found: list[Cut], few: int, shift: int) -> Iterator[Cut]:
    """So many, spread over all of them."""
    step = max(1, len(found) // few)
    return islice(found, shift % step, None, step)


def changing(world: World) -> Callable[[Any], Any]:
    return world.change


def recovering(world: World) -> Callable[[Any], Any]:
    return world.recovery


def ended(world: World) -> list[str]:
    """The next host recovers; what is wrong in the end."""
    outcome = world.run(world.recovery)
    told = [str(outcome)] if isinstance(outcome, Exception) else []
    return told + world.faults(None if told else outcome)


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("model", MODELS)
def test_d10_every_cut_ends_old_or_new(verb: str, model: str, rounds: Rounds, figures: Figures) -> None:
    counted = struck = lost = 0
    kinds = list(product(TORN, SETTINGS))[:: 1 if is_thorough(rounds) else 4]
    for shift, (torn, settings) in enumerate(kinds):
        options = {"model": model, "torn": torn, **settings}
        found = list(cuts(partial(World, verb, options), changing))
        for cut in found if is_thorough(rounds) else some(found, max(1, FEW // len(kinds)), 7 * shift):
            world = World(verb, options)
            world.run(world.change, cut)
            struck += world.link.struck
            wrong = ended(world)
            lost += bool(wrong)
            assert wrong == [], f"{options} {cut}"
            counted += 1
    assert struck > 0.8 * counted > 0, "but for those at records that are never written"
    what = f"D10 {verb} cut once, {model}"
    figures(what, family="feetech", cuts=counted, struck=struck, lost=lost)


def wrecks(verb: str, options: dict[str, Any]) -> list[Cut]:
    """One first cut for each different state that any first cut leaves behind with the journal open."""
    found: dict[object, Cut] = {}
    for cut in cuts(partial(World, verb, options), changing):
        world = World(verb, options)
        world.run(world.change, cut)
        if world.journal.unfinished() is not None:
            found.setdefault(world.state, cut)
    return list(found.values())


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("model", MODELS)
def test_d10_every_cut_of_the_recovery_too(verb: str, model: str, rounds: Rounds, figures: Figures) -> None:
    """From every state that a first cut can leave, each cut of the recovery, and a recovery after that."""
    counted = states = lost = 0
    more = {"torn": "erased", **SETTINGS[1 + MODELS.index(model) % (len(SETTINGS) - 1)]}
    kinds = [*({"torn": torn} for torn in TORN), more] if is_thorough(rounds) else [{"torn": TORN[-1]}]
    for kind in kinds:
        options = {"model": model, **kind}
        for first in wrecks(verb, options):

            def wreck(first: Cut = first, options: dict[str, Any] = options) -> World:
                world = World(verb, options)
                world.run(world.change, first)
                return world

            states += 1
            seconds = list(cuts(wreck, recovering))
            for second in seconds if is_thorough(rounds) else some(seconds, 2, 5 * states):
                world = wreck()
                world.run(world.recovery, second)
                wrong = ended(world)
                lost += bool(wrong)
                assert wrong == [], f"{kind} {first} {second}"
                counted += 1
    assert states > 3
    what = f"D10 {verb} cut and its recovery cut, {model}"
    figures(what, family="feetech", states=states, cuts=counted, lost=lost)


@pytest.mark.parametrize("verb", VERBS)
def test_uncut_it_is_new_and_cut_before_the_intent_it_is_old(verb: str) -> None:
    world = World(verb, {})
    world.run(world.change)
    assert world.place == world.new
    assert world.faults(None) == []
    world = World(verb, {})
    world.run(world.change, Cut(record=0, kept=False))
    assert world.place == world.old
    assert world.journal.unfinished() is None
    assert world.servo.memory.wear.total() == 0


@pytest.mark.parametrize("verb", VERBS)
def test_the_very_first_packet_of_the_change_is_cut_too(verb: str) -> None:
    """What is read before the change begins is no part of it, and is not cut in its place."""
    world = World(verb, {})
    world.run(world.change, Cut(byte=0))
    change = world.journal.unfinished()
    assert change is not None
    assert change.facts["reached"] == [INTENT]


@pytest.mark.parametrize("verb", VERBS)
def test_the_cuts_strike_where_they_should(verb: str) -> None:
    """So that a clean result is not the result of cuts that cut nothing."""
    seen: set[object] = set()
    for cut in cuts(lambda: World(verb, {"torn": "erased"}), changing):
        world = World(verb, {"torn": "erased"})
        world.run(world.change, cut)
        change = world.journal.unfinished()
        seen.add(change.facts["reached"][-1] if change else "closed")
        cell = world.servo.memory.stored[5 if verb == "set_id" else 6]
        seen.add({0xFF: "torn"}.get(cell, "whole"))
        seen.add("locked" if world.servo.locked else "open")
    value = 7 if verb == "set_id" else 1
    assert seen == {
        INTENT,
        f"writing {value}",
        f"written {value}",
        "closed",
        "torn",
        "whole",
        "locked",
        "open",
    }


@pytest.mark.parametrize("verb", VERBS)
def test_a_servo_that_heeds_nothing_is_said_to_be_lost(verb: str) -> None:
    """The only end that is none: a torn cell, on servos that cannot be reached then; the journal stays open."""
    world = World(verb, {"torn": "erased", "torn_identity": "unreachable"})
    world.run(world.change, Cut(moment=0.01, host=True, supply=True))
    outcome = world.run(world.recovery)
    assert isinstance(outcome, NoReply)
    assert "is nowhere" in outcome.summary
    assert ("by broadcast" in outcome.advice) is (verb == "set_id")
    assert world.journal.unfinished() is not None


def test_one_without_an_id_is_called_back_when_it_is_alone() -> None:
    world = World("set_id", {"torn": "erased", "torn_identity": "unreachable"})
    world.run(world.change, Cut(moment=0.01, host=True, supply=True))
    assert world.servo.id == 0xFF
    refusal = world.run(lambda bus: world.recovery(bus, alone=True))
    assert isinstance(refusal, RequestError)
    assert "the servo is not alone: " in refusal.summary
    world.devices.servos[1].unplug()
    assert world.run(lambda bus: world.recovery(bus, alone=True)) == "old"
    assert world.faults("old") == []
    assert world.servo.id == OLD


def test_a_second_recovery_finds_nothing_to_do() -> None:
    world = World("set_id", {})
    world.run(world.change, Cut(record=1, kept=True))
    assert world.run(world.recovery) == "old"
    assert world.run(world.recovery, NEVER) is None
