"""A project that is started: what is refused, what its end is, and what is unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf, tau
from typing import Any

import pytest

from motorbus.core.steps import Gather, Procedure, Progress, Sleep, gather
from motorbus.errors import Interrupted, LinkError, MotorbusError, OutcomeUnknown, RequestError
from motorbus.families.stepper import InputChanged, Outcome, Ran
from motorbus.families.stepper.driver import io, run
from motorbus.families.stepper.driver import stop as stopping
from motorbus.families.stepper.parameters import Project, Step
from tests.families.stepper.bench import READ_1, STOP_MOTOR, STOP_PROJECT, TURN, Bench, bench, made

START_1 = "FF AA 4E 01 00 00 00 00 00 00 F8"
SWITCH = Step(output=1)
"""A step that takes no time."""


@pytest.fixture
def one() -> Iterator[Bench]:
    with bench(made()) as found:
        yield found


def beside(one: Bench, *others: Procedure[Any], **options: Any) -> Ran:
    """A run of project 1, and other tasks on the same bus."""
    both: Gather[Any] = gather(run.run(one.device, 1, **options), *others)
    found = one.run(both)[0]
    assert isinstance(found, Ran)
    return found


async def later(seconds: float, act: Callable[[], object]) -> None:
    await Sleep(seconds)
    act()


async def stop_later(one: Bench, seconds: float) -> None:
    await Sleep(seconds)
    await stopping.stop(one.device)


def without(*codes: int) -> Callable[[bytes], bytes]:
    """A line that loses the replies, or the notice (EE), with these codes."""
    return lambda data: b"" if (data[0] if len(data) == 2 else data[2]) in codes else data


# -- completed ---------------------------------------------------------------------------------------------------------


def test_notice_completes_it(one: Bench) -> None:
    ran = one.device.run(1)
    assert ran.outcome is Outcome.COMPLETED
    assert ran.seconds == pytest.approx(ran.predicted.seconds, abs=0.01)
    assert one.sent() == [READ_1, READ_1, START_1]
    assert one.journal.unfinished() is None
    assert not one.device.state.may_run
    progress = one.told(Progress)
    assert [event.done for event in progress] == [0, 250, 500, 750, 1000][: len(progress)]
    assert progress[0].total == round(1000 * ran.predicted.seconds)


@pytest.mark.parametrize("project", [made(SWITCH), made(SWITCH, Step(output=8), project_loop=200)])
def test_project_without_time_completes_at_once(project: Project) -> None:
    with bench(project) as one:
        one.device.set_output(1, False)
        assert one.device.run(1).outcome is Outcome.COMPLETED
        assert one.device.last_commanded[1] is None, "its steps switch outputs"


def test_lost_acknowledgement_is_no_matter_if_the_notice_comes(one: Bench) -> None:
    one.line.change = without(0x4E)
    ran = one.device.run(1)
    assert ran.outcome is Outcome.COMPLETED
    assert one.sent().count(START_1) == 1, "a start is never sent twice"
    one.line.change = without(0x4E, 0xEE)
    ran = one.device.run(1)
    assert ran.outcome is Outcome.UNKNOWN
    assert "neither an acknowledgement" in ran.why
    assert one.device.state.may_run


def test_notice_before_the_shortest_time_does_not_count(one: Bench) -> None:
    ran = beside(one, later(0.1, one.simulated.notice))
    assert ran.outcome is Outcome.COMPLETED
    assert ran.seconds == pytest.approx(ran.predicted.seconds, abs=0.01)
    one.line.change = lambda data: data
    one.simulated.notice()
    assert one.device.run(1).seconds == pytest.approx(ran.predicted.seconds, abs=0.01), "a notice from before"


def test_notice_of_a_false_end_only_is_unknown(one: Bench) -> None:
    async def spurious() -> None:
        await Sleep(0.1)
        one.simulated.notice()
        await Sleep(0.1)
        one.line.change = without(0xEE)

    ran = beside(one, spurious())
    assert ran.outcome is Outcome.UNKNOWN
    assert "too early" in ran.why


def test_notice_before_the_acknowledgement_does_not_count() -> None:
    with bench(made(SWITCH), turnaround=0.1) as one:
        notices = iter([True])
        one.line.change = lambda data: data if len(data) != 2 or next(notices, False) else b""
        line: Any = one.simulator
        ran = beside(
            one, later(0.25, lambda: line.send(one.link.now(), b"\xee\xdd"))
        )  # before the acknowledgement
        assert ran.outcome is Outcome.UNKNOWN
        assert "too early" in ran.why


# -- timeout -----------------------------------------------------------------------------------------------------------


def test_no_notice_is_a_timeout_and_refuses_what_follows(one: Bench) -> None:
    one.line.change = without(0xEE)
    begun = one.link.now()
    ran = one.device.run(1)
    assert ran.outcome is Outcome.TIMEOUT
    assert one.link.now() - begun == pytest.approx(ran.predicted.seconds * 1.2 + 2, abs=0.1)
    assert one.journal.unfinished() is not None
    for call in (
        lambda: one.device.run(1),
        lambda: one.device.start_project(1),
        lambda: one.device.jog(tau, 0.1),
        one.device.home,
        lambda: one.device.write(step_1_delay=1.0),
    ):
        with pytest.raises(RequestError, match="may still run"):
            call()
    one.line.change = lambda data: data
    one.device.stop()
    assert one.journal.unfinished() is None
    assert one.device.run(1).outcome is Outcome.COMPLETED


def test_next_host_finds_a_run_in_the_journal(one: Bench) -> None:
    one.device.start_project(1)
    one.device.state.may_run = one.device.state.is_noted = False  # another process
    with pytest.raises(RequestError, match="the run of project 1") as caught:
        one.device.run(1)
    assert "motorbus stop" in caught.value.advice
    one.device.stop()
    one.device.run(1)


def test_timeout_of_the_caller_ends_the_wait(one: Bench) -> None:
    assert one.device.run(1, timeout=0.5).outcome is Outcome.TIMEOUT
    one.device.stop()
    with pytest.raises(RequestError, match="timeout"):
        one.device.run(1, timeout=0)
    with pytest.raises(RequestError, match="needs a timeout"):
        one.device.run(1, endless=True)
    one.simulated.put(1, made(project_loop=255))
    assert one.device.run(1, endless=True, timeout=3.0).outcome is Outcome.TIMEOUT
    one.device.stop()


def test_project_that_waits_for_an_input_has_no_deadline() -> None:
    with bench(
        made(Step(distance=1600, speed=60, start_frequency=400, acceleration=100, start_input=2))
    ) as one:
        ran = beside(one, later(60.0, lambda: one.simulated.set_input(2, True)))
        assert ran.outcome is Outcome.COMPLETED
        assert ran.seconds is not None
        assert ran.seconds > 60


# -- stopped -----------------------------------------------------------------------------------------------------------


def test_stop_of_this_host_is_stopped_and_not_completed(one: Bench) -> None:
    ran = beside(one, stop_later(one, 0.5))
    assert ran.outcome is Outcome.STOPPED
    assert one.simulated.machine.run is None
    assert one.sent()[-2:] == [STOP_PROJECT, STOP_MOTOR]
    assert one.journal.unfinished() is None


def test_notice_after_a_stop_that_is_not_acknowledged_is_stopped(one: Bench) -> None:
    async def stop() -> None:
        await Sleep(0.5)
        one.line.change = without(0x5E, 0x03)
        one.simulated.machine.stop_project = lambda at: None  # type: ignore[method-assign]
        one.simulated.machine.stop_motor = lambda at: None  # type: ignore[method-assign]
        with pytest.raises(OutcomeUnknown):
            await stopping.stop(one.device)

    ran = beside(one, stop())
    assert ran.outcome is Outcome.STOPPED
    assert "a stop that was not acknowledged" in ran.why


def test_stop_before_the_start_leaves_starts_nothing(one: Bench) -> None:
    async def stop() -> None:
        await stop_later(one, 0.001)

    with pytest.raises(Interrupted):
        one.run(gather(run.run(one.device, 1), stop()))
    assert START_1 not in one.sent()
    assert one.journal.unfinished() is None
    assert not one.device.state.may_run


def test_button_on_input_4_is_stopped_if_it_is_watched(one: Bench) -> None:
    ran = beside(one, later(0.5, lambda: one.simulated.set_input(4, True)), watch=(4, 1))
    assert ran.outcome is Outcome.STOPPED
    assert "input 4" in ran.why
    assert [event[:2] for event in one.told(InputChanged)] == [(4, True)]
    assert one.journal.unfinished() is None
    one.device.jog(tau, 0.1)


def test_interrupted_wait_sends_nothing(one: Bench) -> None:
    def interrupt(event: object) -> None:
        if isinstance(event, Progress) and event.done > 400:
            raise KeyboardInterrupt

    one.react = interrupt
    with pytest.raises(KeyboardInterrupt):
        one.device.run(1)
    assert one.sent()[-1] == START_1
    assert one.journal.unfinished() is not None
    one.react = lambda event: None
    one.device.stop()


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("project", "options", "match"),
    [
        (Project(number=1), {}, "has no steps"),
        (made(Step(distance=5, speed=60)), {}, "has errors: L5"),
        (made(project_loop=255), {}, "has no end"),
        (made(), {"watch": (6,)}, "port"),
    ],
)
def test_project_that_should_not_run_is_refused(
    project: Project, options: dict[str, Any], match: str
) -> None:
    with bench(project) as one:
        with pytest.raises(RequestError, match=match):
            one.device.run(1, **options)
        assert set(one.sent()) <= {READ_1}
        assert one.journal.unfinished() is None


def test_expert_and_endless_allow_it() -> None:
    with bench(made(Step(distance=1600, speed=60, delay=10), project_loop=255)) as one:
        assert one.device.start_project(1, endless=True, expert=True).endless
        assert one.simulated.machine.run is not None
        assert one.device.state.may_run


def test_gate_judges_the_farthest_way(one: Bench) -> None:
    forth = Step(distance=1600, speed=60, start_frequency=400, acceleration=100)
    back = Step(distance=400, direction=1, speed=90, start_frequency=400, acceleration=100)
    project = made(forth, back)
    found = run.setpoints(one.device, project)
    ways = [setpoint for setpoint in found if setpoint.quantity == "relative"]
    assert ways[0].value == pytest.approx(tau)
    assert found[-1][:2] == (1, "speed")
    assert found[-1].value == pytest.approx(1.5 * tau)
    assert found[-1][3:5] == (-inf, inf)
    looped = run.setpoints(one.device, made(forth, back, project_loop=4))
    assert looped[0].value >= tau + 3 * 0.75 * tau - 1e-9
    endless = run.setpoints(one.device, made(forth, back, project_loop=255))
    assert endless[0].value > 1000 * tau
    assert [setpoint.quantity for setpoint in endless] == ["relative", "velocity", "speed"]
    home_way = run.setpoints(one.device, made(back))
    assert [setpoint.value for setpoint in home_way[:1]] == [pytest.approx(-tau / 4)]


def test_lost_port_ends_the_wait_and_leaves_it_running(one: Bench) -> None:
    with pytest.raises(LinkError):
        one.run(gather(run.run(one.device, 1, watch=(1,)), later(0.5, one.link.unplug)))
    assert one.simulated.machine.run is not None
    assert one.journal.unfinished() is not None


def test_other_tasks_use_the_bus_meanwhile(one: Bench) -> None:
    async def switch() -> None:
        await Sleep(0.3)
        await io.set_output(one.device, 2, True)

    assert beside(one, switch()).outcome is Outcome.COMPLETED
    assert one.device.last_commanded[2] is True


def test_start_returns_at_the_acknowledgement(one: Bench) -> None:
    begun = one.link.now()
    assert one.device.start_project(1).seconds == pytest.approx(1.2, abs=0.3)
    assert one.link.now() - begun < 0.1
    assert one.simulated.machine.run is not None
    one.device.stop()
    one.line.change = without(0x4E)
    with pytest.raises(MotorbusError):
        one.device.start_project(1)
    assert one.device.state.may_run
    assert TURN in one.simulated.store.working.steps
