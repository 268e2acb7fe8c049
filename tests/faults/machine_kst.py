"""What is called of KST servos under fire, and what can happen on their bus.

CAN controllers throw damaged frames away, so a frame comes, or comes late, or twice at once, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, Final

from motorbus.core.operation import CanFrame, Data, Exchange, Operation, Together, outcome
from motorbus.errors import MotorbusError
from motorbus.families.kst import FAMILY, Servo
from motorbus.families.kst.wire import (
    decode_request,
    encode_download_reply,
    encode_report,
    encode_upload_reply,
)
from tests.faults.machine import Rig, machine
from tests.support.oracle import FalseWord, Window

IDS = (0x25, 0x26)
PROFILE = "kst-ext"
RANGE = 250
"""Raw goals are at most so far from the middle; travel limits are further away."""
COSTS: Final = {"write": 30, "set limits": 40, "at once": 9}
"""Exchanges that a verb makes at most, with all that it makes sure of."""
FAULTS: Final = {
    "reply lost": ": drop",
    "reply broken": ": corrupt",
    "reply late": ": delay {late}",
    "reply stalled": ": stall {late}",
    "reply held back": ": reorder {near}",
    "reply merged": ": merge",
    "reply just late": ": delay {just}",
    "late, and the next unheard": ": delay {just};to device: drop",
    "late, and the next but one unheard": ": delay {just};: delay 0.0001;to device: drop",
    "reply copied": ": duplicate",
    "request lost": "to device: drop",
    "request broken": "to device: corrupt",
    "request late": "to device: delay {near}",
    "request copied": "to device: duplicate",
    "power cycle": ": power-cycle {node}",
    "brown-out": ": brown-out {near} {node}",
    "torn eeprom": ": torn-eeprom {node}",
    "clock step": ": clock-step 3600",
}


class KstRig(Rig):
    """Two servos that tell more than the manual says."""

    costs = COSTS
    faults = FAULTS
    stores = "write"
    just = (0.0499, 0.0505)
    reads = ("ping", "position", "read", "telemetry", "at once", "foreign")
    plain = ("position", "move")  # one that is storing something answers nothing for a while

    def __init__(self) -> None:
        family = FAMILY.configured(profile=PROFILE)
        super().__init__(family, FAMILY.simulator(IDS, "", profile=PROFILE), 500_000, pace=True)
        self.servos = {node: Servo(self.bus, node) for node in IDS}
        self.table = self.servos[IDS[0]].table
        self.readable = [row.name for row in self.table.values() if row.readable]
        self.fresh = 0
        for servo in self.servos.values():
            servo.ping()
        self.verbs = {
            "ping": self.ping,
            "position": self.position,
            "read": self.read,
            "telemetry": self.telemetry,
            "write": self.write,
            "set limits": self.set_limits,
            "move": self.move,
            "stop": self.stop,
            "at once": self.at_once,
        }

    def slowest(self) -> Exchange[Any]:
        return self.family.probe(IDS[0], 0)

    def order(self, said: Data) -> str | None:
        assert isinstance(said, CanFrame)
        request = decode_request(said)
        return None if request is None or request.kind != "download" else "download"

    def stir(self, random: Random) -> None:
        for servo in self.simulator.servos:
            if random.random() < 0.7:
                servo.raw_position = random.randrange(-RANGE, RANGE)

    def foreign(self, random: Random) -> Data:
        node, position = random.choice(IDS), self.table["present_position"]
        data = position.encode(random.randrange(-900, 900))
        return random.choice(
            [
                encode_upload_reply(node, position.address, random.randrange(1, 256), data),
                encode_upload_reply(node, position.address + 0x20, position.subindex or 0, data),
                encode_upload_reply(0x51, position.address, position.subindex or 0, data),
                encode_download_reply(node, position.address, position.subindex or 0),
                encode_report(node, random.randrange(-900, 900)),
            ]
        )

    def one(self, random: Random) -> Servo:
        """One of them."""
        return self.servos[random.choice(IDS)]

    def held(self, window: Window, node: int, name: str, value: float) -> None:
        """Judge a value in API units."""
        self.oracle.told(window, node, name, self.servos[node].raw(self.table[name], value))

    # -- verbs --------------------------------------------------------------------------------------------------------

    def probe(self) -> Window:
        return self.position(Random(self.line.exchange))

    def ping(self, random: Random) -> Window:
        servo, there = self.one(random), None
        fired, troubled = self.line.count, self.troubled
        with self.oracle.call(self.bound) as window:
            there = servo.ping()
        if there is False and not troubled and fired == self.line.count and not self.troubled:
            raise FalseWord(f"servo {servo.node} is there, and ping says that it is not")
        return window

    def position(self, random: Random) -> Window:
        servo, value = self.one(random), None
        with self.oracle.call(self.bound) as window:
            value = servo.position()
        if value is not None:
            self.held(window, servo.node, "present_position", value)
        return window

    def read(self, random: Random) -> Window:
        servo, found = self.one(random), dict[str, int]()
        names = random.sample(self.readable, random.randrange(1, 4))
        with self.oracle.call(self.bound) as window:
            found = servo.read_raw(*names)
        for name, raw in found.items():
            self.oracle.told(window, servo.node, name, raw)
        return window

    def telemetry(self, random: Random) -> Window:
        servo, state = self.one(random), None
        with self.oracle.call(self.bound) as window:
            state = servo.telemetry()
        if state is not None and state.position is not None:
            self.held(window, servo.node, "present_position", state.position)
        return window

    def new(self, low: int, high: int) -> int:
        """A value that has not been written lately."""
        self.fresh += 1
        return low + self.fresh * 7 % (high - low)

    def writing(self, servo: Servo, name: str, raw: int, call: Callable[[], object]) -> Window:
        """Write a value by whatever verb, and judge that."""
        with self.oracle.call(self.bound) as window:
            call()
        self.oracle.wrote(window, servo.node, name, raw)
        return window

    def write(self, random: Random) -> Window:
        servo, (name, low) = (
            self.one(random),
            random.choice([("negative_limit", -900), ("positive_limit", 300)]),
        )
        raw = self.new(low, low + 600)
        value = servo.value(self.table[name], raw)
        return self.writing(servo, name, raw, lambda: servo.write(**{name: value}))

    def set_limits(self, random: Random) -> Window:
        servo, low, high = self.one(random), self.new(-900, -300), self.new(300, 900)
        values = [float(servo.value(self.table["present_position"], raw)) for raw in (low, high)]
        with self.oracle.call(self.bound) as window:
            servo.set_travel_limits(*values)
        self.oracle.wrote(window, servo.node, "negative_limit", low)
        self.oracle.wrote(window, servo.node, "positive_limit", high)
        return window

    def move(self, random: Random) -> Window:
        servo, raw = self.one(random), self.new(-RANGE, RANGE)
        value = float(servo.value(self.table["goal_position"], raw))
        return self.writing(servo, "goal_position", raw, lambda: servo.move(value, wait=False))

    def stop(self, random: Random) -> Window:
        servo = self.one(random)
        with self.oracle.call(self.bound) as window:
            servo.stop()
        self.oracle.forget(servo.node, "goal_position")  # it becomes wherever it stands
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


KstSteps = machine(KstRig, list(KstRig().verbs), list(KstRig.faults))
