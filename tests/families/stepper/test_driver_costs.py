"""What reading and writing cost is said beforehand, and is what it takes."""

from __future__ import annotations

from functools import partial

import pytest

from motorbus.errors import NoReply
from motorbus.families.stepper.driver.costs import SAVES, Cost, Tempo, taken
from tests.families.stepper.bench import bench
from tests.families.stepper.vectors import DUMP_A
from tests.families.stepper.written import KINDS, LONGER, PICK, named, program, took

COMMAND, DUMP = 0.0177083, 0.246875
"""s on the wire at 9600 baud, from the number of bits alone: 17 bytes, and 237."""


def test_time_on_the_wire_is_exact() -> None:
    line = Tempo(9600, DUMP)
    assert line.cost(1, 0).seconds == pytest.approx(COMMAND, abs=1e-6)
    assert line.cost(0, 4).seconds == pytest.approx(0.9875, abs=1e-6)
    assert line.cost(79, 0).seconds == pytest.approx(1.399, abs=1e-3)
    assert line.cost(3, 4, saves=1).seconds == pytest.approx(3 * COMMAND + 4 * DUMP + SAVES, abs=1e-5)


@pytest.mark.parametrize("turnaround", [0.0, 0.002, 0.02, 0.1])
def test_the_time_a_controller_thinks_is_measured(turnaround: float) -> None:
    with bench(pace=True, turnaround=turnaround) as there:
        found = there.run(taken(there.device, 1))
        assert (found.image, found.dumps) == (DUMP_A[6:], 2)
        assert found.tempo.rate == 9600
        assert found.tempo.turnaround == pytest.approx(turnaround, abs=1e-4)


def test_a_line_without_pace_is_measured_too() -> None:
    with bench(turnaround=0.001) as there:
        tempo = there.run(taken(there.device, 1)).tempo
        assert tempo.turnaround == 0
        assert tempo.cost(0, 2).seconds == pytest.approx(0.002)


def test_a_dump_that_something_has_held_up_does_not_make_every_command_slow() -> None:
    with bench(pace=True, reply_fault="late", fault_every=2, fault_time=0.1) as there:
        assert there.run(taken(there.device, 1)).tempo.turnaround == pytest.approx(0.002, abs=1e-4)


def test_no_more_than_a_reply_may_take_is_taken_for_thinking() -> None:
    assert Tempo(9600, 3.0).turnaround == 0.2


def test_a_dump_that_came_wrong_once_is_counted() -> None:
    with bench(pace=True, byte_errors=0.002, seed=3) as there:
        assert there.run(taken(there.device, 1)).dumps > 2


def test_silence_costs_an_error() -> None:
    with bench() as there:
        there.simulated.unplug()
        with pytest.raises(NoReply):
            there.run(taken(there.device, 1))


def test_costs_read_like_this() -> None:
    assert str(Cost(3, 4, 1.0846)) == "3 commands and 4 dumps, about 1.1 s"
    assert str(Cost(1, 1, 0.2646)) == "1 command and 1 dump, about 265 ms"


@pytest.mark.parametrize("turnaround", [0.002, 0.02])
@pytest.mark.parametrize("kind", KINDS, ids=named)
@pytest.mark.parametrize("save", [True, False])
def test_what_is_shown_beforehand_is_what_it_takes(
    kind: dict[str, str], turnaround: float, save: bool
) -> None:
    with bench(pace=True, turnaround=turnaround, **kind) as there:
        device = there.device
        device.write_project(program(PICK))
        for meant in (program(PICK, delay=300), program(PICK, delay=9, speed=90), program(LONGER)):
            shown = device.difference(meant, save=save).cost
            there.sent()
            seconds = took(there, partial(device.write_project, meant, save=save))
            frames = there.sent()
            assert seconds == pytest.approx(shown.seconds, rel=0.15)
            assert sum(frame.startswith("FF AA 3E") for frame in frames) == shown.reads
            assert len(frames) == shown.reads + shown.writes
            device.write_project(meant)


@pytest.mark.parametrize("turnaround", [0.002, 0.02])
def test_a_first_write_and_nothing_to_write_are_told_as_well(turnaround: float) -> None:
    with bench(pace=True, turnaround=turnaround) as there:
        for _ in range(2):
            shown = there.device.difference(program(LONGER)).cost
            seconds = took(there, lambda: there.device.write_project(program(LONGER)))
            assert seconds == pytest.approx(shown.seconds, rel=0.15)


@pytest.mark.parametrize("turnaround", [0.0005, 0.002, 0.02])
def test_a_backup_takes_its_line_time(turnaround: float) -> None:
    with bench(pace=True, turnaround=turnaround) as there:
        seconds = took(there, there.device.backup)
        assert seconds == pytest.approx(8 * DUMP, rel=0.15)
