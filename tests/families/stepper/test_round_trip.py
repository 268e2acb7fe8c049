"""A program from a file into a controller and back, on a line with the true times of 9600 baud, in virtual time.

What it costs is counted in requests and in time on the line, and compared with what was said beforehand. On a
pseudo-terminal and a real clock the same is done by `tests/cli/stepper/test_round_trip.py`, and measured by
`make bench`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.families.stepper import Controller, wire
from motorbus.families.stepper.driver.writing import Difference, Planned, Written
from motorbus.families.stepper.program import Program
from motorbus.families.stepper.program.backups import Backup
from motorbus.families.stepper.table import Project, Step, with_steps
from motorbus.simulation.named import Simulation

FILE = Path(__file__).resolve().parents[3] / "examples" / "pick_and_place.toml"
BYTE = 10 / 9600
"""s on the line."""
EXCHANGE = (wire.REQUEST_LENGTH + wire.REPLY_LENGTH) * BYTE
DUMP = (wire.REQUEST_LENGTH + wire.DUMP_LENGTH) * BYTE
WITHIN = 0.15
"""Of what a job takes: so much may the cost that is shown beforehand be off."""


class Desk:
    """An open bus with its controller, and what was sent and planned on it."""

    def __init__(self, simulation: Simulation, bus: Bus) -> None:
        self.simulation = simulation
        self.bus = bus
        self.device = Controller(bus)
        self.planned: list[Difference] = []
        bus.report = self._heard
        self._trace = bus.trace.subscribe(limit=100_000)

    def _heard(self, event: object) -> None:
        if isinstance(event, Planned):
            self.planned.append(event.difference)

    def sent(self) -> list[bytes]:
        """The requests since this was last asked."""
        told: list[Data] = [one.data for one in self._trace if one.direction == "tx"]
        return [data for data in told if isinstance(data, bytes)]

    def counted(self) -> tuple[int, int]:
        """How many of them change something, and how many read a project."""
        names = Counter(_name(request) == "read_project" for request in self.sent())
        return names[False], names[True]

    def now(self) -> float:
        """The moment on the line (s)."""
        return self.bus.link.now()


def _name(request: bytes) -> str:
    told = wire.decode_request(request)
    assert told is not None
    return told.command.name


@contextmanager
def desk(**options: Any) -> Iterator[Desk]:
    """A bus opened as a user opens it, its bytes taking their time."""
    with motorbus.simulate("stepper", **options) as simulation:
        simulation.pace = True
        with motorbus.open(simulation.url) as bus:
            yield Desk(simulation, bus)


def program(steps: int = 3) -> Program:
    """Ten steps at most, each another one."""
    rows = tuple(
        Step(distance=1000 * n, start_frequency=100, acceleration=50, speed=60 + n, delay=10 * n)
        for n in range(1, steps + 1)
    )
    base = Project(number=2, microsteps=8, step_angle=180, turn_distance=1600)
    return Program(project=with_steps(base, rows))


def stored(there: Desk, number: int) -> bytes:
    """What the controller has kept of a project."""
    image: bytes = there.simulation[1].store.stored[number]
    return image


def test_from_a_file_into_the_controller_and_back_nothing_differs() -> None:
    wanted = Program.load(str(FILE))
    with desk() as there:
        done = there.device.write_project(wanted, expert=True)
        assert done.saved
        backup = Backup.parse(there.device.backup().text())
        assert backup.project(2) == wanted.project
        assert not there.device.difference(wanted)
        assert not there.device.difference(backup.program(2))
        there.simulation[1].power_cycle()
        assert not there.device.difference(wanted), "it was saved"
        assert backup.image(2) == stored(there, 2)


def test_what_was_cleared_comes_back_from_a_backup() -> None:
    with desk() as there:
        there.device.write_project(program(10), 3)
        backup = there.device.backup()
        for number in (1, 3):
            there.device.clear(number, expert=True)
        there.device.restore(backup)
        assert there.device.backup().dumps == backup.dumps
        there.simulation[1].power_cycle()
        assert there.device.backup().dumps == backup.dumps


def one_field(there: Desk, **switches: object) -> Written:
    """A project with one number other than what is stored is written."""
    there.device.write_project(program())
    edited = program().project.with_step(2, delay=777)
    there.simulation[1].switch(**switches)
    there.planned.clear()
    there.sent()
    return there.device.write_project(replace(program(), project=edited))


def test_one_number_takes_three_commands_and_the_readings_before_and_after() -> None:
    with desk() as there:
        done = one_field(there)
        requests = [_name(request) for request in there.sent()]
        first, last = ["read_project", "read_project"], ["read_project"]
        writes = ["select_project", "set_step_delay"]
        assert requests == [*first, *writes, *last, "save_project", *last]
        assert (done.commands, done.dumps, done.saved) == (3, 4, True)
        assert [str(change) for change in done.changes] == [str(c) for c in there.planned[0].changes]
        assert len(done.changes) == 1
        turns, save = 7 * 0.002, 0.03
        assert done.seconds == pytest.approx(3 * EXCHANGE + 4 * DUMP + turns + save, rel=0.01)


def test_writing_it_once_more_takes_no_command_at_all() -> None:
    with desk() as there:
        one_field(there)
        there.sent()
        edited = replace(program(), project=program().project.with_step(2, delay=777))
        assert there.device.write_project(edited).commands == 0
        assert there.counted() == (0, 2)


@pytest.mark.parametrize("turnaround", [0.0, 0.002, 0.01, 0.05, 0.15])
@pytest.mark.parametrize("save_time", [0.0, 0.03, 0.15])
def test_the_cost_shown_beforehand_is_what_it_takes(turnaround: float, save_time: float) -> None:
    with desk() as there:
        done = one_field(there, turnaround=turnaround, save_time=save_time)
        cost = there.planned[0].cost
        assert (cost.writes, cost.reads) == (done.commands, done.dumps) == (3, 4)
        assert cost.seconds == pytest.approx(done.seconds, rel=WITHIN)


@pytest.mark.parametrize("steps", [1, 5, 10])
@pytest.mark.parametrize("turnaround", [0.0, 0.002, 0.05])
def test_the_cost_of_a_whole_project_is_what_it_takes(steps: int, turnaround: float) -> None:
    with desk(turnaround=turnaround) as there:
        shown = there.device.difference(program(steps))
        there.sent()
        done = there.device.write_project(program(steps))
        assert there.counted() == (done.commands, done.dumps) == (shown.cost.writes, shown.cost.reads)
        assert shown.cost.seconds == pytest.approx(done.seconds, rel=WITHIN)
        assert done.seconds >= done.commands * EXCHANGE + done.dumps * DUMP, "bytes take their time"


def test_the_cost_is_shown_before_the_first_command_leaves() -> None:
    with desk() as there:
        before: list[tuple[int, int]] = []
        there.bus.report = lambda event: (
            before.append(there.counted()) if isinstance(event, Planned) else None
        )
        there.device.write_project(program())
        assert before == [(0, 2)], "two readings, and nothing else"


@pytest.mark.parametrize("turnaround", [0.0, 0.002, 0.03])
def test_a_backup_of_four_projects_takes_the_time_of_its_bytes(turnaround: float) -> None:
    """Each is read twice, for a dump has no checksum: 8 × 237 bytes are 1.975 s."""
    with desk(turnaround=turnaround) as there:
        there.device.write_project(program(10))
        there.sent()
        began = there.now()
        there.device.backup()
        assert there.counted() == (0, 8)
        assert there.now() - began == pytest.approx(8 * DUMP, rel=WITHIN)


def test_another_order_of_bytes_goes_there_and_back_as_well() -> None:
    with desk(dump_order="big") as there:
        there.device.write_project(program(10))
        assert there.device.backup().project(2) == program(10).project
        assert not there.device.difference(program(10))
