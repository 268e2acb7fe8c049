"""What is called of FEETECH servos under fire, and what can happen on their wire."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, Final

from motorbus.core.operation import Data, Exchange, Operation, Together, outcome
from motorbus.errors import MotorbusError
from motorbus.families.feetech import FAMILY, Servo, sync_read, wire
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.table import TABLES
from tests.faults.machine import Rig, machine
from tests.support.oracle import FalseWord, Window
from tests.support.world import exclude_echo

IDS = (1, 2, 3)
TABLE = TABLES["sts"]
READABLE = [row.name for row in TABLE.values() if row.readable]
MEASURED = ("position", "velocity", "load", "voltage", "temperature")
LEAST = 20
"""Values to be written begin here: no row ships with one that is as large and as odd."""
COSTS: Final = {"write a setting": 40, "read": 5, "sync read": 9, "at once": 9}
"""Exchanges that a verb makes at most, with all that it makes sure of."""
FAULTS: Final = {
    "reply lost": ": drop",
    "reply late": ": delay {late}",
    "reply just late": ": delay {just}",
    "late, and the next unheard": ": delay {just};to device: drop",
    "late, and the next but one unheard": ": delay {just};: delay 0.0001;to device: drop",
    "reply copied": ": duplicate",
    "reply held back": ": reorder {near}",
    "reply merged": ": merge",
    "reply in bytes": ": split {near}",
    "reply cut": "byte {byte}: split {near}",
    "byte changed": "byte {byte}: corrupt {bits}",
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
    "torn eeprom": ": torn-eeprom {node}",
    "clock step": ": clock-step 3600",
}


class FeetechRig(Rig):
    """Three servos."""

    costs = COSTS
    faults = FAULTS
    stores = "write a setting"
    just = (0.0215, 0.0217)
    reads = ("ping", "read", "telemetry", "sync read", "at once", "foreign", *MEASURED)
    plain = ("position", "write", "move", "load")
    once = ("REG_WRITE", "ACTION")

    def __init__(self) -> None:
        super().__init__(FAMILY, FAMILY.simulator(IDS), 1_000_000, pace=True)
        exclude_echo(self.bus)
        self.servos = {node: Servo(self.bus, node) for node in IDS}
        for servo in self.servos.values():
            servo.prepare()
        self.fresh = LEAST
        self.verbs = {
            "ping": self.ping,
            "read": self.read,
            "telemetry": self.telemetry,
            "write": self.write,
            "write a setting": self.set,
            "hand over": self.hand_over,
            "torque": self.torque,
            "move": self.move,
            "stop": self.stop,
            "sync read": self.sync_read,
            "at once": self.at_once,
        } | {name: self.measuring(name) for name in MEASURED}

    def slowest(self) -> Exchange[Any]:
        return read_block(Servo(self.bus, 1), 0, 90, bytes)

    def order(self, said: Data) -> str | None:
        assert isinstance(said, bytes)
        name = wire.Instruction(said[4]).name
        return None if name in ("PING", "READ", "SYNC_READ") else name

    def one(self, random: Random) -> Servo:
        """One of them."""
        return self.servos[random.choice(IDS)]

    def stir(self, random: Random) -> None:
        for servo in self.simulator.servos:
            if random.random() < 0.7:
                servo.raw_position = random.randrange(4096)

    def foreign(self, random: Random) -> Data:
        return wire.encode_status(random.randrange(10, 250), 0, random.randbytes(random.randrange(4)))

    def told(self) -> str:
        return f"{super().told()}\n# {[(servo.node, servo.alarm) for servo in self.servos.values()]}"

    def held(self, window: Window, node: int, name: str, value: float) -> None:
        """Judge a value in API units."""
        self.oracle.told(window, node, name, self.servos[node].raw(TABLE[name], value))

    # -- verbs --------------------------------------------------------------------------------------------------------

    def probe(self) -> Window:
        return self.measuring("position")(Random(self.line.exchange))

    def ping(self, random: Random) -> Window:
        servo, there = self.one(random), None
        fired, troubled = self.line.count, self.troubled
        with self.oracle.call(self.bound) as window:
            there = servo.ping()
        if there is False and not troubled and fired == self.line.count and not self.troubled:
            raise FalseWord(f"servo {servo.node} is there, and ping says that it is not")
        return window

    def measuring(self, name: str) -> Callable[[Random], Window]:
        """The verb of one measurement."""

        def measure(random: Random) -> Window:
            servo, value = self.one(random), None
            with self.oracle.call(self.bound) as window:
                value = getattr(servo, name)()
            if value is not None:
                self.held(window, servo.node, f"present_{name}", value)
            return window

        return measure

    def telemetry(self, random: Random) -> Window:
        servo, state = self.one(random), None
        with self.oracle.call(self.bound) as window:
            state = servo.telemetry()
        for name in MEASURED if state is not None else ():
            self.held(window, servo.node, f"present_{name}", getattr(state, name))
        if state is not None:
            self.oracle.told(window, servo.node, "moving", int(bool(state.moving)))
        return window

    def read(self, random: Random) -> Window:
        servo, found = self.one(random), dict[str, int]()
        names = random.sample(READABLE, random.randrange(1, 6))
        with self.oracle.call(self.bound) as window:
            found = servo.read_raw(*names)
        for name, raw in found.items():
            self.oracle.told(window, servo.node, name, raw)
        return window

    def value(self, servo: Servo, name: str, low: int, high: int) -> tuple[int, Any]:
        """A value that has not been written lately, raw and in API units."""
        self.fresh += 1
        raw = low + self.fresh * 7 % (high - low)
        held = self.history.nodes[servo.node].memory[name] if servo.node in self.history.nodes else None
        raw += raw == held
        return raw, servo.value(TABLE[name], raw)

    def writing(self, servo: Servo, name: str, raw: int, call: Callable[[], object]) -> Window:
        """Write a value by whatever verb, and judge that."""
        with self.oracle.call(self.bound) as window:
            call()
        self.oracle.wrote(window, servo.node, name, raw)
        return window

    def write(self, random: Random) -> Window:
        servo, (name, high) = self.one(random), random.choice([("acceleration", 250), ("torque_limit", 990)])
        raw, value = self.value(servo, name, LEAST, high)
        return self.writing(servo, name, raw, lambda: servo.write(**{name: value}))

    def set(self, random: Random) -> Window:
        servo, (name, low, high) = (
            self.one(random),
            random.choice([("max_temperature", 50, 100), ("position_p", 20, 250)]),
        )
        raw, value = self.value(servo, name, low, high)
        return self.writing(servo, name, raw, lambda: servo.write(**{name: value}))

    def hand_over(self, random: Random) -> Window:
        """A REG WRITE and its ACTION: neither may be said twice."""
        servo = self.one(random)
        raw, value = self.value(servo, "torque_limit", LEAST, 990)

        def both() -> None:
            servo.reg_write(torque_limit=value)
            servo.action()

        with self.oracle.call(self.bound) as window:
            both()
        if 1000 in self.history.held(servo.node, "torque_limit", window.since, window.until):
            self.oracle.forget(servo.node, "torque_limit")  # without supply it forgets what waits
        else:
            self.oracle.wrote(window, servo.node, "torque_limit", raw)
        return window

    def torque(self, random: Random) -> Window:
        servo, on = self.one(random), random.random() < 0.5
        with self.oracle.call(self.bound) as window:
            servo.enable_torque() if on else servo.disable_torque()
        self.oracle.forget(servo.node, "goal_position")  # torque goes on at rest
        if window.error is None:
            self.oracle.told(window, servo.node, "torque_enable", int(on))
        return window

    def move(self, random: Random) -> Window:
        servo = self.one(random)
        raw, value = self.value(servo, "goal_position", 300, 3800)
        return self.writing(servo, "goal_position", raw, lambda: servo.move(value, wait=False))

    def stop(self, random: Random) -> Window:
        servo = self.one(random)
        with self.oracle.call(self.bound) as window:
            servo.stop()
        self.oracle.forget(servo.node, "goal_position")  # it becomes wherever it stands
        return window

    def sync_read(self, random: Random) -> Window:
        names, result = random.choice([["present_position"], ["present_position", "present_voltage"]]), None
        with self.oracle.call(self.bound) as window:
            result = self.bus.run(sync_read(names, self.servos.values()))
        for node, values in result.values.items() if result is not None else ():
            for name, value in values.items():
                self.held(window, node, name, float(value))
        return window

    def at_once(self, random: Random) -> Window:
        found: list[Any] = []

        def together() -> Operation[list[Any]]:
            asked = [outcome(type(servo).position.function(servo)) for servo in self.servos.values()]
            return (yield from Together(asked))

        with self.oracle.call(self.bound) as window:
            found = self.bus.run(together())
        for node, value in zip(IDS, found, strict=False):
            if not isinstance(value, MotorbusError):
                self.held(window, node, "present_position", value)
        return window


FeetechSteps = machine(FeetechRig, list(FeetechRig().verbs), list(FeetechRig.faults))
