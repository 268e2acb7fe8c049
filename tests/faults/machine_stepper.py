"""What is called of a stepper controller under fire, and what can happen on its line.

An acknowledgement repeats no value, so it is held against what the controller has obeyed within the call, beside what
it shows. Each call says something else than the one before it, or an old acknowledgement would pass for a new one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from contextlib import suppress
from random import Random
from types import MappingProxyType
from typing import Any, Final

from motorbus.core.operation import Data, Effect, Exchange
from motorbus.errors import MotorbusError
from motorbus.families.stepper import FAMILY, Controller, wire
from motorbus.families.stepper.driver.reading import dump_once
from motorbus.families.stepper.driver.stopping import STOPS
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.table import ORDERS, Project, Step, with_steps
from tests.faults.machine import Rig, machine
from tests.support.oracle import FalseWord, Outcome, Window

STEPS = (1, 2, 3)
SWEEP: Final = with_steps(
    Project(number=3, microsteps=8, step_angle=180, turn_distance=1600, project_loop=255),
    (Step(distance=800, start_frequency=50, acceleration=30, speed=100, delay=100),),
)
"""A project without an end; nothing here edits it."""
OWN: Final = (1, 2, 4)
"""The projects that are selected and edited."""
JOGS: Final = ("jog_forward", "jog_reverse")
COSTS: Final = {"write": 120, "read a project": 6, "select": 9, "jog": 29, "start": 29, "stop": 20}
"""Exchanges that a verb makes at most, with all that it makes sure of."""
FAULTS: Final = {
    "reply lost": ": drop",
    "reply late": ": delay {late}",
    "reply stalled": ": stall {late}",
    "reply just late": ": delay {just}",
    "late, and the next unheard": ": delay {just};to device: drop",
    "late, and the next but one unheard": ": delay {just};: delay {near};to device: drop",
    "the last try late, and the next unheard": ": drop;: drop;: delay {just};to device: drop",
    "reply copied": ": duplicate",
    "reply held back": ": reorder {near}",
    "reply merged": ": merge",
    "reply cut": "byte {byte}: split {near}",
    "byte changed": "byte {byte}: corrupt {bits}",
    "level changed": "byte 5: corrupt 01",
    "byte lost": "byte {byte}: drop",
    "byte inserted": "byte {byte}: insert {bits}",
    "byte doubled": "byte {byte}: duplicate",
    "reply short": "byte {byte}: truncate",
    "echo": ": echo",
    "some echo": ": echo {byte}",
    "echo, and unheard": ": echo;: echo|to device: drop;: echo|to device: drop",
    "request lost": "to device: drop",
    "two requests lost": "to device: drop;to device: drop",
    "request late": "to device: delay {near}",
    "request copied": "to device: duplicate",
    "request changed": "byte {byte} to device: corrupt {bits}",
    "request short": "byte {byte} to device: truncate",
    "power cycle": ": power-cycle {node}",
    "brown-out": "byte {byte}: brown-out {near} {node}",
    "torn eeprom": ": torn-eeprom {node}",
    "clock step": ": clock-step 3600",
}


class StepperRig(Rig):
    """One controller, which thinks for a while, as real ones do: an old answer may come before the new one."""

    costs = COSTS
    faults = FAULTS
    stores = "write"
    suits = MappingProxyType(
        {
            "echo, and unheard": "stop",
            "reply lost": "jog",
            "request late": "jog",
            "the last try late, and the next unheard": "set an output",
        }
    )
    just = (0.165, 0.23)
    reads = ("ping", "read a project", "inputs")
    plain = ("inputs", "set an output", "set a delay", "select", "stop")
    pulling = (-4, -0.8)
    once = (*JOGS, "run_once", "start_project")

    def __init__(self, pace: bool = True) -> None:
        super().__init__(FAMILY, FAMILY.simulator((1,), turnaround=0.03), 9600, pace=pace)
        self.controller = Controller(self.bus)
        self.there = self.simulator.nodes[1]
        self.obeyed: deque[tuple[float, str, dict[str, int]]] = deque(maxlen=1000)
        self.obey, self.there.obey = self.there.obey, self.note
        self.there.put(SWEEP.number, SWEEP)
        test = FAMILY.echo_test()
        self.bus.expect_echo(test)
        with suppress(MotorbusError):
            self.bus.run(test)
        self.fresh = 1000
        self.verbs = {
            "ping": self.ping,
            "read a project": self.read,
            "inputs": self.inputs,
            "set an output": self.output,
            "set a delay": self.delay,
            "set a distance": self.distance,
            "set a turn": self.turn_distance,
            "select": self.select,
            "write": self.write,
            "jog": self.jog,
            "start": self.start,
            "stop": self.stop,
        }

    def note(self, data: bytes, at: float) -> Any:
        """The controller obeys, and what is noted."""
        request = wire.decode_request(data)
        if request is not None:
            self.obeyed.append((at, request.command.name, dict(request.values)))
        return self.obey(data, at)

    @property
    def troubled(self) -> bool:
        """Or it has still to answer: the copy of a request waits until it has dealt with the first one."""
        return super().troubled or bool(self.simulator.owes)

    def slowest(self) -> Exchange[Any]:
        return dump_once(Controller(self.bus), 1)

    def order(self, said: Data) -> Hashable | None:
        request = wire.decode_request(said) if isinstance(said, bytes) else None
        name = request.command.name if request is not None else ""
        return None if request is None or ORDERS[name].effect is Effect.NONE else name

    def stir(self, random: Random) -> None:
        for port in range(1, 6):
            if random.random() < 0.5:
                self.there.set_input(port, random.random() < 0.5)

    def foreign(self, random: Random) -> Data:
        asked = Random(self.line.exchange).randrange(1, 6)
        return wire.encode_reply(wire.encode("read_input", port=asked % 5 + 1), level=random.randrange(2))

    def overheard(self, random: Random) -> Window:
        """Somebody else's packet comes while an output is set, whose command may be lost."""
        port = random.randrange(1, 4)
        other = wire.encode("set_output", port=port % 3 + 1, level=0)
        self.intrude(random.uniform(0.021, 0.04), random.choice([wire.NOTICE, wire.encode_reply(other)]))
        if not self.line.due and not self.quarantine:
            self.line.extend(f"exchange {self.line.exchange + 1} to device: drop")
        window = self.switched(port)
        self.link.advance(0.05)  # later it might be the very answer that is due then
        return window

    # -- judging ------------------------------------------------------------------------------------------------------

    def heard(self, window: Window, name: str, **values: int) -> int:
        """How often it has obeyed this within a call."""
        return sum(one[1:] == (name, values) for one in self.obeyed if window.since <= one[0] <= window.until)

    def obeys(self, window: Window, name: str, **values: int) -> None:
        """Judge an order: one that was acknowledged was obeyed, and one that was not sent was not."""
        often = self.heard(window, name, **values)
        if window.error is None:
            self.oracle.judged += 1
            if not often:
                raise FalseWord(f"{name} {values} was acknowledged, and never obeyed")
        elif often and window.says in (Outcome.NOT_SENT, Outcome.REJECTED):
            raise FalseWord(f"{name} {values} was said not to be sent, and was obeyed") from window.error

    def ordering(self, call: Callable[[], object], name: str, **values: int) -> Window:
        """Give this order, and no other, by whatever verb; judge it."""
        self.may = lambda _, said: said == wire.encode(name, **values)
        with self.oracle.call(self.bound) as window:
            call()
        self.obeys(window, name, **values)
        return window

    # -- verbs --------------------------------------------------------------------------------------------------------

    def probe(self) -> Window:
        return self.inputs(Random(self.line.exchange))

    def ping(self, random: Random) -> Window:
        there, fired, troubled = None, self.line.count, self.troubled
        with self.oracle.call(self.bound) as window:
            there = self.controller.ping()
        if there is False and not troubled and fired == self.line.count and not self.troubled:
            raise FalseWord("the controller is there, and ping says that it is not")
        return window

    def read(self, random: Random) -> Window:
        project, data = random.randrange(1, 5), b""
        with self.oracle.call(self.bound) as window:
            data = self.controller.dump(project)
        if data:
            self.oracle.told(window, 1, f"image_{project}", data[wire.REPLY_LENGTH :])
        return window

    def inputs(self, random: Random) -> Window:
        ports, levels = random.sample(range(1, 6), random.randrange(1, 3)), dict[int, bool]()
        with self.oracle.call(self.bound) as window:
            levels = self.controller.inputs(ports)
        for number, level in levels.items():
            self.oracle.told(window, 1, f"input_{number}", int(level))
        return window

    def output(self, random: Random) -> Window:
        return self.switched(random.randrange(1, 4))

    def switched(self, port: int) -> Window:
        """Switch an output over."""
        level = int(not self.there.outputs[port - 1])
        window = self.ordering(
            lambda: self.controller.set_output(port, bool(level)), "set_output", port=port, level=level
        )
        if window.error is None:
            self.oracle.told(window, 1, f"output_{port}", level)
        return window

    def new(self) -> int:
        """A value that has not been written lately."""
        self.fresh = 1000 + (self.fresh - 999) % 50_000
        return self.fresh

    def edit(self, row: str, raw: int, call: Callable[[], object], name: str, **values: int) -> Window:
        """Write a value by a command of the manual, and judge that by what is being edited."""
        window = self.ordering(call, name, **values)
        self.oracle.wrote(window, 1, row, raw)
        return window

    def delay(self, random: Random) -> Window:
        step, raw = random.choice(STEPS), self.new()
        call, values = self.controller.set_step_delay, {"step": step, "delay": raw}
        return self.edit(f"step_{step}_delay", raw, lambda: call(step, raw), "set_step_delay", **values)

    def distance(self, random: Random) -> Window:
        step, raw = random.choice(STEPS), self.new()
        call, values = self.controller.set_step_distance, {"step": step, "distance": raw}
        return self.edit(f"step_{step}_distance", raw, lambda: call(step, raw), "set_step_distance", **values)

    def turn_distance(self, random: Random) -> Window:
        raw, call = self.new(), self.controller.set_turn_distance
        return self.edit("turn_distance", raw, lambda: call(raw), "set_turn_distance", turn_distance=raw)

    def select(self, random: Random) -> Window:
        project, steps = random.choice(OWN), random.choice(STEPS)
        window = self.ordering(
            lambda: self.controller.select_project(project, steps),
            "select_project",
            project=project,
            total_steps=steps,
        )
        if window.error is None:
            self.oracle.told(window, 1, "selected", project)
        return window

    def write(self, random: Random) -> Window:
        raw = self.new()
        value = self.controller.value(self.controller.table["step_1_delay"], raw)
        self.may = lambda order, _: ORDERS[str(order)].effect is Effect.PERSISTENT
        with self.oracle.call(self.bound) as window:
            self.controller.write(project=1, step_1_delay=value)
        self.oracle.wrote(window, 1, "step_1_delay", raw)
        return window

    def jog(self, random: Random) -> Window:
        """Turn for a moment, forward or in reverse, from rest: one that slows down still may not heed it."""
        if self.there.moving or self.controller.memory.owed:
            with suppress(MotorbusError):
                self.controller.stop()
        self.link.advance(2.0)
        name = random.choice(JOGS)
        self.may = lambda order, _: order in (name, *STOPS)
        with self.oracle.call(self.bound) as window:
            getattr(self.controller, name)(0.02)
        self.obeys(window, name)
        began = self.history.applied(1, "phase", window.since, window.until).count(phase(Phase.JOG))
        free = {phase(one) for one in (Phase.IDLE, Phase.JOG, Phase.RAMPDOWN)}  # no button has begun anything
        idle = self.history.held(1, "phase", window.since, window.since) == {phase(Phase.IDLE)}
        heeds = idle and self.history.held(1, "phase", window.since, window.until) <= free
        if began > 1 or (window.error is None and heeds and not began):
            raise FalseWord(f"{name}: it began {began} times")
        return window

    def start(self, random: Random) -> Window:
        self.may = lambda order, _: order in ("start_project", *STOPS)
        with self.oracle.call(self.bound) as window:
            self.controller.start_project(SWEEP.number, endless=True, stop_first=True)
        self.obeys(window, "start_project", project=SWEEP.number)
        return window

    def stop(self, random: Random) -> Window:
        self.may = lambda order, _: order in STOPS
        with self.oracle.call(self.bound) as window:
            self.controller.stop()
        for name in STOPS:
            self.obeys(window, name)
        if window.error is None and not self.troubled:
            now = self.history.held(1, "phase", window.until, window.until)
            if not now & {phase(one) for one in (Phase.IDLE, Phase.RAMPDOWN, Phase.OFF)}:
                raise FalseWord(f"it was stopped, and is {self.there.state.phase.value}")
        return window


def phase(which: Phase) -> int:
    """As the history shows it."""
    return [*Phase].index(which)


StepperSteps = machine(StepperRig, list(StepperRig().verbs), list(StepperRig.faults))
