"""Row L17: Ctrl-C, or no more memory, at every line of every kind of transaction of all families, and of a stop.

Wherever it falls, whoever called is told so by an exception; nothing of the call is left on the bus; the next read is
right, the second at the latest; and a stop goes out. In the long runs that is every line that is executed, at its first
visits; else a few of each kind.
"""

from __future__ import annotations

from contextlib import closing

import pytest

from motorbus.bus.pump import Bus
from motorbus.bus.stop import StopOutcome
from motorbus.errors import MotorbusError
from motorbus.families.feetech import FAMILY
from motorbus.link.pty import PtyMaster
from motorbus.link.serial import SerialLink
from motorbus.simulation.mount import Mount
from tests.bus.responder import Responder, position
from tests.bus.script import admit_all
from tests.conftest import Figures, Rounds
from tests.faults.cutting import (
    NEVER,
    UNSENT,
    Outcome,
    Scissors,
    Twice,
    afterwards,
    cut,
    laters,
    left_behind,
    places,
    stuck,
    told,
)
from tests.faults.scenes import IDS, KINDS, Scene, off
from tests.simulation.served import served

ERRORS = (KeyboardInterrupt, MemoryError)
VISITS = 3
OFTEN_CUT = ("feetech guarded write", "kst run", "stepper home")
"""The kinds of transactions that are cut twice, too: one of each family, and each has much to clean up."""
UNSENT_STOP = ("it ended with", "it was latched, and something moves", "the stop did not go out")


def carried_out(
    kind: str,
    at: int = NEVER,
    error: type[BaseException] = KeyboardInterrupt,
    later: int = 0,
    scissors: type[Scissors] = Scissors,
) -> tuple[Scene, Outcome, int]:
    """A scene on which this kind of transaction was cut there, what came of it, and how much had been sent before."""
    how = KINDS[kind]
    there = Scene(how.family)
    how.prepare(there)
    before = len(there.wire.sent)
    return there, cut(lambda: there.bus.run(how.act(there)), at, error, later, scissors), before


def faults(kind: str, at: int, error: type[BaseException]) -> list[str]:
    """What is wrong when this kind of transaction is cut there."""
    there, came, before = carried_out(kind, at, error)
    wrong = [] if came.where is not None else ["it was not cut"]
    if not isinstance(came.error, error):
        wrong.append(f"it ended with {came.error!r}, {came.value!r}")
    if UNSENT.search(told(came.error)) and len(there.wire.sent) > before:
        wrong.append("something was sent, and it says that nothing was")
    return [f"{one}, cut at {came.where}" for one in wrong + afterwards(there, there.bus.run)]


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", KINDS)
def test_l17_an_interrupt_at_any_line_of_a_transaction(kind: str, rounds: Rounds, figures: Figures) -> None:
    cuts, lines, wrong = 0, set(), list[str]()
    carried_out(kind)  # what is made at the first time and kept is no line of those that follow
    for error in ERRORS:
        there, whole, _ = carried_out(kind, NEVER, error)
        assert whole.error is None
        assert KINDS[kind].done(there, whole.value), "when it is not cut it is done"
        for at in places(whole.walked, VISITS, rounds(NEVER, 9)):
            wrong += faults(kind, at, error)
            cuts += 1
        lines |= set(whole.walked)
    family, left = KINDS[kind].family, stuck(wrong)
    figures(
        f"L17 interrupts: {kind}", family=family, lines=len(lines), cuts=cuts, stuck=left, wrong=len(wrong)
    )
    assert wrong == []
    assert cuts


def stopped(there: Scene) -> None:
    """A bus on which something moves and everyone has been heard."""
    off(there)
    for device in there.devices:
        device.ping()


def stop_faults(family: str, at: int, error: type[BaseException]) -> list[str]:
    """What is wrong when an emergency stop is cut there."""
    there = Scene(family)
    stopped(there)
    before = len(there.wire.sent)
    came = cut(there.bus.estop, at, error)
    wrong = [] if came.where is not None else ["it was not cut"]
    if isinstance(
        came.value, StopOutcome
    ):  # the frames that were made before do where new ones cannot be made
        wrong += [] if set(came.value.acknowledged) == set(there.ids) else [f"it ended with {came.value}"]
    elif not isinstance(came.error, error):
        wrong.append(f"it ended with {came.error!r}")
    begun = there.bus.turns.latched
    wrong += left_behind(there)
    there.settle()
    if begun and there.moving():
        wrong.append("it was latched, and something moves")
    if not begun and len(there.wire.sent) > before:
        wrong.append("something was sent, and it is not latched")
    there.bus.reset()
    return [f"{one}, cut at {came.where}" for one in wrong + afterwards(there, there.bus.run)]


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("family", IDS)
def test_l17_an_interrupt_at_any_line_of_an_emergency_stop(
    family: str, rounds: Rounds, figures: Figures
) -> None:
    """Once it has begun it goes out, is repeated until everyone has acknowledged, and only then is anything raised."""
    cuts, lines, wrong = 0, set(), list[str]()
    for error in ERRORS:
        there = Scene(family)
        stopped(there)
        whole = cut(there.bus.estop, NEVER, error)
        assert set(whole.value.acknowledged) == set(there.ids)
        for at in places(whole.walked, VISITS, rounds(NEVER, 9)):
            wrong += stop_faults(family, at, error)
            cuts += 1
        lines |= set(whole.walked)
    unsent = sum(fault.startswith(UNSENT_STOP) for fault in wrong)
    figures("L17 interrupts: emergency stop", family=family, lines=len(lines), cuts=cuts, unsent=unsent)
    assert wrong == []
    assert cuts


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", OFTEN_CUT)
def test_l17_a_second_interrupt_at_any_line_of_the_clean_up(
    kind: str, rounds: Rounds, figures: Figures
) -> None:
    carried_out(kind)  # what is kept from a first time on walks fewer lines
    _, whole, _ = carried_out(kind)
    cuts, twice, wrong = 0, 0, list[str]()
    for number, at in enumerate(places(whole.walked, 2, rounds(NEVER, 18))):
        for later in laters(number):
            there, came, _ = carried_out(kind, at, KeyboardInterrupt, later, Twice)
            found = [] if isinstance(came.error, KeyboardInterrupt) else [f"it ended with {came.error!r}"]
            found += afterwards(there, there.bus.run)
            wrong += [f"{one}, cut at {came.where} and at {came.again}" for one in found]
            cuts += 1
            twice += came.again is not None
    family, left = KINDS[kind].family, stuck(wrong)
    figures(
        f"L17 interrupted twice: {kind}", family=family, cuts=cuts, twice=twice, stuck=left, wrong=len(wrong)
    )
    assert wrong == []
    assert twice >= cuts / 2 > 0  # the others were over by then


def ported(link: SerialLink, at: int, error: type[BaseException]) -> Outcome:
    """A read by a real port, cut there; afterwards another one is right, the second at the latest."""
    bus = Bus(link, FAMILY, admit=admit_all)
    came = cut(lambda: bus.run(position(1)), at, error)
    told: list[object] = []
    for node in (2, 3):
        try:
            told.append(bus.run(position(node)))
        except MotorbusError as failure:
            told.append(failure)
    assert told[1] == 3, (came.where, told)
    assert told[0] == 2 or isinstance(told[0], MotorbusError), (came.where, told)
    assert not bus.turns.lock._is_owned()  # type: ignore[attr-defined]
    assert not bus.turns.waiting
    assert bus.relay.pumper is None
    return came


@pytest.mark.timeout(1800)
def test_l17_an_interrupt_at_any_line_on_a_real_port(rounds: Rounds, figures: Figures) -> None:
    """As above, with the code of a serial port in place of a link in memory."""
    with closing(PtyMaster()) as master, served(Mount(Responder(), master)):
        link = SerialLink(master.slave_name, rate=1_000_000)
        cuts = 0
        for error in ERRORS:
            walked = ported(link, NEVER, error).walked
            for at in places(walked, VISITS, rounds(NEVER, 12)):
                came = ported(link, at, error)
                cuts += came.where is not None
                assert came.where is None or isinstance(came.error, error), came
        link.close()
    assert cuts > 10
    figures("L17 interrupts: a read by a pseudo-terminal", family="feetech", cuts=cuts)


def test_l17_a_run_that_is_cut_before_its_start_is_not_said_to_go_on() -> None:
    _, whole, _ = carried_out("stepper run")
    said = {True: 0, False: 0}
    for at in places(whole.walked, VISITS, 60):
        there, came, _ = carried_out("stepper run", at)
        started = any(isinstance(data, bytes) and data[:3] == b"\xff\xaa\x4e" for data in there.wire.sent)
        if "goes on" in told(came.error):
            said[started] += 1
    assert said[True] >= 10
    assert said[False] <= 3, "but for the few lines between the last judgement of it and its leaving"
