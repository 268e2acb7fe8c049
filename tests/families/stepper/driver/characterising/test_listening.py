"""One experiment is carried out: every field that it heeds is written, and each moment is told."""

from __future__ import annotations

import pytest

from motorbus.errors import Interrupted, NoReply
from motorbus.families.stepper.driver.characterising.experiments import Act, Motor
from motorbus.families.stepper.driver.characterising.listening import FLAGS, listened, write
from motorbus.families.stepper.driver.exchanges import timed
from motorbus.families.stepper.driver.reading import read_input
from motorbus.families.stepper.driver.turning import Watch
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.table import Project, decode_image
from tests.families.stepper.bench import bench

MOTOR = Motor.of(Project(microsteps=8, step_angle=180))
PAUSE = MOTOR.project(4, MOTOR.step(1, 500))
START = Act(0.0, "start_project")


def test_every_field_is_written_but_for_the_flags_and_what_is_left_out() -> None:
    with bench(select="relabel") as there:
        there.run(write(there.device, PAUSE))
        edited = decode_image(there.simulated.store.working)
        assert edited.steps[0] == PAUSE.steps[0]
        assert (edited.number, edited.total_steps, edited.turn_distance) == (4, 1, PAUSE.turn_distance)
        assert len(there.sent()) == 5 + 7
        there.run(write(there.device, PAUSE, leave="set_step_delay"))
        assert len(there.sent()) == 5 + 6
        assert {"set_stop_mode", "set_mode4", "set_power_on_home"} == set(FLAGS)
        assert not there.simulated.store.stored[4].strip(b"\0")


def test_the_moments_of_answers_and_of_the_notice_are_told() -> None:
    with bench(turnaround=0.01) as there:
        device = there.device
        there.run(write(device, PAUSE))
        acts = (START, Act(0.2, "start_project"))
        heard = there.run(listened(device, Watch(device), PAUSE, acts, 2.0))
        first, second = heard.answered
        assert first is not None
        assert second is not None
        assert second - first == pytest.approx(0.2, abs=0.02)
        assert heard.sent[1] - heard.sent[0] == pytest.approx(0.2, abs=0.02)
        assert [one - first for one in heard.notices] == pytest.approx([0.5], abs=0.02)
        assert (device.memory.owed, device.memory.wanted, device.memory.stops) == (False, 0, 1)


def test_what_is_not_answered_is_told_and_no_error() -> None:
    with bench(busy="silent") as there:
        device = there.device
        there.run(write(device, PAUSE))
        acts = (START, Act(0.1, "start_project"))
        heard = there.run(listened(device, Watch(device), PAUSE, acts, 2.0))
        assert heard.answered[0] is not None
        assert heard.answered[1] is None
        assert len(heard.notices) == 1


def test_it_does_not_listen_longer_than_it_was_told_and_stops_in_the_end() -> None:
    endless = MOTOR.project(4, MOTOR.step(0, 100, rpm=1))
    with bench(zero_distance="endless") as there:
        device = there.device
        there.run(write(device, endless))
        began = there.link.now()
        heard = there.run(listened(device, Watch(device), endless, (START,), 1.5))
        assert heard.notices == ()
        assert there.link.now() - began == pytest.approx(1.6, abs=0.15)
        assert there.simulated.state.phase is Phase.IDLE


def test_a_single_move_is_one_of_the_commands() -> None:
    move = MOTOR.project(1, MOTOR.step(8, 0, rpm=1, reverse=True))
    with bench(notice_on_once=True) as there:
        device = there.device
        there.run(write(device, move))
        heard = there.run(listened(device, Watch(device), move, (Act(0.0, "run_once"),), 2.0))
        assert heard.answered[0] is not None
        assert [one - heard.answered[0] for one in heard.notices] == pytest.approx([0.3], abs=0.02)
        assert there.simulated.position == -8


def test_a_stop_of_somebody_else_ends_it_before_anything_moves() -> None:
    with bench() as there:
        device = there.device
        there.run(write(device, PAUSE))
        watch = Watch(device)
        device.stop()
        there.sent()
        with pytest.raises(Interrupted):
            there.run(listened(device, watch, PAUSE, (START,), 1.0))
        assert not [one for one in there.sent() if one.startswith("FF AA 4E")]


def test_a_timed_exchange_is_judged_as_before_and_gives_its_moment() -> None:
    with bench() as there:
        there.device.ping()
        began = there.link.now()
        assert began <= there.run(timed(read_input(there.device, 2))) <= there.link.now()
        there.simulated.unplug()
        with pytest.raises(NoReply):
            there.run(timed(read_input(there.device, 2)))
