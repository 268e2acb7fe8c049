"""Edits that are not saved, erased projects, and what an emergency stop leaves."""

from __future__ import annotations

from collections.abc import Iterator
from math import tau
from typing import Any

import pytest

from motorbus.core.steps import Progress
from motorbus.errors import Interrupted, RequestError
from motorbus.families.stepper import Backup, Outcome, Program
from motorbus.families.stepper.parameters import Project, decode_image
from tests.families.stepper.bench import Bench, bench, made

ERASED = decode_image(b"\xff" * 220)


@pytest.fixture
def one() -> Iterator[Bench]:
    with bench(made()) as found:
        yield found


def test_save_project_stores_the_selected_project_only(one: Bench) -> None:
    one.simulated.put(2, made(number=2, stop_mode=1))
    with pytest.raises(RequestError, match="no project was selected here"):
        one.device.save_project(2)
    one.device.select_project(2, 1)
    one.device.set_step_delay(1, 7)
    one.device.save_project(2)
    one.device.jog(tau, 0.1)
    with pytest.raises(RequestError, match="project 1 is selected"):
        one.device.save_project(2)
    one.device.save_project(1)
    one.simulated.power_cycle()
    assert one.simulated.store.stored[1] == made()
    assert one.simulated.store.stored[2] == made(number=2, stop_mode=1).with_step(1, delay=7)


def test_motion_refuses_to_lose_edits_by_commands_of_the_manual(one: Bench) -> None:
    one.simulated.put(2, made(number=2))
    one.device.select_project(2, 1)
    one.device.set_step_delay(1, 7)
    one.sent()
    with pytest.raises(RequestError, match="edits of project 2 that are not saved"):
        one.device.jog(2 * tau, 0.1)
    assert {frame[6:8] for frame in one.sent()} == {"3E"}
    one.device.save_project(2)
    one.device.jog(2 * tau, 0.1)


@pytest.mark.parametrize("number", [1, 2])
def test_erased_project_is_shown_written_and_cleared(one: Bench, number: int) -> None:
    one.simulated.store.stored[number] = ERASED
    one.simulated.power_cycle()
    assert one.device.read_project(number).project.is_cleared
    assert one.device.read_raw("total_steps", project=number) == {"total_steps": 255}
    assert "has no steps" in one.device.backup().text()
    for call in (lambda: one.device.run(number), lambda: one.device.write(project=number, loop_first=0)):
        with pytest.raises(RequestError, match="has no steps"):
            call()
    wanted = made(number=number)
    assert one.device.write_project(Program(project=wanted)).proof == "saved"
    one.simulated.power_cycle()
    assert one.simulated.store.stored[number] == wanted
    one.simulated.store.stored[number] = ERASED
    one.simulated.power_cycle()
    assert one.device.clear(number, expert=True).proof == "saved"
    assert one.simulated.store.stored[number] == Project()


def test_restore_reports_and_writes_steps_beyond_the_last(one: Bench) -> None:
    kept = Backup(dumps={1: one.device.dump(1)})
    one.simulated.put(1, made().with_step(5, delay=9))
    (written,) = one.device.restore(kept)
    assert written.changes == {"step_5_delay": (9, 0)}
    assert one.simulated.store.stored[1] == made()


def test_inputs_3_and_4_are_not_written_by_name(one: Bench) -> None:
    for values in ({"step_1_start_input": 3}, {"step_2_stop_input": 4}):
        wrong: dict[str, Any] = {name: float(value) for name, value in values.items()}
        with pytest.raises(RequestError, match="is not possible") as caught:
            one.device.write(**wrong)
        assert caught.value.cause == "inputs 3 and 4 start and stop projects"
    assert one.sent() == []
    assert one.device.write(step_1_start_input=5).changes == {"step_1_start_input": (0, 5)}


def test_emergency_stop_ends_a_run_for_the_next_motion(one: Bench) -> None:
    def stop(event: object) -> None:
        if isinstance(event, Progress) and event.done > 200:
            one.react = lambda event: None
            one.bus.estop()

    one.react = stop
    with pytest.raises(Interrupted):
        one.device.run(1)
    change = one.journal.unfinished()
    assert change is not None
    assert change.facts["cause"] == "it was started, and its end is not recorded"
    assert not one.device.state.may_run, "the stop was acknowledged"
    one.bus.reset()
    assert one.device.run(1).outcome is Outcome.COMPLETED
    assert one.journal.unfinished() is None
