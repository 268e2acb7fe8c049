"""Who told an axis last has the command over it, and nobody else's goals leave any more."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import pytest

from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import Alone, Answer, Effect, Exchange, Goal, Operation, Pause, Rank, Together
from motorbus.errors import Interrupted, LimitExceeded, MotorbusError, NoReply
from motorbus.motion.command import Command
from motorbus.session.robot import Robot
from tests.motion.machines import machine


def test_the_command_is_lost_with_the_next_order_from_elsewhere() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        both = list(robot.axes.values())
        mine = Command(both)
        mine.depart()
        mine.check()
        assert mine.held() == both
        robot["a1"].enable_torque()
        with pytest.raises(Interrupted, match="a1: the movement was ended by another order"):
            mine.check()
        assert [axis.name for axis in mine.held()] == ["a2"]
        with pytest.raises(Interrupted):
            mine.depart()


def test_two_commands_are_joined_and_each_counts_from_when_it_was_taken() -> None:
    with machine(arm="1-3") as (made, _), Robot.of(made) as robot:
        first, second, third = robot.axes.values()
        nobody = Command(())
        one = nobody.joined(Command([first, second]))
        assert one.lost() is None
        first.stop()
        other = Command([first, third])
        both = one.joined(other)
        assert both.axes == (first, second, third)
        assert both.lost() is None  # `first` was taken anew
        second.hold()
        assert [axis.name for axis in both.held()] == ["a1", "a3"]
        alone = other.joined(nobody)
        assert alone.lost() is None
        first.bus.run(first.able["disable_torque"](first.device))  # past the axis
        assert isinstance(alone.lost(), Interrupted)


def test_a_stop_between_two_commands_that_are_joined_is_not_forgotten() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        first, second = robot.axes.values()
        one = Command([first])
        first.bus.run(first.able["disable_torque"](first.device))  # past the axis
        assert isinstance(one.joined(Command([second])).lost(), Interrupted)


def test_the_rest_of_a_command_is_over_those_that_nobody_told_anything() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        mine = Command(robot.axes.values())
        robot["a1"].stop()
        rest = mine.rest()
        assert rest.axes == (robot["a2"],)
        assert rest.lost() is None
        assert isinstance(mine.lost(), Interrupted)
        robot["a2"].bus.run(robot["a2"].able["disable_torque"](robot["a2"].device))  # past the axis
        assert isinstance(rest.lost(), Interrupted)
        assert rest.rest().axes == ()


@pytest.mark.parametrize("verb", ["stop", "hold", "disable_torque", "enable_torque"])
def test_every_verb_that_tells_an_axis_something_counts(verb: str) -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        getattr(robot["a1"], verb)()
        assert mine.lost() is not None
        later = Command([robot["a1"]])
        robot["a1"].position()
        assert later.lost() is None


def test_a_stop_of_the_bus_counts_and_one_of_another_device_does_not() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        one, other = Command([robot["a1"]]), Command([robot["a2"]])
        robot["a1"].bus.run(robot["a1"].able["disable_torque"](robot["a1"].device))  # past the axis
        assert isinstance(one.lost(), Interrupted)
        assert other.lost() is None
        robot.estop()
        assert isinstance(other.lost(), Interrupted)


def test_a_goal_that_is_guarded_does_not_leave_after_a_stop() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis, bus = robot["a1"], robot["a1"].bus
        axis.enable_torque()
        train = bus.run(axis.able["train"]([axis.device], rate=bus.rate))
        mine = Command([axis])
        (goal,) = train.goals({1: axis.spec.to_device(0.1)})
        guarded = mine.guarded(goal)
        assert (guarded.request, guarded.goals, guarded.effect) == (goal.request, goal.goals, goal.effect)
        bus.run(guarded)
        bus.link.advance(0.001)
        assert sims["arm"][1].memory["goal_position"] == 2048 + 65
        axis.stop()
        (goal,) = train.goals({1: axis.spec.to_device(0.2)})
        with pytest.raises(Interrupted, match="another order"):
            bus.run(mine.guarded(goal))
        assert sims["arm"][1].memory["goal_position"] < 2048 + 66


def test_what_an_exchange_is_refused_for_itself_comes_first_and_its_other_form_is_guarded_too() -> None:
    refused = LimitExceeded("its own reason")

    def own(_: object) -> MotorbusError | None:
        return refused

    def other() -> Exchange[None]:
        return Exchange(b"other", refusal=own)

    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        guarded: Exchange[None] = mine.guarded(Exchange(b"one", other=other))
        assert guarded.other is not None
        again = guarded.other()
        assert guarded.refusal is not None
        assert again.refusal is not None
        assert guarded.refusal(lambda _: 0) is None
        assert again.refusal(lambda _: 0) is refused
        robot["a1"].hold()
        assert isinstance(guarded.refusal(lambda _: 0), Interrupted)


def test_stopping_visits_those_that_are_still_commanded_and_tells_who_did_not_accept() -> None:
    with machine(arm="1-3") as (made, sims), Robot.of(made) as robot:
        mine = Command(robot.axes.values())
        mine.depart()
        robot["a1"].disable_torque()
        sims["arm"][2].unplug()
        errors = robot["a1"].bus.run(mine.stop())
        assert list(errors) == ["a2"]
        assert {name: axis.under_way for name, axis in robot.axes.items()} == {
            "a1": False,
            "a2": True,
            "a3": False,
        }
        assert sims["arm"][1].memory["torque_enable"] == 0  # somebody let it go, and that is respected
        sims["arm"][2].plug()


# -- what is watched ---------------------------------------------------------------------------------------------------


def test_in_what_is_watched_nothing_that_moves_or_gives_torque_leaves_once_the_command_is_lost() -> None:
    def tried(effect: Effect, rank: Rank = Rank.CONTROL) -> Exchange[Answer]:
        return Exchange(b"x", effect=effect, rank=rank)

    exchanges = [
        tried(Effect.TORQUE),
        tried(Effect.MOTION),
        tried(Effect.MOTION, Rank.STOP),
        tried(Effect.NONE),
        tried(Effect.PERSISTENT),
    ]

    def several() -> Operation[str]:
        yield from Pause(0.0)
        for one in exchanges:
            yield from one
        yield from Together(exchanges)
        yield from Alone(exchanges[0])
        return "done"

    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        seen: list[Exchange[Any]] = []
        assert _carried(mine.watched(several()), seen) == "done"
        robot["a1"].hold()
        left = [one.refusal is None or one.refusal(lambda _: 0) is None for one in seen]
        assert left == [False, False, True, True, True] * 2 + [False]


def _carried(steps: Any, seen: list[Exchange[Any]]) -> Any:
    """Go through an operation and note every exchange in it; gives what it returns."""
    try:
        step = next(steps)
        while True:
            if isinstance(step, Exchange):
                seen.append(step)
            elif isinstance(step, Together):
                for one in step.operations:
                    _carried(iter(one), seen)
            elif isinstance(step, Alone):
                _carried(iter(step.operation), seen)
            step = steps.send(None)
    except StopIteration as end:
        return end.value


def test_what_is_watched_gets_its_values_and_its_errors_and_can_clean_up() -> None:
    said: list[object] = []

    def reading(position: Callable[[], Any]) -> Operation[float]:
        try:
            first: float = yield from position()
            said.append(first)
            raise_here: float = yield from position()
            return raise_here
        except MotorbusError as error:
            said.append(type(error))
            raise
        finally:
            said.append("cleaned")

    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        axis = robot["a1"]
        mine = Command([axis])

        def position() -> Any:
            if said:
                sims["arm"][1].unplug()
            return axis.able["position"](axis.device)

        with pytest.raises(NoReply):
            axis.bus.run(mine.watched(reading(position)))
        sims["arm"][1].plug()
        assert said == [pytest.approx(pi, abs=0.001), NoReply, "cleaned"]


def test_a_watched_operation_that_is_given_up_is_closed() -> None:
    said: list[str] = []

    def waiting() -> Operation[None]:
        try:
            yield from Pause(1.0)
        finally:
            said.append("closed")

    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        steps = Command([robot["a1"]]).watched(waiting())
        next(steps)
        steps.close()
        assert said == ["closed"]


def test_a_stop_of_another_device_costs_one_look_and_then_it_is_quick_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        mine = Command([robot["a1"]])
        looked: list[int] = []
        known = robot["a1"].bus.turns.known
        stops = known.stops

        def counted(node: int) -> int:
            looked.append(node)
            return int(stops(node))

        monkeypatch.setattr(known, "stops", counted)
        robot["a2"].bus.run(robot["a2"].able["disable_torque"](robot["a2"].device))
        assert [mine.lost(), mine.lost(), mine.lost()] == [None] * 3
        assert looked == [1]
        robot["a1"].bus.run(robot["a1"].able["disable_torque"](robot["a1"].device))  # past the axis
        assert isinstance(mine.lost(), Interrupted)
        assert isinstance(mine.lost(), Interrupted)


# -- orders of a mould -------------------------------------------------------------------------------------------------


def ordered(why: MotorbusError | None = None) -> tuple[Aim, Aimed]:
    aim = Aim((1,), lambda raws: (Goal(1, "position", float(raws[0]), -9.0, 9.0),), lambda _: why)
    return aim, Aimed(b"\x01", aim, (2,))


def test_an_order_of_a_mould_stays_one_and_does_not_leave_once_the_command_is_lost() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        mine = Command(robot.axes.values())
        aim, order = ordered()
        guarded: Any = mine.guarded(order)
        assert isinstance(guarded, Aimed)
        assert (guarded.request, guarded.goals, guarded.sure) == (order.request, order.goals, True)
        assert guarded.refusal(lambda _: 0) is None
        again: Any = mine.guarded(Aimed(b"\x02", aim, (3,)))
        assert again.aim is guarded.aim  # kept, for a loop asks in each cycle
        robot["a1"].stop()
        assert isinstance(guarded.refusal(lambda _: 0), Interrupted)
        assert isinstance(again.refusal(lambda _: 0), Interrupted)
        assert order.refusal(lambda _: 0) is None


def test_what_its_maker_has_against_an_order_of_a_mould_counts_first() -> None:
    why = NoReply("no")
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        mine = Command(robot.axes.values())
        mine.guarded(ordered()[1])
        guarded: Any = mine.guarded(ordered(why)[1])  # of another mould
        robot["a1"].stop()
        assert guarded.refusal(lambda _: 0) is why


def test_an_order_of_a_mould_is_asked_of_the_command_that_has_it_now() -> None:
    with machine(arm="1-2") as (made, _), Robot.of(made) as robot:
        mine, (_, order) = Command(robot.axes.values()), ordered()
        mine.guarded(order)
        robot["a1"].stop()
        rest: Any = mine.rest().guarded(order)
        joined: Any = mine.joined(Command(robot.axes.values())).guarded(order)
        before: Any = mine.guarded(order)
        assert rest.refusal(lambda _: 0) is None
        assert joined.refusal(lambda _: 0) is None
        assert isinstance(before.refusal(lambda _: 0), Interrupted)
