"""Keeping time with others: begun on the moment, as long as agreed, and with nothing moved where somebody gives up."""

from __future__ import annotations

from dataclasses import replace
from math import pi, tau
from typing import Any

import pytest

from motorbus.core.family import Identity
from motorbus.core.steps import INTENT, OUTCOME, Procedure, Sleep, catch, gather
from motorbus.core.timing import Turned
from motorbus.errors import Interrupted, LinkLost, MotorbusError, NotHomed, OutcomeUnknown, RequestError
from motorbus.families.stepper import FAMILY, Controller, driver
from motorbus.families.stepper.driver.borrowing import LOST, NOTE
from motorbus.families.stepper.driver.stopping import MAY_TURN
from motorbus.motion.meeting import Beat
from tests.families.stepper.loans import MINE, Cut, Line1
from tests.families.stepper.partners import Kept, Partner, kept
from tests.families.stepper.test_driver_borrowing import MOVE, READ, SELECT, failed, starts, states
from tests.families.stepper.test_driver_stopping import MOTOR, PROJECT, Losing

PULSE = tau / 1600


def paced(**options: Any) -> Line1:
    """A line on which bytes take their time."""
    line = Line1(**options)
    line.pace = True
    return line


def untouched(line: Line1) -> None:
    """Nothing has moved, nothing was edited, and nobody has anything to mend."""
    assert SELECT not in starts(line.sent)
    unmoved(line)


def unmoved(line: Line1) -> None:
    assert {MOVE, MOTOR[:11], PROJECT[:11]} & set(starts(line.sent)) == set()
    assert (line.simulated.position, line.as_before, line.journal.unfinished()) == (0, True, None)


# -- the moment and the time -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("turnaround", [0.0, 0.002, 0.015])
@pytest.mark.parametrize("needs", [0.0, 1.0, 2.5, 7.3, 15.0])
@pytest.mark.parametrize("angle", [pi / 2, -3.0, 5 * tau])
def test_it_begins_and_ends_when_it_was_agreed(
    angle: float, needs: float, turnaround: float, pace: bool
) -> None:
    line = Line1(turnaround=turnaround)
    line.pace = pace
    found = Kept(line, Partner(needs), angle=angle)
    turned, partner = found.turned, found.partner
    assert abs(found.first - partner.moment) < 0.002
    assert found.last - found.first == pytest.approx(partner.agreed_on, rel=0.01)
    assert abs(found.last - partner.moment - partner.agreed_on) < 0.01 * partner.agreed_on
    assert turned.start == pytest.approx(found.first, abs=0.002)
    assert turned.duration == pytest.approx(found.last - found.first, rel=1e-6)
    assert line.simulated.position == round(angle / PULSE)
    assert turned.angle == pytest.approx(line.simulated.position * PULSE)
    assert (line.at_rest, line.as_before, line.journal.unfinished()) == (True, True, None)


def test_the_way_is_what_the_motor_does() -> None:
    found = Kept(paced(), Partner(2.0), angle=-tau)
    motion, behind = found.motion, 1e-9
    assert motion is not None
    for at in [number / 50 for number in range(120)]:
        pulses = motion.done(found.first - found.since + at + behind)
        assert found.turned.way(at + behind) == pytest.approx(-pulses * PULSE), at
    assert found.turned.way(-0.1) == 0.0
    assert found.turned.way(1e9) == found.turned.angle == pytest.approx(-tau)


def test_it_takes_the_others_along_by_a_meeting() -> None:
    line = paced()
    beat = Beat(["here"])
    told = line.run(
        lambda device: device.bus.run(
            driver.keep_time(device, 3.0, beat.of("here", 0.5), velocity=10.0, acceleration=None)
        )
    )
    assert isinstance(told, Turned)
    assert told.duration == pytest.approx(0.4, abs=0.3)
    assert line.simulated.position == round(3.0 / PULSE)


def test_how_long_it_takes_at_least_can_be_asked_without_borrowing() -> None:
    line, partner = paced(), Partner()
    told = line.run(
        lambda device: device.bus.run(driver.shortest(device, 3.0, velocity=10.0, acceleration=20.0))
    )
    assert set(starts(line.sent)) == {READ}
    Kept(line, partner, angle=3.0, velocity=10.0, acceleration=20.0)
    assert told == partner.shortest > 0.2


def test_a_cleared_project_1_takes_its_geometry_from_another_and_is_clear_again() -> None:
    line = Line1(None, shipped="empty")
    line.simulated.put(3, replace(MINE, number=3))
    found = Kept(line, Partner(2.0), angle=tau)
    assert found.turned.angle == pytest.approx(tau)
    assert (line.simulated.position, line.as_before) == (1600, True)


def test_what_cannot_be_so_slow_ends_before_the_others_and_says_so() -> None:
    line = paced()
    found = Kept(line, Partner(60.0), angle=pi / 2)
    assert found.partner.fit == pytest.approx(20.8, abs=0.1)
    assert found.partner.agreed_on == 60.0
    assert found.turned.duration == pytest.approx(found.last - found.first)
    assert found.turned.duration < 21.0


@pytest.mark.parametrize("angle", [0.0, 0.4 * PULSE, -0.4 * PULSE])
def test_what_is_there_already_takes_part_and_stays(angle: float) -> None:
    line, partner = paced(), Partner(2.0)
    turned = Kept(line, partner, angle=angle).turned
    assert (turned.angle, turned.duration, turned.start, turned.way(1.0)) == (0.0, 0.0, partner.moment, 0.0)
    assert (partner.asked, partner.shortest) == (["agreed", "start"], 0.0)
    assert set(starts(line.sent)) == {READ}
    untouched(line)


# -- in which order ----------------------------------------------------------------------------------------------------


def test_it_reads_agrees_edits_meets_moves_stops_and_gives_back() -> None:
    line = paced()
    sent: dict[str, list[str]] = {}

    class Looking(Partner):
        def _thought(self, where: str) -> Procedure[None]:
            sent[where] = list(states(line))
            return super()._thought(where)

    assert Kept(line, Looking(2.0)).turned
    assert sent == {"agreed": [], "start": [INTENT, "borrowed"]}
    assert states(line) == [INTENT, "borrowed", OUTCOME]
    order = starts(line.sent)
    move = order.index(MOVE)
    assert order[:2] == [READ, READ]
    assert order[2] == SELECT
    assert order[move + 1 : move + 3] == [MOTOR[:11], PROJECT[:11]]


@pytest.mark.parametrize("fails", ["agreed", "start"])
def test_others_that_give_up_leave_nothing_moved(fails: str) -> None:
    line = paced()
    found = Kept(line, Partner(2.0, fails=fails))
    failed(found.told, Interrupted, "the others do not move")
    assert isinstance(found.told, MotorbusError)
    assert found.told.unmoved
    assert found.partner.failures == [found.told]
    unmoved(line)
    assert (SELECT in starts(line.sent)) == (fails == "start")


REFUSED: dict[str, dict[str, Any]] = {
    "too far": {"angle": 1e9},
    "no number": {"angle": float("nan")},
    "too slow": {"velocity": 0.1},
    "standing": {"velocity": 0.0},
    "backwards": {"velocity": -3.0},
    "endless": {"velocity": float("inf")},
    "flat": {"acceleration": 0.0},
    "steep": {"acceleration": float("inf")},
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_is_refused_before_anybody_is_asked(what: str) -> None:
    line, partner = paced(), Partner()
    found = Kept(line, partner, **REFUSED[what])
    failed(found.told, RequestError, "")
    assert isinstance(found.told, MotorbusError)
    assert found.told.unmoved
    assert partner.asked == []
    untouched(line)


def test_unsaved_edits_of_others_are_refused_before_anybody_is_asked() -> None:
    line, partner = paced(), Partner()

    def work(device: Controller) -> Turned:
        device.memory.unsaved = replace(MINE, number=2)
        return kept(device, partner)

    told = line.run(work)
    failed(told, RequestError, "not saved")
    assert partner.asked == []


def test_a_borrow_that_was_cut_off_is_refused_before_anybody_is_asked() -> None:
    line, partner = paced(), Partner()
    line.run(lambda device: device.jog(3.0, 0.5), Cut(6))
    line.later()
    failed(Kept(line, partner).told, RequestError, "the borrow of project 1 (for jog)")
    assert (partner.asked, line.sent) == ([], [])


# -- stopped, interrupted, cut off -------------------------------------------------------------------------------------


def beside(line: Line1, partner: Partner, other: Any, angle: float = 5 * tau) -> tuple[Any, Any]:
    """What came of it, and of something else that was begun with it."""

    def together(device: Controller) -> list[Any]:
        mine = driver.keep_time(device, angle, partner, velocity=10.0)
        found: list[Any] = device.bus.run(gather(catch(mine), catch(other(device))))
        return found

    told, too = line.run(together)  # type: ignore[misc]
    return told, too


def stopping(seconds: float) -> Any:
    async def work(device: Controller) -> object:
        await Sleep(seconds)
        return await driver.stop(device)

    return work


def emergency(seconds: float) -> Any:
    async def work(device: Any) -> None:
        await Sleep(seconds)
        device.bus.estop()
        device.bus.reset()

    return work


@pytest.mark.parametrize("stop", [stopping, emergency])
@pytest.mark.parametrize("place", ["agreed", "start", "moving"])
def test_a_stop_of_another_task_ends_it(stop: Any, place: str) -> None:
    """While it waits for others, or turns: it does not begin, or does not go on."""
    line = paced()
    partner = Partner(6.0, thinks=3.0)
    told, _ = beside(line, partner, stop({"agreed": 2.0, "start": 5.5, "moving": 9.0}[place]))
    assert isinstance(told, Interrupted), told
    assert partner.asked == (["agreed"] if place == "agreed" else ["agreed", "start"])
    assert told.unmoved == (place != "moving")
    assert starts(line.sent).count(MOVE) == (place == "moving")
    assert 0 < line.simulated.position < 8000 if place == "moving" else line.simulated.position == 0
    assert (line.at_rest, line.as_before, line.journal.unfinished()) == (True, True, None)


def test_the_others_are_told_of_a_stop_before_project_1_is_given_back() -> None:
    line = paced()
    seen: list[bool] = []

    class Noting(Partner):
        def fails(self, error: BaseException) -> None:
            super().fails(error)
            seen.append(line.as_before)

    partner = Noting(6.0)
    told, _ = beside(line, partner, stopping(5.0))
    assert isinstance(told, Interrupted), told
    assert not told.unmoved
    assert (partner.failures, seen) == ([told], [False])
    assert line.as_before


@pytest.mark.parametrize("moment", [0.2, 0.6, 1.0, 1.3, 2.2, 3.0])
def test_ctrl_c_gives_project_1_back(moment: float) -> None:
    """While it reads, agrees, edits, meets, or turns."""
    line = paced()
    line.interrupts = [moment]
    with pytest.raises(KeyboardInterrupt) as caught:
        Kept(line, Partner(4.0, thinks=0.5))
    line.later(1.0)
    assert (line.at_rest, line.as_before, line.journal.unfinished()) == (True, True, None)
    assert NOTE not in getattr(caught.value, "__notes__", ())


def test_a_host_that_is_killed_in_the_middle_leaves_word_of_it() -> None:
    line, whole = Line1(), Line1()
    Kept(whole, Partner(2.0))
    move = starts(whole.sent).index(MOVE)
    found = Kept(line, Partner(2.0), Cut(move, sent=True))
    assert isinstance(found.told, LinkLost)
    assert not found.told.unmoved
    line.later()
    assert "the borrow of project 1 (for keep_time)" in line.journal.warning()
    assert (line.at_rest, line.as_before) == (True, False)
    assert line.simulated.position == round(3.0 / PULSE), "it has come to its end by itself"
    assert line.run(line.recovery) == "old"
    assert (line.as_before, line.journal.unfinished()) == (True, None)


def test_an_order_that_nobody_acknowledged_is_not_known() -> None:
    line = paced()
    line.line = Losing(MOVE, 1)
    found = Kept(line, Partner(2.0))
    assert isinstance(found.told, OutcomeUnknown)
    assert not found.told.unmoved
    assert (line.at_rest, line.as_before, line.journal.unfinished()) == (True, True, None)


@pytest.mark.parametrize("place", ["agreed", "start"])
def test_a_supply_that_goes_while_it_waits_is_told(place: str) -> None:
    """What was edited is lost then; before it was edited nothing is."""
    line = paced()

    class Cutting(Partner):
        def _thought(self, where: str) -> Procedure[None]:
            if where == place:
                line.simulated.power_cycle()
            return super()._thought(where)

    found = Kept(line, Cutting(2.0))
    assert isinstance(found.told, OutcomeUnknown) == (place == "start"), found.told
    if place == "start":
        assert LOST in str(found.told)
    assert (line.as_before, line.journal.unfinished()) == (True, None)


@pytest.mark.parametrize("fault", ["lost", "late", "doubled", "bit", "other", "split", "noise", "unheard"])
@pytest.mark.parametrize("every", [2, 3, 5, 7, 13])
def test_on_faulty_lines_it_keeps_time_or_says_that_it_does_not(fault: str, every: int) -> None:
    line = paced(reply_fault=fault, fault_every=every)
    found = Kept(line, Partner(3.0))
    line.later(1.0)
    told = found.told
    assert line.at_rest or (isinstance(told, MotorbusError) and MAY_TURN in str(told))
    if isinstance(told, Turned):
        assert line.simulated.position == round(3.0 / PULSE)
        assert found.last - found.first == pytest.approx(found.partner.agreed_on, rel=0.01)
        assert told.start == pytest.approx(found.first, abs=0.6 if fault in ("late", "split") else 0.02)
    elif told.unmoved:
        assert line.simulated.position == 0
    assert line.as_before or line.journal.unfinished() is not None


@pytest.mark.parametrize("ramp", [{"ramp": "pulse"}, {"ramp_tick_ms": 10.0}])
def test_with_another_reading_of_the_ramp_it_still_comes_to_its_end(ramp: dict[str, Any]) -> None:
    line = paced(**ramp)
    found = Kept(line, Partner(2.0), angle=tau)
    assert line.simulated.position == 1600
    assert abs(found.first - found.partner.moment) < 0.03, "a period of the start frequency, at most"


def test_an_axis_keeps_time_homes_and_runs_programs_by_its_capabilities() -> None:
    able = FAMILY.open().axis(Identity(0, "stepper controller", "", ""))
    line = paced(home_switch="wired", home_at=-1000)
    partner = Partner(1.0)
    told = line.run(
        lambda device: [
            device.bus.run(able.keep_time(device, 1.0, partner, velocity=5.0, acceleration=20.0)),
            device.bus.run(able.home(device, deadline=5.0)),
            device.bus.run(able.run(device, 1, timeout=9.0)),
        ]
    )
    assert isinstance(told, list), told
    turned, homed, ran = told
    assert isinstance(turned, Turned)
    assert isinstance(homed, driver.Homed)
    assert (homed.node, 0 < homed.seconds < 5.0, homed.promise) == (1, True, driver.Promise.STOP_ACCEPTED)
    assert ran.outcome is driver.Outcome.COMPLETED
    late = line.run(lambda device: device.bus.run(able.home(device, deadline=0.2)))
    failed(late, NotHomed, "within 0.2 s")
