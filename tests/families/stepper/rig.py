"""A simulated stepper controller on a faulty line. Each call is compared with what the controller really did.

An acknowledgement is right when its request reached the controller during this call and the controller is as that
command leaves it; a value is right when the controller has it at that moment. Every call must end in time.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from random import Random
from typing import Any

from motorbus.core.request import Data, Priority, Request
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.driver.io import read_input
from motorbus.families.stepper.driver.node import command, ignore
from motorbus.families.stepper.driver.projects import READINGS, dump, dump_once
from motorbus.families.stepper.execution.machine import Phase
from motorbus.families.stepper.parameters import PARAMETERS, Project
from motorbus.families.stepper.protocol import COMMANDS, REPLY_LENGTH
from motorbus.families.stepper.simulator import simulate
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.support.world import RETRIES, make_bus

BYTE = 10 / 9600
"""s for one byte on the wire."""
PORTS = (1, 2, 3, 4, 5)
ACTIVE = (2, 5)
STOPS = ("stop_project", "stop_motor")
MOTIONS = ("jog_forward", "jog_reverse", "run_once", "home", "start_project")
KEPT = ("save_project", "clear_project")
UNMOVED = (Phase.IDLE, Phase.SLOWING)


class FalseWord(AssertionError):
    """Something was told that is not so."""


class HeardLine(PerfectLine):
    """A line without faults; `heard` are the requests that reached the controller."""

    def __init__(self) -> None:
        self.heard: list[Data] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.heard.append(data)
        return super().carry(sender, data, at)


class Rig:
    """One exchange after the other, each judged; `errors` are those of the last calls that failed."""

    def __init__(self, line: Line, seed: int, *, pace: bool = True, **options: Any) -> None:
        self.simulator = simulate((1,), **options)
        self.line = line
        self.link = MemoryLink(self.simulator, rate=9600, line=line, pace=pace)
        self.bus = make_bus(self.link, FAMILY.open(), report=lambda event: None)
        self.device = Controller(self.bus)
        self.there = self.simulator.controller
        self.random = Random(seed)
        self.errors: list[MotorbusError] = []
        for port in ACTIVE:
            self.there.set_input(port, True)

    def open(self) -> None:
        """Find out about echo, as opening a bus does."""
        test = self.bus.driver.echo_test()
        assert test is not None
        self.bus.expect_echo(test)
        with suppress(MotorbusError):
            self.bus.run(test)

    # -- what is asked ------------------------------------------------------------------------------------------------

    def input(self) -> bool:
        """An input, read until two readings agree; a single reading has one bit that nothing vouches for."""
        port = self.random.choice(PORTS)
        seen: list[bool] = []

        async def agreed() -> Any:
            while len(seen) < 2 or seen[-1] is not seen[-2]:
                seen.append(await read_input(self.device, port))
            return seen[-1]

        done = self._judged("input", agreed(), 4 * _longest(read_input(self.device, port)))
        if done is not None and done is not self._level(port):
            raise FalseWord(f"input {port} was told to be {done}")
        return done is not None

    def _level(self, port: int) -> bool:
        return port in self.there.machine.inputs

    def dump(self) -> bool:
        """A project, as the driver reads it: as it was at some moment of the call, for a power cut may change it."""
        project = self.random.randrange(1, 5)
        true = [self.there.store.image(project)]
        told = self._judged(
            "dump", dump(self.device, project), READINGS * _longest(dump_once(self.device, 1))
        )
        true.append(self.there.store.image(project))
        if told is not None and told[REPLY_LENGTH:] not in true:
            raise FalseWord(f"the dump of project {project} is not what it holds")
        return told is not None

    def edit(self, name: str) -> bool:
        """One of the commands that set parameters, with numbers that are possible."""
        values = self._numbers(name)
        if not self._acknowledged(_command(self.device, name, **values), name):
            return False
        project = self.there.store.working
        step = project.step(values.get("step", 1))
        for field, value in values.items():
            holder = step if "step" in values else project
            held = self.there.store.selected if field == "project" else getattr(holder, field, value)
            if held != value:
                raise FalseWord(f"{name}: {field} was acknowledged as {value} and is {held}")
        return True

    def _numbers(self, name: str) -> dict[str, int]:
        values = {}
        for field in COMMANDS[name].fields:
            row = PARAMETERS[field]
            likely = [raw for raw in row.choices if raw <= row.high] if field.endswith("_input") else None
            values[field] = self.random.choice(likely) if likely else self.random.randint(row.low, row.high)
        if "loop_first" in values:
            values["loop_first"], values["loop_last"] = sorted(self.random.sample(range(1, 11), 2))
        return values

    def output(self) -> bool:
        """Switch one, or all, or the LEDs."""
        port, level = self.random.randrange(1, 6), self.random.randrange(2)
        if not self._acknowledged(
            command(self.device, "set_output", ignore, port=port, level=level), "set_output"
        ):
            return False
        machine = self.there.machine
        outputs = [bool(machine.outputs >> bit & 1) for bit in range(3)]
        told = [machine.leds] if port == 5 else outputs if port == 4 else [outputs[port - 1]]
        if set(told) != {bool(level)}:
            raise FalseWord(f"output {port} was acknowledged as {level} and is not")
        return True

    def stop_by(self, name: str) -> bool:
        """One of the two commands that stop."""
        done = self._acknowledged(command(self.device, name, ignore), name)
        state = self.there.machine
        if done and name != "stop_motor" and state.run is not None and state.phase not in UNMOVED:
            raise FalseWord(f"{name} was acknowledged and project {state.run.project.number} goes on")
        if done and name != "stop_project" and state.phase not in UNMOVED:
            raise FalseWord(f"{name} was acknowledged and it is {state.phase.value}")
        return done

    def device_stop(self) -> Runnable[Any]:
        """The verb, not yet begun."""
        return type(self.device).stop.function(self.device)

    def motion(self, name: str) -> bool:
        """A command that moves the motor, from rest."""
        goals = (Setpoint(1, "velocity", 1.0, -10.0, 10.0),)
        if name == "start_project":
            request = command(self.device, name, ignore, setpoints=goals, project=1)
        else:
            request = command(self.device, name, ignore, setpoints=goals)
        return self._acknowledged(request, name)

    def keep(self, name: str) -> bool:
        """Save or clear, which write what is kept."""
        project = self.random.randrange(1, 5)
        if not self._acknowledged(command(self.device, name, ignore, project=project), name):
            return False
        store = self.there.store
        due = Project() if name == "clear_project" else replace(store.working, number=project)
        if store.stored[project] != due:
            raise FalseWord(f"{name} of project {project} was acknowledged and not done")
        return True

    # -- how it is judged ---------------------------------------------------------------------------------------------

    def _acknowledged(self, request: Request[None], name: str) -> bool:
        """Whether it was acknowledged; FalseWord when it was and the controller has not heard it meanwhile."""
        heard = self.line.heard if isinstance(self.line, HeardLine) else None
        before = len(heard) if heard is not None else 0
        done = self._judged(name, _sent(request), _longest(request))
        if done is not None and heard is not None and request.wire not in heard[before:]:
            raise FalseWord(f"{name} was acknowledged and never heard")
        return done is not None

    def _judged(self, kind: str, operation: Runnable[Any], at_most: float) -> Any:
        """What it gives, None for an error; AssertionError when it takes longer than it may (s)."""
        began = self.link.now()
        value = None
        try:
            value = self.bus.run(operation)
        except MotorbusError as error:
            self.errors.append(error)
            del self.errors[:-20]
        took = self.link.now() - began
        assert took <= at_most, f"{kind} took {took:.2f} s of {at_most:.2f}"
        return value

    @property
    def tried_again(self) -> int:
        """How often the bus has had to say something twice, or to ask whom it may believe."""
        return sum(ledger.retries for ledger in self.bus.statistics.nodes.values())


def _command(device: Controller, name: str, **values: Any) -> Request[None]:
    return command(device, name, ignore, **values)


async def _sent(request: Request[None]) -> Any:
    await request
    return True


def _longest(request: Request[Any]) -> float:
    """s after which this exchange is over whatever the line does: each try with its quiet time and a probe."""
    probe = FAMILY.open().probe(1, 0)
    quiet = FAMILY.open().quiet_time(9600)
    each = [
        FAMILY.open().air_time(one, 9600) + FAMILY.open().turnaround(one) + 0.02 for one in (request, probe)
    ]
    tries = 1 if request.priority is Priority.STOP else RETRIES + 2
    return tries * (sum(each) + 2 * quiet) + quiet
