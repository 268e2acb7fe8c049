"""What is called of a stepper controller under fire, and what can happen on its line.

What is set by a command of the manual is not read back by it, so the row is looked up in the controller itself.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any, Final

from motorbus.core.operation import Data, Exchange
from motorbus.errors import MotorbusError
from motorbus.families.stepper import FAMILY, Controller, wire
from motorbus.families.stepper.driver.reading import dump_once
from tests.faults.machine import Rig, machine
from tests.faults.oracle import FalseWord, Window

STEPS = (1, 2, 3)
COSTS: Final = {"write": 120, "read a project": 6, "select": 9}
"""Exchanges that a verb makes at most, with all that it makes sure of."""
FAULTS: Final = {
    "reply lost": ": drop",
    "reply late": ": delay {late}",
    "reply stalled": ": stall {late}",
    "reply just late": ": delay {just}",
    "late, and the next unheard": ": delay {just};to device: drop",
    "late, and the next but one unheard": ": delay {just};: delay 0.0001;to device: drop",
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
    "request lost": "to device: drop",
    "request late": "to device: delay {near}",
    "request copied": "to device: duplicate",
    "request changed": "byte {byte} to device: corrupt {bits}",
    "request short": "byte {byte} to device: truncate",
    "power cycle": ": power-cycle {node}",
    "brown-out": "byte {byte}: brown-out {near} {node}",
    "clock step": ": clock-step 3600",
}


class StepperRig(Rig):
    """One controller; two of its inputs are active."""

    costs = COSTS
    faults = FAULTS
    just = (0.195, 0.24)

    def __init__(self) -> None:
        super().__init__(FAMILY, FAMILY.simulator((1,)), 9600, pace=True)
        self.controller = Controller(self.bus)
        self.there = self.simulator.nodes[1]
        for port in (2, 5):
            self.there.set_input(port, True)
        test = FAMILY.echo_test()
        self.bus.turns.expect_echo(test)
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
            "stop": self.stop,
        }

    def slowest(self) -> Exchange[Any]:
        return dump_once(Controller(self.bus), 1)

    def stir(self, random: Random) -> None:
        for port in range(1, 6):
            if random.random() < 0.5:
                self.there.set_input(port, random.random() < 0.5)

    def foreign(self, random: Random) -> Data:
        asked = Random(self.line.exchange).randrange(1, 6)  # the port that `probe` is about to read
        other = wire.encode("read_input", port=asked % 5 + 1)
        return random.choice([wire.NOTICE, wire.encode_reply(other, level=random.randrange(2))])

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
        port, levels = random.randrange(1, 6), dict[int, bool]()
        with self.oracle.call(self.bound) as window:
            levels = self.controller.inputs([port])
        for number, level in levels.items():
            self.oracle.told(window, 1, f"input_{number}", int(level))
        return window

    def output(self, random: Random) -> Window:
        port, on = random.randrange(1, 4), random.random() < 0.5
        with self.oracle.call(self.bound) as window:
            self.controller.set_output(port, on)
        if window.error is None:
            self.oracle.told(window, 1, f"output_{port}", int(on))
        return window

    def new(self) -> int:
        """A value that has not been written lately."""
        self.fresh = 1000 + (self.fresh - 999) % 50_000
        return self.fresh

    def writing(self, name: str, raw: int, call: Callable[[], object]) -> Window:
        """Write a value by whatever verb, and judge that."""
        with self.oracle.call(self.bound) as window:
            call()
        self.oracle.wrote(window, 1, name, raw)
        return window

    def delay(self, random: Random) -> Window:
        step, raw = random.choice(STEPS), self.new()
        return self.writing(f"step_{step}_delay", raw, lambda: self.controller.set_step_delay(step, raw))

    def distance(self, random: Random) -> Window:
        step, raw = random.choice(STEPS), self.new()
        return self.writing(
            f"step_{step}_distance", raw, lambda: self.controller.set_step_distance(step, raw)
        )

    def turn_distance(self, random: Random) -> Window:
        raw = self.new()
        return self.writing("turn_distance", raw, lambda: self.controller.set_turn_distance(raw))

    def select(self, random: Random) -> Window:
        project = random.randrange(1, 5)
        with self.oracle.call(self.bound) as window:
            self.controller.select_project(project, 3)
        if window.error is None:
            self.oracle.told(window, 1, "selected", project)
        return window

    def write(self, random: Random) -> Window:
        raw = self.new()
        value = self.controller.value(self.controller.table["step_1_delay"], raw)
        return self.writing("step_1_delay", raw, lambda: self.controller.write(project=1, step_1_delay=value))

    def stop(self, random: Random) -> Window:
        with self.oracle.call(self.bound) as window:
            self.controller.stop()
        return window


StepperSteps = machine(StepperRig, list(StepperRig().verbs), list(StepperRig.faults))
