"""Every exchange that the driver has with KST servos; each judges what it is told.

What is read and what is written is another value each time. Success must mean that it is so; what nobody answers (a
save, a start) has no success but that it was sent, and is judged by what the servo has made of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from motorbus.core.register import changed
from motorbus.core.request import Response
from motorbus.core.steps import Runnable
from motorbus.errors import DeviceError, MotorbusError, NoReply
from motorbus.families.kst import (
    FAMILY,
    Servo,
    broadcast_write,
)
from motorbus.families.kst.driver.requests import read_row, write_row
from motorbus.families.kst.profiles import RATES, SAVE
from motorbus.families.kst.simulator import KstBus
from motorbus.link.base import Line
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus

NODES = (0x25, 0x26, 0x27)
NODE = NODES[0]
MISSING = 0x5FFF
NO_OBJECT, READ_ONLY = 0x0602_0000, 0x0601_0002


class KstRig:
    """A bus, the servos at its end, and a counter that makes every read have another right answer."""

    def __init__(self, profile: str = "kst-ext", **options: Any) -> None:
        simulator = FAMILY.simulator(NODES, profile=profile, **options)
        assert isinstance(simulator, KstBus)
        self.servos = simulator.nodes
        self.link = self.linked(simulator)
        self.family = FAMILY.open(profile=profile)
        self.bus = make_bus(self.link, self.family, report=lambda event: None)
        self.settings = Servo(self.bus, NODE).settings
        self.count = self.here = 0

    def linked(self, simulator: KstBus) -> MemoryLink:
        """A link to them that takes bit time."""
        return MemoryLink(simulator, rate=500_000, pace=True)

    def put(self, line: Line) -> None:
        """Another line between host and servos."""
        self.link.line = line

    def stir(self) -> int:
        """Put every servo where it has not been lately; returns that."""
        self.count += 1
        raw = self.count * 719 % 1400 - 700
        self.here = raw
        for servo in self.servos.values():
            servo.raw_position = raw
        return raw

    def run(self, operation: Runnable[Any]) -> Any:
        """Carry out an operation."""
        return self.bus.run(operation)

    @property
    def servo(self) -> Servo:
        """A servo that nothing is known of yet."""
        return Servo(self.bus, NODE)


class Kind(NamedTuple):
    """An exchange; `sure` where it may be said again, so that it gets over any single fault; `alone` where it is
    for one servo. `profile`, `options`: of the servos that have it."""

    act: Callable[[KstRig], None]
    sure: bool = True
    alone: bool = True
    profile: str = "kst-ext"
    options: dict[str, object] = {}  # noqa: RUF012 - never changed


def ping(rig: KstRig) -> None:
    """Silence is the answer no, which only a fault can bring about."""
    if not rig.servo.ping():
        raise NoReply("nobody is there", node=NODE)


def read_1(rig: KstRig) -> None:
    rig.count += 1
    rig.servos[NODE].values["function_enable"] = rig.count % 32
    assert rig.servo.read_raw("function_enable") == {"function_enable": rig.count % 32}


def read_2(rig: KstRig) -> None:
    raw = rig.stir()
    assert rig.servo.read_raw("present_position") == {"present_position": raw}


def read_4(rig: KstRig) -> None:
    """Current and temperature."""
    rig.count += 1
    rig.servos[NODE].temperature = 20.0 + rig.count % 60
    assert rig.servo.temperature() == 20.0 + rig.count % 60


def refused_read(rig: KstRig) -> None:
    """A refusal is an answer, and never a value."""
    row = changed(rig.servo.table["status"], address=MISSING)
    _refused(rig, read_row(rig.servo, row, int), NO_OBJECT)


def refused_write(rig: KstRig) -> None:
    row = rig.servo.table["present_position"]
    _refused(rig, write_row(rig.servo, row, 0x0201), READ_ONLY)


def _refused(rig: KstRig, operation: Runnable[Any], code: int) -> None:
    told: object = None
    try:
        told = rig.run(operation)
    except DeviceError as refusal:
        told = refusal.code
    assert told == code, "a servo that refuses was understood in another way"


def _written(rig: KstRig, say: Callable[[], object], name: str, new: int) -> None:
    values = rig.servos[NODE].values
    old, others = values[name], [rig.servos[node].values[name] for node in NODES[1:]]
    try:
        say()
    except MotorbusError:
        assert values[name] in (old, new), "it holds what nobody has sent"
        raise
    finally:
        assert others == [rig.servos[node].values[name] for node in NODES[1:]], "somebody else has obeyed"
    assert values[name] == new, "a false success"


def write_1(rig: KstRig) -> None:
    rig.count += 1
    raw = 10 + rig.count % 200
    _written(rig, lambda: rig.servo.write(report_interval=raw / 1000), "report_interval", raw)


def write_2(rig: KstRig) -> None:
    raw = rig.stir() // 2
    row = rig.servo.table["goal_position"]
    _written(rig, lambda: rig.servo.move(float(row.to_value(raw)), wait=False), "goal_position", raw)


def write_4(rig: KstRig) -> None:
    """A mid point, which must not be written again in silence."""
    rig.count += 1
    sim = rig.servos[NODE]
    sim.raw_position = 100 + rig.count % 200
    before = sim.raw_position
    try:
        rig.run(write_row(rig.servo, rig.servo.table["mid_point"], 0))
    except MotorbusError:
        assert sim.raw_position in (0, before)
        raise
    assert sim.raw_position == 0, "a false success"


def set_bit_rate(rig: KstRig) -> None:
    rig.count += 1
    code = rig.count % len(RATES)
    _written(rig, lambda: rig.servo.set_bit_rate(RATES[code]), "bit_rate_code", code)


def save(rig: KstRig) -> None:
    """Nobody answers it: that it was saved shows after a restart only, and nothing says so before."""
    rig.servo.save()
    rig.link.advance(0.5)


def broadcast_move(rig: KstRig) -> None:
    """Who acknowledges has got the target."""
    raw = rig.stir() // 2
    row = rig.servo.table["goal_position"]
    acknowledged = rig.run(broadcast_write("goal_position", row.to_value(raw), rig.settings, nodes=NODES))
    assert all(rig.servos[node].values["goal_position"] == raw for node in acknowledged)


def broadcast_rate(rig: KstRig) -> None:
    rig.count += 1
    code = rig.count % len(RATES)
    acknowledged = rig.run(broadcast_write("bit_rate_code", code, rig.settings))
    assert all(rig.servos[node].values["bit_rate_code"] == code for node in acknowledged)


def broadcast_saving(rig: KstRig) -> None:
    rig.run(broadcast_write("store", SAVE, rig.settings))
    rig.link.advance(0.5)


def stopping(rig: KstRig) -> None:
    """What an emergency stop says to a servo: where are you, and stay there. Success means that this is its target."""
    raw = rig.stir()
    (ask,) = rig.bus.driver.stop({NODE: None}).requests
    answer: Response = rig.run(ask.with_decoder(lambda response: response))
    (hold,) = rig.bus.driver.stop({NODE: answer}).requests
    _written(rig, lambda: rig.run(hold), "goal_position", raw)


KINDS: dict[str, Kind] = {
    "ping": Kind(ping),
    "read 1 byte": Kind(read_1),
    "read 2 bytes": Kind(read_2),
    "read 4 bytes": Kind(read_4),
    "refused read": Kind(refused_read),
    "refused write": Kind(refused_write),
    "write 1 byte": Kind(write_1),
    "write 2 bytes": Kind(write_2),
    "write 4 bytes": Kind(write_4, sure=False),
    "write 1 byte that is kept": Kind(set_bit_rate),
    "save": Kind(save),
    "save that is acknowledged": Kind(save, options={"save_reply": "ack"}),
    "start and move": Kind(write_2, profile="xqpower"),
    "stop": Kind(stopping, sure=False),  # it is said again in the next round of a stop
    "broadcast write": Kind(broadcast_move, alone=False),
    "broadcast of a bit rate": Kind(broadcast_rate, alone=False),
    "broadcast save": Kind(broadcast_saving, alone=False),
}
"""Every exchange there is, by name."""
