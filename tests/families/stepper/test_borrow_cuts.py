"""A host that dies at any request of a borrow, in virtual time: the next one is told, moves nothing, and mends it.

Wherever it dies, before a request has left or after it, the motor comes to rest by itself, what was saved stays as it
was, and `recover` brings project 1 back to what it was; dying in the middle of that changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import tau
from typing import Any

import pytest

from motorbus.errors import LinkLost, RequestError
from motorbus.families.stepper import Controller
from tests.families.stepper.loans import Cut, Line1
from tests.families.stepper.partners import Partner, kept
from tests.families.stepper.test_driver_borrowing import READINGS

Work = Callable[[Controller], object]


def jogged(device: Controller) -> object:
    return device.jog(tau, 0.5)


def moved(device: Controller) -> object:
    return device.move_by(-tau, velocity=tau)


def homed(device: Controller) -> object:
    return device.home(velocity=tau, deadline=5.0)


def timed(device: Controller) -> object:
    return kept(device, Partner(1.0, thinks=0.01), -tau)


WORKS: dict[str, tuple[Work, dict[str, Any]]] = {
    "jog": (jogged, {}),
    "move_by": (moved, {}),
    "home": (homed, {"home_switch": "wired", "home_at": -30}),
    "keep_time": (timed, {}),
}
OTHERS: tuple[Work, ...] = (
    jogged,
    moved,
    homed,
    timed,
    lambda device: device.run_once(),
    lambda device: device.jog_forward(0.1),
    lambda device: device.run(1),
    lambda device: device.write(step_1_delay=0.5),
    lambda device: device.select(2),
    lambda device: device.save(1, expert=True),
    lambda device: device.clear(2),
)


def cuts(line: Callable[[], Line1], work: Callable[[Line1], Work], most: int = 1_000_000) -> Iterator[Cut]:
    """Every request of this work, not sent and sent; of more than about `most`, that many, evenly apart."""
    whole = line()
    whole.run(work(whole))
    every = [Cut(request, sent) for request in range(whole.count) for sent in (False, True)]
    yield from every[:: -(-len(every) // most)]


def wrecked(cut: Cut, work: Work, options: dict[str, Any]) -> Line1:
    """The line after a host has died so, and the time has passed in which the motor comes to its end."""
    line = Line1(**options)
    told = line.run(work, cut)
    assert isinstance(told, LinkLost), told
    line.later()
    assert line.at_rest, cut
    return line


def refused(line: Line1, cut: Cut) -> None:
    """While it is unfinished nothing moves, and nothing is sent that changes anything."""
    for work in OTHERS:
        told = line.run(work)
        assert isinstance(told, RequestError), cut
        assert "the borrow of project 1 (for" in told.summary
        assert f"motorbus recover {line.journal.bus}" in told.advice
        assert line.sent == []


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("options", READINGS)
@pytest.mark.parametrize("verb", WORKS)
def test_at_every_request(verb: str, options: dict[str, Any], rounds: Callable[[int], int]) -> None:
    """Every cut in `make soak`; some of them, evenly apart, in `make test`."""
    work, more = WORKS[verb]
    most = 1_000_000 if rounds(1_000_000) == 1_000_000 else 20
    unfinished = 0
    for number, cut in enumerate(cuts(lambda: Line1(**options, **more), lambda line: work, most)):
        line = wrecked(cut, work, {**options, **more})
        if number % 3 == 1:
            line.simulated.power_cycle()
        unfinished += mended(line, verb, cut)
    assert unfinished > min(most // 3, 30)


def mended(line: Line1, verb: str, cut: Cut) -> bool:
    """Whether there was anything to mend: the next host was told, refused to move, and has mended it."""
    if line.journal.unfinished() is None:
        assert line.as_before, cut
        return False
    assert f"the borrow of project 1 (for {verb})" in line.journal.warning()
    refused(line, cut)
    assert line.run(line.recovery) == "old", cut
    assert line.as_before, cut
    assert line.journal.unfinished() is None
    if cut.request % 5 == 0:
        assert not isinstance(line.run(jogged), Exception), cut
        assert line.as_before
    return True


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("options", READINGS)
def test_at_every_request_of_the_recovery(options: dict[str, Any], rounds: Callable[[int], int]) -> None:
    most = 1_000_000 if rounds(1_000_000) == 1_000_000 else 12
    for cycle in (False, True):

        def wreck(cycle: bool = cycle) -> Line1:
            line = wrecked(Cut(6, sent=True), jogged, options)
            if cycle:
                line.simulated.power_cycle()
            return line

        for cut in cuts(wreck, lambda line: line.recovery, most):
            line = wreck()
            assert isinstance(line.run(line.recovery, cut), LinkLost)
            assert line.journal.unfinished() is not None, cut
            assert line.run(line.recovery) == "old", cut
            assert line.as_before, cut


def test_what_was_saved_is_never_touched() -> None:
    for cut in cuts(Line1, lambda line: jogged, 20):
        line = wrecked(cut, jogged, {})
        line.simulated.power_cycle()
        assert line.as_before, "a power cycle gives it back as well"
