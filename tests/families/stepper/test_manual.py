"""Manual motion: how far it goes, what ends it, and what is refused before anything is moved."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf, nan, pi, tau
from typing import Any

import pytest

from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import JournalEntry, Progress, Sleep, gather
from motorbus.errors import (
    Interrupted,
    LimitExceeded,
    MotorbusError,
    NotHomed,
    OutcomeUnknown,
    Refused,
    RequestError,
)
from motorbus.families.stepper import Controller
from motorbus.families.stepper.driver import manual
from motorbus.families.stepper.driver import stop as stopping
from motorbus.families.stepper.driver.manual import PlannedMove, plan_move
from motorbus.families.stepper.execution.machine import Phase
from motorbus.families.stepper.parameters import Project, Step
from tests.families.stepper.bench import STOP_MOTOR, STOP_PROJECT, TURN, Bench, bench, made

ORDER = {
    "jog_forward": "FF AA 03 0A",
    "jog_reverse": "FF AA 03 0B",
    "run_once": "FF AA 03 0C",
    "home": "FF AA 03 0F",
}


@pytest.fixture
def one() -> Iterator[Bench]:
    with bench(made()) as found:
        yield found


def orders(one: Bench) -> list[str]:
    return [frame[:11] for frame in one.sent() if frame[:11] in ORDER.values()]


def as_step(one: Bench, move: Callable[[], object]) -> Project:
    """Project 1 as the controller has it when it moves."""
    found: list[Project] = []
    one.react = lambda event: (
        found.append(one.simulated.store.working)
        if isinstance(event, Progress) and "estimated" in event.what
        else None
    )
    move()
    return found[0]


# -- by an angle, for a time -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [pi, -pi, 20.0, 0.004, -0.1])
def test_move_goes_by_the_angle_in_whole_pulses(one: Bench, angle: float) -> None:
    moved = one.device.move_by(angle, velocity=tau)
    assert moved.angle == pytest.approx(angle, abs=tau / 1600 / 2)
    assert one.simulated.position == round(moved.angle / tau * 1600)
    assert (moved.velocity > 0) is (angle > 0)
    assert one.simulated.machine.phase is Phase.IDLE


def test_turn_without_whole_pulses_is_met() -> None:
    project = made(microsteps=7, step_angle=91)
    with bench(project) as one:
        moved = one.device.move_by(1.0, velocity=tau / 60)
        pulses = float(project.pulses_per_turn or 0)
        assert one.simulated.position == pytest.approx(1.0 / tau * pulses, abs=1)
        assert moved.angle == pytest.approx(one.simulated.position / pulses * tau, abs=1e-3)


@pytest.mark.parametrize("tick", [0.5, 1.0, 10.0])
def test_move_returns_when_its_estimated_time_and_the_margin_have_passed(tick: float) -> None:
    with bench(made(), ramp_tick_ms=tick) as one:
        moved = one.device.jog(2 * tau, 1.0)
        assert one.simulated.position == round(moved.angle / tau * 1600)
        begun = next(at for at, data in one.line.replies if data[2:4] == b"\x03\x0c")
        ended = next(at for at, data in one.line.replies if data[2:4] == b"\x03\x0d")
        motion = one.simulated.store.working.step(1)
        assert motion == TURN, "project 1 is restored"
        assert moved.seconds < ended - begun < moved.seconds + 0.05


def test_move_of_a_controller_with_a_slower_ramp_is_stopped_at_its_estimated_time() -> None:
    with bench(made()) as one:
        one.simulated.machine.tick_ms = 10.0
        moved = one.device.jog(2 * tau, 1.0)
        assert STOP_PROJECT in one.sent()
        one.run(Sleep(1.0))
        assert 0.9 * moved.angle < one.simulated.position / 1600 * tau < moved.angle
        assert one.simulated.machine.phase is Phase.IDLE


def test_velocity_is_in_whole_rpm(one: Bench) -> None:
    shown = as_step(one, lambda: one.device.jog(1.02 * tau, 0.3))
    assert shown.step(1).speed == 61
    assert (shown.total_steps, shown.number) == (1, 1)
    for velocity in (0.0, 0.05, 0.15, 1e9, -1.0):
        with pytest.raises(RequestError, match="velocity"):
            one.device.move_by(1.0, velocity=velocity)
    with pytest.raises(RequestError, match=r"1.432 RPM, and speeds are whole RPM"):
        one.device.move_by(1.0, velocity=0.15)


def test_start_frequency_lies_below_the_running_one(one: Bench) -> None:
    assert as_step(one, lambda: one.device.jog(tau / 60, 0.3)).step(1).start_frequency == 13
    assert as_step(one, lambda: one.device.jog(tau, 0.3)).step(1).start_frequency == 400


@pytest.mark.parametrize(
    "call",
    [
        lambda device: device.move_by(nan),
        lambda device: device.move_by(inf),
        lambda device: device.move_by(1.0, wait=False),
        lambda device: device.move_by(1e-4),
        lambda device: device.move_by(1e9),
        lambda device: device.jog(nan, 1.0),
        lambda device: device.jog(1.0, 0.0),
        lambda device: device.jog(1.0, 61.0),
        lambda device: device.jog_forward(-1.0),
        lambda device: device.jog_reverse(True),
        lambda device: device.home(deadline=0.0),
        lambda device: device.home(deadline=601.0),
        lambda device: device.home(velocity=0.0),
    ],
)
def test_impossible_motion_is_refused_before_anything_is_written(
    one: Bench, call: Callable[[Controller], object]
) -> None:
    with pytest.raises(RequestError):
        call(one.device)
    assert {frame[6:8] for frame in one.sent()} <= {"3E", "00"}


@pytest.mark.parametrize(
    "project",
    [
        Project(number=1),
        made(microsteps=0),
        made(Step(distance=5)),
    ],
)
def test_project_1_without_speed_or_geometry_moves_nothing(project: Project) -> None:
    with bench(project) as one:
        for call in (
            one.device.run_once,
            lambda: one.device.jog_forward(1.0),
            one.device.home,
            lambda: one.device.move_by(1.0),
        ):
            with pytest.raises(RequestError):
                call()
        assert orders(one) == []
    with bench(made(Step(distance=5))) as one:
        assert one.device.move_by(1.0, velocity=tau).angle > 0


def test_run_once_makes_the_move_of_step_1(one: Bench) -> None:
    moved = one.device.run_once()
    assert moved.angle == pytest.approx(tau)
    assert one.simulated.position == 1600
    one.device.write(project=1, step_1_distance=0)
    with pytest.raises(RequestError, match="less than one pulse"):
        one.device.run_once()


@pytest.mark.parametrize(("name", "sign"), [("jog_forward", 1), ("jog_reverse", -1)])
def test_jog_without_end_is_stopped_and_waited_for(one: Bench, name: str, sign: int) -> None:
    moved = getattr(one.device, name)(1.0)
    assert orders(one) == [ORDER[name]]
    assert one.simulated.machine.phase is Phase.IDLE, "it rests when the call returns"
    assert one.simulated.position * sign == pytest.approx(abs(moved.angle) / tau * 1600, rel=0.1)
    getattr(one.device, name)(1.0)
    assert abs(one.simulated.position) > 1.9 * abs(moved.angle) / tau * 1600, "the second was not ignored"


def test_acknowledgement_that_is_lost_stops_the_motor(one: Bench) -> None:
    one.line.change = lambda data: b"" if data[2:4] == b"\x03\x0c" else data
    with pytest.raises(OutcomeUnknown):
        one.device.jog(tau, 1.0)
    sent = [frame for frame in one.sent() if frame.startswith("FF AA 03 0") or frame == STOP_PROJECT]
    start = sent.index("FF AA 03 0C 00 00 00 00 00 00 B8")
    assert sent[start + 1 : start + 3] == [STOP_MOTOR, STOP_PROJECT]
    assert sent.count("FF AA 03 0C 00 00 00 00 00 00 B8") == 1, "a motion is never sent twice"
    assert one.simulated.store.working == made()


class Limits:
    """A gate that refuses each motion, and keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[Setpoint] = []

    def check(self, request: Any, now: float) -> None:
        self.asked += request.setpoints
        raise LimitExceeded("beyond the end of the rail")

    def stopped(self, nodes: Any) -> None:
        """Not asked."""


def test_gate_judges_what_a_motion_asks(one: Bench) -> None:
    one.bus.interlock = gate = Limits()
    calls: dict[Callable[[], object], list[tuple[str, float]]] = {
        lambda: one.device.move_by(-pi, velocity=tau): [("relative", -pi), ("speed", tau)],
        lambda: one.device.jog(tau, 0.5): [("relative", pi), ("speed", tau)],
        one.device.run_once: [("relative", tau), ("speed", tau)],
        lambda: one.device.jog_reverse(1.0): [("velocity", -tau)],
        one.device.home: [("velocity", -tau)],
    }
    for call, asked in calls.items():
        gate.asked.clear()
        with pytest.raises(Refused):
            call()
        assert [setpoint.quantity for setpoint in gate.asked] == [quantity for quantity, _ in asked]
        values = [setpoint.value for setpoint in gate.asked]
        assert values == pytest.approx([value for _, value in asked], rel=1e-3)
    assert orders(one) == []
    assert one.simulated.store.working == made()


# -- stops -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0.001, 0.02, 0.2])
@pytest.mark.parametrize("name", ["jog", "jog_forward", "home"])
def test_stop_of_another_task_ends_it(one: Bench, name: str, after: float) -> None:
    function = getattr(manual, name)
    arguments = {"jog": (tau, 5.0), "jog_forward": (5.0,), "home": ()}[name]
    told: list[MotorbusError] = []

    async def move() -> None:
        try:
            await function(one.device, *arguments)
        except MotorbusError as error:
            told.append(error)

    async def stop() -> None:
        await Sleep(after)
        await stopping.stop(one.device)

    one.run(gather(move(), stop()))
    assert isinstance(told[0], Interrupted)
    assert one.simulated.machine.phase is Phase.IDLE
    assert one.simulated.store.working == made()
    assert one.journal.unfinished() is None
    one.device.jog(tau, 0.2)


def test_stop_is_repeated_until_both_are_acknowledged(one: Bench) -> None:
    lost = iter([True, True])
    one.line.change = lambda data: b"" if data[2:4] == b"\x03\x0d" and next(lost, False) else data
    assert one.device.stop() is stopping.Promise.STOP_ACCEPTED
    assert one.sent() == [STOP_PROJECT, STOP_MOTOR, STOP_MOTOR, STOP_MOTOR]
    one.line.change = lambda data: b""
    with pytest.raises(OutcomeUnknown, match="stop_project and stop_motor not acknowledged"):
        one.device.stop()
    assert one.sent() == [STOP_PROJECT, STOP_MOTOR] * 5


# -- home --------------------------------------------------------------------------------------------------------------

AT_HOME = {"home_switch": "wired", "home_at": -800}


def test_home_ends_at_the_switch_and_counts_from_it() -> None:
    with bench(made(), **AT_HOME) as one:
        homed = one.device.home(deadline=8.0)
        assert homed.velocity == pytest.approx(tau)
        assert homed.seconds == pytest.approx(0.5, abs=0.2)
        assert one.simulated.status()["homed"] is True
        assert one.simulated.position == 0
        with pytest.raises(NotHomed, match="before homing"):
            one.device.home()
        one.device.move_by(tau)
        assert one.device.home(velocity=2 * tau).velocity == pytest.approx(2 * tau)
        assert one.simulated.store.working == made()


@pytest.mark.parametrize("switch", ["never", "free"])
def test_home_is_stopped_at_the_deadline(switch: str) -> None:
    with bench(made(), home_switch=switch) as one:
        with pytest.raises(NotHomed, match="within 1 s"):
            one.device.home(deadline=1.0)
        assert [frame for frame in one.sent() if not frame.startswith("FF AA 00 0B")][-2:] == [
            STOP_MOTOR,
            STOP_PROJECT,
        ]
        assert one.simulated.machine.phase is Phase.IDLE
        assert one.told(Progress)[0].total == 1000


def test_home_stops_if_the_switch_cannot_be_read() -> None:
    with bench(made(), **AT_HOME) as one:
        one.react = lambda event: (
            setattr(one.line, "change", lambda data: b"" if data[2:4] == b"\x00\x0b" else data)
            if isinstance(event, Progress) and event.what == "homing"
            else None
        )
        with pytest.raises(MotorbusError):
            one.device.home()
        assert one.simulated.machine.phase is Phase.IDLE


def test_glitch_of_the_switch_does_not_end_homing() -> None:
    with bench(made(), **AT_HOME) as one:
        glitch = iter([False, False, False, True])
        one.line.change = lambda data: (
            data[:5] + b"\x01" if data[2:4] == b"\x00\x0b" and next(glitch, False) else data
        )
        one.device.home()
        assert one.simulated.status()["homed"] is True


# -- together with others ----------------------------------------------------------------------------------------------


def planned(one: Bench, angle: float, *, velocity: float = tau, acceleration: float = 100.0) -> PlannedMove:
    return one.run(plan_move(one.device, angle, velocity=velocity, acceleration=acceleration))


@pytest.mark.parametrize("needs", [0.0, 2.0, 7.0])
def test_planned_move_lasts_as_long_as_the_others(one: Bench, needs: float) -> None:
    plan = planned(one, -3.0)
    duration = plan.fit(needs)
    assert max(needs, plan.shortest) <= duration < needs * 1.1 + 1
    assert plan.fit(duration) == duration
    assert not one.told(JournalEntry)
    one.run(plan.prepare(duration))
    assert orders(one) == []
    one.run(plan.start)
    begun = one.link.now()
    turning = one.simulated.machine.motion
    assert turning is not None
    assert turning.duration == pytest.approx(duration, rel=1e-6)
    one.run(plan.finish())
    assert duration <= one.link.now() - begun
    assert plan.angle == pytest.approx(-3.0, abs=tau / 3200)
    assert one.simulated.position == round(plan.angle / tau * 1600)
    assert [plan.position(at) for at in (0.0, duration)] == pytest.approx([0.0, plan.angle])
    assert one.simulated.store.working == made()
    one.sent()
    one.run(plan.finish())
    assert one.sent() == []


def test_planned_move_keeps_its_limits(one: Bench) -> None:
    plan = planned(one, 3.0, velocity=1.99 * tau, acceleration=40.0)
    one.run(plan.prepare(plan.shortest))
    step = one.simulated.store.working.step(1)
    assert step.speed == 119
    assert step.acceleration * 1000 <= 40.0 / tau * 1600
    one.run(plan.finish())
    with pytest.raises(RequestError, match="which is 1 RPM"):
        planned(one, 3.0, velocity=0.1)


def test_planned_move_of_less_than_a_pulse_cannot_start(one: Bench) -> None:
    plan = planned(one, 1e-3)
    assert (plan.angle, plan.shortest) == (0.0, 0.0)
    with pytest.raises(RequestError, match="less than one pulse"):
        one.run(plan.prepare(2.0))
    one.run(plan.finish())
    assert one.simulated.store.working == made()


def test_planned_move_that_is_called_off_moves_nothing(one: Bench) -> None:
    plan = planned(one, 3.0)
    one.run(plan.finish())
    assert not one.told(JournalEntry)
    one.run(plan.prepare(2.0))
    with pytest.raises(RequestError, match="unfinished"):
        one.device.jog(tau, 1.0)
    one.device.stop()
    with pytest.raises(Interrupted):
        one.run(plan.start)
    one.run(plan.finish())
    assert orders(one) == []
    assert one.simulated.store.working == made()
    assert one.journal.unfinished() is None


def test_planned_move_that_was_not_prepared_has_nothing_to_give_back(one: Bench) -> None:
    plan = planned(one, 3.0)
    one.device.state.may_run = True
    with pytest.raises(RequestError, match="may still run"):
        one.run(plan.prepare(2.0))
    one.sent()
    one.run(plan.finish())
    assert one.sent() == []
    one.device.stop()
    one.simulated.put(2, replace(made(), number=2))
    one.device.write(project=2, save=False, step_1_delay=1.0)
    plan = planned(one, 3.0)
    with pytest.raises(RequestError, match="not saved"):
        one.run(plan.prepare(2.0))
    one.run(plan.finish())
    assert one.simulated.store.working.number == 2


@pytest.mark.parametrize("is_lost", [True, False])
def test_planned_move_is_stopped_before_project_1_is_given_back(one: Bench, is_lost: bool) -> None:
    """Its start is not acknowledged, or a stop comes midway."""
    plan = planned(one, 30.0)
    one.run(plan.prepare(2.0))
    begun = one.link.now()
    if is_lost:
        one.line.change = lambda data: b"" if data[2:4] == b"\x03\x0c" else data
        with pytest.raises(OutcomeUnknown):
            one.run(plan.start)
        one.run(plan.finish())
    else:
        one.run(plan.start)
        one.run(Sleep(0.5))
        one.device.stop()
        with pytest.raises(Interrupted):
            one.run(plan.finish())
    assert one.link.now() - begun < 4
    assert 0 < one.simulated.position < 30.0 / tau * 1600 / 2
    assert one.simulated.machine.phase is Phase.IDLE
    assert one.simulated.store.working == made()
    assert one.journal.unfinished() is None


def test_planned_move_is_recovered_after_a_crash(one: Bench) -> None:
    plan = planned(one, 30.0)
    one.run(plan.prepare(2.0))
    one.run(plan.start)
    change = one.journal.unfinished()
    assert change is not None
    assert one.device.recover(change.verb, change.facts) == "old"
    assert one.simulated.machine.phase is Phase.IDLE
    assert one.simulated.store.working == made()


def test_a_power_off_between_two_commands_is_no_reason_to_move_farther_than_said(one: Bench) -> None:
    one.device.write(step_1_speed=600 * tau / 60)
    one.device.write(step_1_speed=60 * tau / 60, save=False)
    one.device.jog_forward(0.1)
    one.simulated.power_off()
    one.simulated.power_on()
    started = one.simulated.position
    moved = one.device.jog_forward(1.0)
    turned = (one.simulated.position - started) / 1600 * tau
    assert moved.angle == pytest.approx(turned, rel=0.1)
