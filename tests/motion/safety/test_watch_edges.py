"""A watch at its edges: the very moment at which one is due, what a lost answer costs, and what is said of whom."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from motorbus.core.family import Health, State
from motorbus.core.operation import Exchange, Operation, Pause, outcome
from motorbus.errors import DeviceError, Faulted, MotorbusError, NoReply, Overloaded, WireError
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.safety import canary
from motorbus.motion.safety.canary import HEALTH, FaultNoted
from motorbus.motion.safety.strain import HOT, SECONDS
from motorbus.motion.safety.watch import SHARE, Watch
from tests.motion.safety.alone import AIR, Alone, fares

SOON = 1e-6
"""s; less than anybody waits for."""
LIMP = fares(torque=False)


def begun(here: Alone, *axes: AxisVerbs) -> Watch:
    """A watch over these: they were given torque from here, and each was asked once at 10 s. The first is next."""
    watch = Watch(here.bus, axes)
    for axis in axes:
        canary.expected(axis)
    here.run(watch.begin(axes))
    return watch


def next_of(watch: Watch, now: float, *slack: float) -> int | None:
    wanted = watch.due(now, *slack)
    return None if wanted is None else wanted.lane


def told(watch: Watch, node: int, now: float, **felt: Any) -> None:
    """It tells that it has its torque, and how it feels."""
    watch.take(node, fares(at=now, **felt), {1: 3.5}, now)


# -- who is watched ----------------------------------------------------------------------------------------------------


def test_each_is_asked_once_when_it_begins_and_has_its_torque_to_lose_from_then_on() -> None:
    here = Alone()
    one, mute = here.axis(1), here.axis(2, "position")
    canary.expected(one)
    canary.expected(mute)
    watch = begun(here, mute, one)
    assert here.asked == [1]
    assert canary.holds(one)
    assert canary.holds(mute)
    assert next_of(watch, 1e9) == 1


def test_nobody_is_due_before_it_begins() -> None:
    here = Alone()
    assert next_of(Watch(here.bus, [here.axis()]), 1e9) is None


def test_one_that_begins_again_is_in_turn_once_and_one_that_is_dismissed_not_at_all() -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = begun(here, one, two)
    here.run(watch.begin([one]))
    turns = []
    for beat in range(1, 5):
        turns.append(next_of(watch, 10.0 + beat))
        told(watch, turns[-1] or 0, 10.0 + beat)
    assert turns == [2, 1, 2, 1]
    watch.dismiss(1)
    watch.dismiss(1)
    assert next_of(watch, 100.0) == 2
    watch.dismiss(2)
    assert next_of(watch, 100.0) is None


def test_what_one_tells_that_is_not_watched_means_nothing() -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = begun(here, one, two)
    watch.dismiss(1)
    watch.take(1, LIMP, {}, 10.0)
    assert (canary.why(one), watch.fault) == ("", None)
    here.run(watch.examine(one))
    assert here.asked == [1, 2]


def test_the_alarms_of_the_last_answer_can_be_had() -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = begun(here, one, two)
    told(watch, 1, 11.0, alarm=("voltage",))
    assert (watch.alarms(one), watch.alarms(two)) == (("voltage",), ())
    told(watch, 1, 12.0)
    assert watch.alarms(one) == ()


def in_flight(operation: Operation[None]) -> Operation[None]:
    """It has asked, and nobody has answered yet."""
    assert isinstance(next(operation), Exchange)
    return operation


def test_who_begins_while_another_is_dismissed_is_due_at_once_also_where_there_is_no_room() -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = Watch(here.bus, [one, two])
    asking = [in_flight(watch.begin([two])), in_flight(watch.begin([one]))]
    watch.dismiss(1)
    assert next_of(watch, 10.0) == 2
    assert next_of(watch, 10.0, 0.0) == 2
    for each in asking:
        each.close()


def test_when_it_was_asked_before_it_was_dismissed_counts_no_more() -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = Watch(here.bus, [one, two])
    here.run(watch.begin([one]))
    watch.dismiss(1)
    asking = [in_flight(watch.begin([one])), in_flight(watch.begin([two]))]
    watch.dismiss(2)
    assert next_of(watch, 10.0 + AIR / SHARE) == 1
    for each in asking:
        each.close()


# -- when one is due ---------------------------------------------------------------------------------------------------


def test_one_is_due_a_quarter_of_a_second_after_it_was_asked_and_not_a_moment_sooner() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    assert [next_of(watch, 10.25 - SOON), next_of(watch, 10.25)] == [None, 1]


def test_the_one_that_was_asked_longest_ago_is_next() -> None:
    here = Alone()
    watch = begun(here, *(here.axis(node) for node in (1, 2, 3)))
    order = []
    for beat in range(1, 7):
        order.append(next_of(watch, 10.0 + beat))
        told(watch, order[-1] or 0, 10.0 + beat)
    assert order[:3] == order[3:]
    assert set(order) == {1, 2, 3}


def test_an_answer_costs_ten_times_what_it_takes_of_the_wire_and_a_lost_one_a_whole_turn() -> None:
    for answer, rest in ((fares(), 0.01), (NoReply("silent"), 0.25)):
        here = Alone()
        watch = begun(here, here.axis(1), here.axis(2))
        watch.take(1, answer, {}, 20.0)
        assert [next_of(watch, 20.0 + rest - SOON), next_of(watch, 20.0 + rest)] == [None, 2]


def test_it_waits_for_room_until_it_is_overdue() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    late = 11.0  # which is four times as late
    assert next_of(watch, late - SOON, AIR - SOON) is None
    assert next_of(watch, 10.0 + HEALTH, AIR) == 1  # there is just room
    assert next_of(watch, 10.0 + HEALTH, 2 * AIR) == 1
    assert [next_of(watch, late - SOON, 0.0), next_of(watch, late, 0.0)] == [None, 1]


def test_one_that_must_be_set_up_before_it_can_tell_lets_the_next_one_go_first() -> None:
    here = Alone()

    def steps(_: int) -> Operation[Health]:
        yield from Pause(0.0)
        return fares()

    one, two = here.axis(1), here.axis(2)
    watch = begun(here, one, two)
    one.able = {**one.able, "health": steps}
    assert next_of(watch, 20.0) is None
    assert next_of(watch, 20.0) == 2  # which is at once, for nothing was asked
    told(watch, 2, 20.0)
    watch.take(1, fares(), {}, 30.0)
    assert next_of(watch, 30.0) == 2  # of what it took nobody knows


# -- what an answer means ----------------------------------------------------------------------------------------------


def test_asking_asks_who_is_due_and_judges_by_the_goals_and_places_that_are_told() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    for beat in range(1, 8):
        here.now = 10.0 + beat * HEALTH
        here.answers[1] = fares(at=here.now, load=0.95)
        here.run(watch.asking(1.0, {1: 3.5}))  # nobody knows where it is
    here.run(watch.asking())
    assert here.asked == [1] * 8
    for beat in range(8, 8 + round(SECONDS / HEALTH) + 1):
        here.now = 10.0 + beat * HEALTH
        here.answers[1] = fares(at=here.now, load=0.95)
        found = here.run(outcome(watch.asking(1.0, {1: 3.5}, {1: 3.0})))
        assert isinstance(found, Overloaded) is (here.now == 12.0 + SECONDS)
    assert here.told == []


def test_the_moment_of_an_answer_is_the_one_at_which_it_came() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    here.now = 10.0 + HEALTH - SOON
    here.run(watch.asking())
    assert here.asked == [1]
    here.now = 11.0
    here.run(watch.asking())
    assert [next_of(watch, 11.0 + HEALTH - SOON), next_of(watch, 11.0 + HEALTH)] == [None, 1]
    here.now = 11.1
    here.run(watch.examine(here.axis()))
    assert [next_of(watch, 11.1 + HEALTH - SOON), next_of(watch, 11.1 + HEALTH)] == [None, 1]


def test_asking_without_room_asks_nobody() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    here.now = 10.5
    here.run(watch.asking(0.0))
    assert here.asked == [1]


def test_whose_turn_it_was_when_it_was_asked_is_whose_answer_it_is() -> None:
    here = Alone()
    axes = [here.axis(node) for node in (1, 2, 3)]
    watch = begun(here, *axes)
    here.now, here.answers[1] = 20.0, LIMP
    with pytest.raises(Faulted) as error:
        here.run(watch.asking())
    assert error.value.node == 1
    assert [bool(canary.why(axis)) for axis in axes] == [True, False, False]


@pytest.mark.parametrize("how", ["asking", "examine", "begin"])
def test_a_fault_is_raised_kept_and_reported_and_who_is_at_fault_is_asked_no_more(how: str) -> None:
    here = Alone()
    one, two = here.axis(1), here.axis(2)
    watch = begun(here, one, two)
    here.now, here.answers[1] = 20.0, LIMP
    asks = {"asking": watch.asking(), "examine": watch.examine(one), "begin": watch.begin([one])}
    with pytest.raises(Faulted) as error:
        here.run(asks[how])
    assert watch.fault is error.value
    assert canary.why(one)
    assert here.told == [FaultNoted("n1", canary.why(one))]
    assert next_of(watch, 100.0) == 2
    watch.dismiss(2)
    assert next_of(watch, 100.0) is None


def test_what_it_was_told_to_keep_is_missed_while_it_is_led() -> None:
    here = Alone()
    watch = begun(here, here.axis())
    with pytest.raises(Faulted, match="restarted"):
        told(watch, 1, 11.0, blank=True)


@pytest.mark.parametrize(
    ("lost", "again"), [(NoReply("silent"), 1), (WireError("garbled"), 1), (DeviceError("it has none"), None)]
)
def test_who_cannot_tell_is_asked_no_more_and_an_answer_that_is_lost_changes_nothing(
    lost: MotorbusError, again: int | None
) -> None:
    here = Alone()
    here.answers[1] = lost
    axis = here.axis()
    watch = begun(here, axis)
    assert (here.asked, here.told, watch.alarms(axis)) == ([1], [], ())
    assert next_of(watch, 100.0) == again


def test_one_that_is_examined_is_asked_before_its_turn_and_keeps_one_turn() -> None:
    here = Alone()
    axes = [here.axis(node) for node in (1, 2)]
    watch = begun(here, *axes)
    here.now = 20.0
    here.run(watch.examine(axes[1]))
    assert here.asked == [1, 2, 2]
    order = []
    for beat in range(1, 5):
        order.append(next_of(watch, 20.0 + beat))
        told(watch, order[-1] or 0, 20.0 + beat)
    assert order == [1, 2, 1, 2]


# -- too much ----------------------------------------------------------------------------------------------------------


def overload(places: Mapping[int, float] | None = None, **felt: Any) -> tuple[Watch, Overloaded]:
    """It pushes for just as long as is too long."""
    here = Alone()
    watch = begun(here, here.axis())
    watch.take(1, Health(State(20.0, **felt)), {1: 3.5}, 20.0, places or {})
    with pytest.raises(Overloaded) as error:
        watch.take(1, Health(State(20.0 + SECONDS, **felt)), {1: 3.5}, 21.0, places or {})
    return watch, error.value


def test_one_that_pushes_too_hard_is_told_so_with_all_that_it_felt_and_is_watched_still() -> None:
    watch, error = overload(
        position=3.0, load=-0.95, current=0.0, temperature=0.0, alarm=("voltage", "angle")
    )
    felt = "load 95%, current 0.00 A, 0 °C; alarms: voltage, angle"
    assert error.summary == f"n1 (arm#1) has pushed too hard for 1.0 s without coming to its goal: {felt}"
    assert (error.reason, error.node) == ("load", 1)
    assert watch.fault is None
    with pytest.raises(Overloaded) as again:  # it has been too much, and is so until somebody has seen to it
        told(watch, 1, 22.0, position=3.5, load=0.0)
    assert again.value.summary.endswith("for 0.0 s without coming to its goal: load 0%")


def test_what_it_does_not_tell_is_not_said() -> None:
    _, error = overload(position=3.0, current=3.25)
    assert error.summary.endswith("goal: current 3.25 A")


def test_its_own_place_counts_before_one_that_was_heard_elsewhere() -> None:
    _, error = overload({1: 3.5}, position=3.0, load=0.95)
    assert error.reason == "load"
    _, error = overload({1: 3.0}, load=0.95)
    assert error.reason == "load"


def test_one_that_is_too_hot_is_told_so() -> None:
    here = Alone()
    watch = begun(here, here.axis(), here.axis(2, guard=False))
    told(watch, 2, 11.0, temperature=HOT)  # which nobody guards
    with pytest.raises(Overloaded) as error:
        told(watch, 1, 11.0, temperature=HOT, load=0.0, current=0.5)
    assert error.value.summary == "n1 (arm#1) is too hot: load 0%, current 0.50 A, 65 °C"
    assert (error.value.reason, error.value.node) == ("heat", 1)
