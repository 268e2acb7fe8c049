"""A canary at its edges: whose answers count, who is asked at all, and what a fault leaves behind."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import pytest

from motorbus.core.family import Health
from motorbus.core.operation import Operation
from motorbus.errors import DeviceError, Faulted, MotorbusError, NoReply, Refused
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.safety import canary
from motorbus.motion.safety.canary import LET_GO, RESTART, UNTRUSTED, Canary, FaultNoted
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard
from tests.motion.safety.alone import Alone, fares

LIMP = fares(torque=False, voltage=7.4)
SAID = "arm#1 has let go, and was not told to from here, and its supply is 7.4 V now"


def given(here: Alone, node: int = 1, *able: str) -> AxisVerbs:
    """An axis that was given torque from here."""
    axis = here.axis(node, *able)
    canary.expected(axis)
    canary.armed(axis)
    return axis


# -- the canary alone --------------------------------------------------------------------------------------------------


def test_one_that_was_never_looked_at_fell_never_and_is_due_at_once() -> None:
    bird = Canary()
    assert (bird.at, bird.fell) == (-inf, False)
    bird.take(fares(at=12.5), armed=True, led=False)
    assert bird.at == 12.5


def test_torque_from_here_forgets_that_it_fell() -> None:
    bird = Canary()
    bird.fell = True
    bird.prepare(0)
    assert bird.fell
    bird.arm()
    assert not bird.fell


def test_who_says_once_how_often_it_started_and_then_no_more_has_not_restarted() -> None:
    bird = Canary()
    for restarts in (3, None, 5, 4, 4):  # nothing to compare with, or fewer: nobody knows
        assert bird.take(fares(restarts=restarts), armed=True, led=True) == ""
    assert bird.take(fares(restarts=5), armed=True, led=True) == RESTART


def test_only_what_was_seen_while_it_is_led_can_be_lost_while_it_is_led() -> None:
    bird = Canary()
    assert bird.take(fares(), armed=True, led=False) == ""
    assert bird.take(fares(blank=True), armed=True, led=True) == ""
    bird.arm()
    assert bird.take(fares(), armed=True, led=True) == ""
    assert bird.take(fares(blank=True), armed=True, led=False) == ""
    assert bird.take(fares(blank=None), armed=True, led=True) == ""  # which does not say that it is lost
    assert bird.take(fares(blank=True), armed=True, led=True) == RESTART


@pytest.mark.parametrize(
    ("alarm", "reason"),
    [
        ("sensor", LET_GO),
        ("temperature", LET_GO),
        ("current", LET_GO),
        ("overload", LET_GO),
        ("voltage", RESTART),
        ("angle", RESTART),
    ],
)
def test_alarms_for_which_a_device_protects_itself_say_that_it_let_go(alarm: str, reason: str) -> None:
    assert Canary().take(fares(torque=False, blank=True, alarm=(alarm,)), armed=True, led=True) == reason


def test_one_that_was_disarmed_has_nothing_to_lose() -> None:
    bird = Canary()
    bird.prepare(0)
    bird.arm()
    assert bird.take(fares(), armed=True, led=True) == ""
    bird.disarm()
    assert not bird.is_armed(0)
    assert bird.take(fares(blank=True), armed=False, led=True) == ""


# -- whose answer counts -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("engaged", "under_way"), [(True, False), (False, True), (False, False)])
def test_a_restart_is_a_fault_of_who_has_torque_or_is_under_way_from_here(
    engaged: bool, under_way: bool
) -> None:
    here = Alone()
    axis = here.axis(engaged=engaged)
    axis.under_way = under_way
    assert canary.looked_at(axis, fares(restarts=1)) is None
    error = canary.looked_at(axis, fares(restarts=2))
    assert (error is not None) is (engaged or under_way)
    assert canary.why(axis) == ("arm#1 has restarted" if error else "")


@pytest.mark.parametrize("led", [True, False, None])
def test_others_may_tell_one_how_fast_to_be_unless_it_is_led(led: bool | None) -> None:
    axis = given(Alone())
    how = {} if led is None else {"led": led}
    assert canary.looked_at(axis, fares(), **how) is None
    assert (canary.looked_at(axis, fares(blank=True), **how) is not None) is bool(led)


def test_who_was_let_go_from_here_or_stopped_holds_no_more() -> None:
    here = Alone()
    axis = given(here)
    assert canary.holds(axis)
    axis.engaged = False
    assert not canary.holds(axis)
    axis.engaged = True
    here.stops[1] = 1
    assert not canary.holds(axis)
    assert canary.looked_at(axis, LIMP) is None


# -- who is asked ------------------------------------------------------------------------------------------------------


def test_who_has_torque_is_asked_again_a_quarter_of_a_second_after_the_last_look() -> None:
    here = Alone()
    axis = given(here)
    for now, asked in ((10.0, 1), (10.249, 1), (10.25, 2)):
        here.now = now
        here.run(canary.looked_after(axis, now))
        assert len(here.asked) == asked
    assert here.told == []


def test_who_has_none_or_cannot_tell_is_not_asked() -> None:
    here = Alone()
    idle, mute = here.axis(1, engaged=False), given(here, 2, "position")
    for axis in (idle, mute):
        here.run(canary.looked_after(axis, 100.0))
    here.run(canary.kept(mute))
    for axis in (idle, mute):
        here.run(canary.unbroken(axis))
    assert here.asked == []


@pytest.mark.parametrize("lost", [NoReply("silent"), DeviceError("no")])
def test_an_answer_that_was_lost_is_no_fault(lost: MotorbusError) -> None:
    here = Alone()
    here.answers[1] = lost
    axis = given(here)
    for one in (canary.looked_after(axis, 10.0), canary.kept(axis), canary.unbroken(axis)):
        here.run(one)
    assert (here.asked, here.told, canary.why(axis)) == ([1, 1, 1], [], "")


def test_who_kept_his_torque_is_told_nothing() -> None:
    here = Alone()
    axis = given(here)
    for one in (canary.looked_after(axis, 10.0), canary.kept(axis), canary.unbroken(axis)):
        here.run(one)
    assert (here.asked, here.told, canary.why(axis)) == ([1, 1, 1], [], "")


def test_looking_after_one_notes_its_fault_once_and_raises_nothing() -> None:
    here = Alone()
    here.answers[1] = LIMP
    axis = given(here)
    here.run(canary.looked_after(axis, 10.0))
    here.run(canary.looked_after(axis, 20.0))
    assert here.told == [FaultNoted("n1", SAID)]
    assert here.asked == [1]


@pytest.mark.parametrize("ask", [canary.kept, canary.unbroken])
def test_who_is_to_get_torque_and_has_not_kept_his_is_at_fault_and_it_is_said(
    ask: Callable[[AxisVerbs], Operation[None]],
) -> None:
    here = Alone()
    here.answers[1] = LIMP
    axis = given(here)
    with pytest.raises(Faulted, match="n1 is at fault") as told:
        here.run(ask(axis))
    assert (told.value.reason, told.value.node) == (LET_GO, 1)
    assert here.told == [FaultNoted("n1", SAID)]


# -- what a fault leaves behind ----------------------------------------------------------------------------------------


def test_a_fault_forgets_where_it_is_here_and_at_the_gate_and_takes_the_command_from_whoever_had_it() -> None:
    here = Alone()
    axis, other = given(here), given(here, 2)
    gate = here.admit
    assert isinstance(gate, Gate)
    guards = {1: Guard("n1", Bounds()), 2: Guard("n2", Bounds())}
    gate.guards.update(guards)
    for track in (axis.track, other.track, *(guard.track for guard in guards.values())):
        assert track is not None
        track.take(0.5, 10.0)
    axis.under_way, axis.orders = True, 7
    canary.fault(axis, "it fell")
    assert axis.track.sample is None
    assert [guard.track and guard.track.sample is None for guard in guards.values()] == [True, False]
    assert other.track.sample is not None
    assert (axis.orders, axis.engaged, axis.under_way, axis.canary.fell) == (8, False, False, True)
    assert not axis.canary.is_armed(0)
    assert (canary.why(axis), canary.why(other)) == ("it fell", "")


def test_that_it_had_torque_when_it_came_to_be_at_fault_is_not_forgotten_by_the_next_fault() -> None:
    axis = Alone().axis()
    canary.fault(axis, "first")
    canary.fault(axis, "then")
    assert (axis.canary.fell, canary.why(axis), axis.orders) == (True, "then", 2)
    idle = Alone().axis(engaged=False)
    canary.fault(idle, "it is limp")
    assert not idle.canary.fell


def test_a_guard_that_measures_nothing_has_nothing_to_forget() -> None:
    here = Alone()
    axis = here.axis(1, "move_by", "health")
    gate = here.admit
    assert isinstance(gate, Gate)
    gate.guards[1] = Guard("n1", Bounds(), measures=False)
    assert axis.reckoning is not None
    axis.reckoning.declare(0.5)
    canary.fault(axis, "it fell")
    assert (axis.reckoning.position, axis.reckoning.why) == (None, "it fell")


def test_a_bus_that_has_no_gate_knows_no_faults() -> None:
    axis = Alone(admit=print).axis()
    canary.fault(axis, "it fell")
    assert canary.why(axis) == ""
    canary.check(axis)
    canary.cleared(axis)
    assert not axis.engaged


@pytest.mark.parametrize("able", ["position", "move_by"])
def test_one_whose_line_was_cut_is_looked_at_anew_and_keeps_what_it_was_given(able: str) -> None:
    here = Alone()
    axis = given(here, 1, able, "health")
    axis.track.take(0.5, 10.0)
    axis.canary.at = 10.0
    if axis.reckoning is not None:
        axis.reckoning.declare(0.5)
    canary.unknown(axis)
    assert (axis.track.sample, axis.canary.at) == (None, -inf)
    assert canary.holds(axis)
    assert (axis.reckoning is None) is (able == "position")
    if axis.reckoning is not None:
        assert axis.reckoning.position is None
        assert "port" in axis.reckoning.why


# -- until somebody has seen to it -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("why", "advice"), [("it fell", 'clear_fault("n1")'), (f"{UNTRUSTED}half written", "end that change")]
)
def test_who_is_at_fault_is_refused_until_somebody_has_seen_to_it(why: str, advice: str) -> None:
    axis = Alone().axis()
    canary.check(axis)
    canary.fault(axis, why)
    with pytest.raises(Refused, match=f"n1 is at fault: {why}") as told:
        canary.check(axis)
    assert (told.value.reason, told.value.node) == ("fault", 1)
    assert told.value.advice.startswith(advice) or advice in told.value.advice
    assert ("clear_fault" in told.value.advice) is (why == "it fell")
    canary.cleared(axis)
    canary.cleared(axis)
    canary.check(axis)


# -- the words ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("found", "reason", "said", "cause"),
    [
        (fares(torque=False), LET_GO, "arm#1 has let go, and was not told to from here", "another"),
        (fares(torque=False, blank=True), RESTART, "arm#1 has restarted", "its supply"),
        (
            fares(torque=False, blank=True, voltage=4.75, alarm=("voltage", "angle")),
            RESTART,
            "arm#1 has restarted, and its supply is 4.8 V now; alarms: voltage, angle",
            "its supply",
        ),
        (
            fares(torque=False, alarm=("overload", "voltage")),
            LET_GO,
            "arm#1 has let go to protect itself; alarms: overload, voltage",
            "it pushed",
        ),
        (
            fares(torque=False, alarm=("voltage",), voltage=0.0),
            LET_GO,
            "arm#1 has let go, and was not told to from here, and its supply is 0.0 V now; alarms: voltage",
            "another",
        ),
    ],
)
def test_the_error_says_what_was_found_and_what_may_be_behind_it(
    found: Health, reason: str, said: str, cause: str
) -> None:
    axis = given(Alone())
    error = canary.looked_at(axis, found)
    assert error is not None
    assert (error.summary, error.reason, error.node) == (f"n1 is at fault: {said}", reason, 1)
    assert reason in ("let go", "restart")  # what programs look for
    assert canary.why(axis) == said
    assert error.cause.startswith(cause)
    assert "clear_fault('n1')" in error.advice
