"""Projects started and waited for: what is refused, what a notice is worth, and what a run then comes to."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

import motorbus
from motorbus.core.steps import ASKED, INTENT, Gather, JournalEntry, catch, gather
from motorbus.errors import LimitExceeded, OutcomeUnknown, RequestError
from motorbus.families.stepper import AsyncController, Behaviour, Controller, driver
from motorbus.families.stepper.driver import Estimated, InputChanged, Outcome, Ran
from motorbus.families.stepper.table import Step
from tests.families.stepper.runs import READ_1, START_1, TURN, B, Running, made

# --- completed ----------------------------------------------------------------------------------------------


def test_a_project_is_read_twice_started_and_waited_for() -> None:
    with Running() as there:
        ran = there.go()
        assert there.sent() == [READ_1, READ_1, START_1]
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(ran.predicted.seconds, abs=0.003)
        assert ran.seconds == pytest.approx(1.685587, abs=0.003)
        assert ran.why == "its notice came 1.684 s after its acknowledgement"
        assert there.events[0] == JournalEntry("run", ASKED, {"node": 1})
        assert len(there.told(Estimated)) == 7
        assert there.owed is False


def test_one_run_after_the_other() -> None:
    with Running() as there:
        assert [there.go().outcome for _ in range(5)] == [Outcome.COMPLETED] * 5
        assert there.starts == 5


def test_at_the_pace_of_the_line() -> None:
    with motorbus.simulate("stepper") as simulation:
        simulation.pace = True
        with motorbus.open(simulation.url) as bus:
            ran = Controller(bus).run(1)
    assert ran.outcome is Outcome.COMPLETED
    assert ran.seconds == pytest.approx(1.685587, abs=0.01)


def test_a_wait_for_an_input_is_waited_for_without_end() -> None:
    with Running(made(TURN, replace(TURN, start_input=1))) as there:
        there.simulator.press(1, True, 100.0)
        ran = there.go(watch=(1,))
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds == pytest.approx(101.2, abs=0.3)
        assert ran.predicted.waits == 1
        (pressed,) = there.told(InputChanged)
        assert pressed[:2] == (1, True)
        assert pressed.at == pytest.approx(100.0, abs=0.05)
        waiting = [one.waiting_for for one in there.told(Estimated)]
        assert (waiting[0], waiting[20], waiting[-1]) == (None, 1, None)


def test_a_report_can_press_the_button_itself() -> None:
    with Running(replace(B, number=2)) as there:
        pressed: list[int] = []

        def operator(event: object) -> None:
            if isinstance(event, Estimated) and event.waiting_for == 1:
                pressed.append(event.step)
                there.simulated.set_input(1, True)
            elif isinstance(event, Estimated):
                there.simulated.set_input(1, False)

        there.bus.report = operator
        ran = there.go(watch=(1,))
        assert ran.outcome is Outcome.COMPLETED
        assert set(pressed) == {2}
        assert ran.seconds is not None
        assert ran.seconds >= ran.predicted.seconds


def test_a_motion_that_an_input_cuts_short_takes_less() -> None:
    with Running(made(replace(TURN, distance=16000, stop_input=2), TURN)) as there:
        there.simulator.press(2, True, 2.0)
        ran = there.go()
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds is not None
        assert ran.seconds < ran.predicted.seconds - 5


def test_one_that_takes_no_time() -> None:
    with Running(made(Step(output=1))) as there:
        ran = there.go()
        assert (ran.outcome, ran.seconds) == (Outcome.COMPLETED, 0.0)


@pytest.mark.parametrize("fault", ["doubled", "late"])
def test_a_notice_that_comes_twice_or_late_is_its_end_and_no_other_ones(fault: str) -> None:
    with Running(notice_fault=fault) as there:
        first, second = there.go(), there.go()
        assert (first.outcome, second.outcome) == (Outcome.COMPLETED, Outcome.COMPLETED)
        late = 0.5 if fault == "late" else 0.0
        assert [first.seconds, second.seconds] == pytest.approx([1.6836 + late] * 2, abs=1e-3)


# --- refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("project", [0, 5, -1, True, "1", 1.0, None, (1,)])
def test_a_project_that_there_is_not_is_refused(project: Any) -> None:
    with Running() as there:
        for verb in (there.device.run, there.device.start_project):
            with pytest.raises(RequestError, match="there is no project"):
                verb(project)
        assert there.sent() == []


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"timeout": 0}, "timeout: "),
        ({"timeout": -3.0}, "timeout: "),
        ({"timeout": float("nan")}, "timeout: "),
        ({"timeout": float("inf")}, "timeout: "),
        ({"timeout": "10"}, "timeout: "),
        ({"timeout": True}, "timeout: "),
        ({"watch": (0,)}, "there is no input 0"),
        ({"watch": (6,)}, "there is no input 6"),
        ({"watch": ("4",)}, "there is no input '4'"),
        ({"watch": 7}, "there is no input 7"),
        ({"how": "usual"}, "is no Behaviour"),
        ({"how": None}, "is no Behaviour"),
        ({"endless": True}, "without a timeout"),
    ],
)
def test_bad_input_sends_nothing_and_is_forgotten(options: dict[str, Any], text: str) -> None:
    with Running() as there:
        with pytest.raises(RequestError, match=text):
            there.go(**options)
        assert (there.sent(), there.owed) == ([], False)
        assert there.go().outcome is Outcome.COMPLETED


def test_a_cleared_project_is_not_started() -> None:
    with Running() as there:
        for start in (there.device.run, there.device.start_project):
            with pytest.raises(RequestError, match="project 3 has no steps"):
                start(3, expert=True)
        assert (there.starts, there.owed) == (0, False)


def test_one_with_errors_is_not_started_unless_an_expert_says_so() -> None:
    with Running(made(replace(TURN, start_frequency=0))) as there:
        with pytest.raises(RequestError, match="L5 error: step 1"):
            there.go()
        assert (there.starts, there.owed) == (0, False)
        assert there.go(expert=True).outcome is Outcome.COMPLETED


def test_what_has_no_geometry_has_no_goal_and_is_not_started() -> None:
    with Running(made(TURN, turn_distance=0)) as there:
        with pytest.raises(RequestError, match="turn_distance"):
            there.go()
        assert (there.starts, there.owed) == (0, False)


def test_the_gate_is_asked_and_what_it_refuses_is_not_owed(monkeypatch: pytest.MonkeyPatch) -> None:
    with Running() as there:

        def refuse(request: object, now: float) -> None:
            raise LimitExceeded("too far")

        monkeypatch.setattr(there.bus.interlock, "check", refuse)
        for start in (there.device.run, there.device.start_project):
            with pytest.raises(LimitExceeded, match="too far"):
                start(1)
        assert (there.starts, there.owed) == (0, False)


@pytest.mark.parametrize("values", [{"project_loop": 255}, {}])
def test_one_that_never_ends_is_not_waited_for_without_a_word(values: dict[str, int]) -> None:
    """An endless loop, or a step of distance 0 where that is without an end."""
    how = Behaviour(zero_distance="endless")
    with Running(made(TURN, Step(speed=60, start_frequency=400, delay=10), **values)) as there:
        for start in (there.device.run, there.device.start_project):
            with pytest.raises(RequestError, match="never ends by itself"):
                start(1, how=how)
        assert (there.starts, there.owed) == (0, False)
        ran = there.go(how=how, endless=True, timeout=20.0)
        assert ran.outcome is (Outcome.TIMEOUT if values else Outcome.COMPLETED)
        assert there.owed is bool(values)


def test_while_one_may_still_run_no_other_is_started() -> None:
    with Running(notice_fault="lost") as there:
        assert there.go().outcome is Outcome.TIMEOUT
        there.sent()
        for start in (there.device.run, there.device.start_project):
            with pytest.raises(RequestError, match="may still run") as raised:
                start(1)
            assert "stop() first" in raised.value.advice
        assert there.sent() == []
        there.device.stop()
        there.simulated.switch(notice_fault="none")
        assert there.go().outcome is Outcome.COMPLETED


def test_of_two_that_are_asked_for_at_once_one_is_started() -> None:
    with Running() as there:
        other = catch(driver.run(there.device, 1))
        both: Gather[Any] = gather(driver.run(there.device, 1), other)
        ran, refused = there.run(both)
        assert ran.outcome is Outcome.COMPLETED
        assert isinstance(refused, RequestError)
        assert "may still run" in refused.summary
        assert (there.starts, there.owed) == (1, False)


def test_an_unfinished_change_of_project_1_refuses_every_run() -> None:
    with motorbus.simulate("stepper") as simulation, motorbus.open(simulation.url) as bus:
        assert bus.journal is not None
        bus.journal(JournalEntry("jog", INTENT, {"node": 1, "image": "00"}))
        sent = bus.statistics.nodes[1].sent
        for start in (Controller(bus).run, Controller(bus).start_project):
            with pytest.raises(RequestError, match="unfinished"):
                start(1)
        assert bus.statistics.nodes[1].sent == sent


# --- started only -------------------------------------------------------------------------------------------


def test_a_start_without_a_wait_gives_the_plan_and_owes_a_notice() -> None:
    with Running(replace(B, number=2)) as there:
        plan = there.device.start_project(2)
        assert (plan.order, plan.passes, plan.name) == ((1, 2, 3, 2, 3), 3, "project 2")
        assert there.simulated.moving
        with pytest.raises(RequestError, match="may still run"):
            there.go()
        assert there.device.start_project(2, stop_first=True) == plan


def test_a_start_whose_acknowledgement_is_lost_is_owed_too() -> None:
    with Running() as there:

        def armed(event: object) -> None:
            if (
                isinstance(event, JournalEntry) and event.state == INTENT
            ):  # nothing but the start is left to say
                there.simulated.switch(reply_fault="lost", fault_every=1)

        there.bus.report = armed
        with pytest.raises(OutcomeUnknown):
            there.device.start_project(1)
        assert there.owed is True


def test_endless_ones_can_be_started_and_stopped() -> None:
    with Running(made(TURN, project_loop=255)) as there:
        there.device.start_project(1, endless=True)
        there.link.advance(100.0)
        assert there.simulated.moving
        there.device.stop()
        assert there.owed is False


# --- the other face -----------------------------------------------------------------------------------------


def test_runs_can_be_awaited_and_stopped_by_another_task() -> None:
    async def course() -> list[Ran]:
        with motorbus.simulate("stepper") as simulation:
            simulation[1].put(2, made(replace(TURN, distance=160_000), number=2))
            seen: list[object] = []
            async with motorbus.open_async(simulation.url, report=seen.append) as bus:
                one = AsyncController(bus)
                first = await one.run(1)
                waiting = asyncio.ensure_future(one.run(2))
                while not isinstance(seen[-1], Estimated) or seen[-1].at < 5.0:
                    await asyncio.sleep(0)
                await one.stop()
                return [first, await waiting]

    first, second = asyncio.run(course())
    assert first.outcome is Outcome.COMPLETED
    assert first.seconds == pytest.approx(1.6836, abs=1e-3)
    assert second.outcome is Outcome.STOPPED


def test_a_task_that_is_cancelled_leaves_it_running() -> None:
    async def course() -> tuple[bool, int]:
        with motorbus.simulate("stepper") as simulation:
            simulation[1].put(1, made(replace(TURN, distance=160_000)))
            seen: list[object] = []
            async with motorbus.open_async(simulation.url, report=seen.append) as bus:
                waiting = asyncio.ensure_future(AsyncController(bus).run(1))
                while not isinstance(seen[-1] if seen else None, Estimated):
                    await asyncio.sleep(0)
                sent = bus.statistics.nodes[1].sent
                waiting.cancel()
                await asyncio.wait([waiting])
                return simulation[1].moving, bus.statistics.nodes[1].sent - sent

    assert asyncio.run(course()) == (True, 0)
