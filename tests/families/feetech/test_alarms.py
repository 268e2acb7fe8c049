"""Rows D4 and D5: an alarm is told beside an answer and spoils none; a servo that acknowledges nothing is read back.

Every kind of answer a FEETECH servo gives, with every alarm bit; a stop then visits everyone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.families.feetech import FAMILY, Servo
from motorbus.families.feetech.registers.codes import ALARM_BITS, alarms
from motorbus.link.base import PerfectLine
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus

IDS = (1, 2, 3)

ACKNOWLEDGED_TOO = 1
"""Status return level at which everything is answered; at 0 a PING and a READ are."""


class Rig:
    """A bus, its simulated servos, and a counter that makes every value another one."""

    def __init__(self) -> None:
        simulator = FAMILY.simulator(IDS, "sts3215")
        self.servos: Any = simulator.nodes
        self.link = MemoryLink(simulator, line=PerfectLine())
        self.bus = make_bus(self.link, FAMILY.open())
        self.count = 0

    def put(self, line: PerfectLine) -> None:
        """Another line between host and servos."""
        self.link.line = line

    def stir(self) -> int:
        """Give every servo a position that it has not had lately; returns it."""
        self.count += 1
        raw = 17 + self.count * 7919 % 4000
        for servo in self.servos.values():
            servo.raw_position = raw
        return raw


def goal_time(rig: Rig, servo: Servo) -> float:
    """A value in API units that this servo does not hold."""
    assert servo.table is not None
    row = servo.table["goal_time"]
    rig.count += 1
    return float(row.to_value(rig.count % 500))


def held(rig: Rig, servo: Servo) -> float:
    assert servo.table is not None
    return float(servo.table["goal_time"].to_value(rig.servos[1].memory["goal_time"]))


def write(rig: Rig, servo: Servo) -> None:
    wanted = goal_time(rig, servo)
    servo.write(goal_time=wanted)
    assert held(rig, servo) == wanted


def keep(rig: Rig, servo: Servo) -> None:
    """EEPROM, with its lock."""
    wanted = 40 + rig.count % 20
    rig.count += 1
    servo.write(max_temperature=wanted)
    assert rig.servos[1].memory["max_temperature"] == wanted
    assert rig.servos[1].memory["lock"]


def position(rig: Rig, servo: Servo) -> None:
    raw = rig.stir()
    assert servo.table is not None
    assert servo.table["present_position"].to_raw(servo.position()) == raw


def telemetry(rig: Rig, servo: Servo) -> None:
    assert servo.telemetry().alarm == alarms(rig.servos[1].alarm)


def let_go(rig: Rig, servo: Servo) -> None:
    rig.servos[1].memory["torque_enable"] = 1
    servo.disable_torque()
    assert rig.servos[1].memory["torque_enable"] == 0


ANSWERED: dict[str, Callable[[Rig, Servo], Any]] = {
    "ping": lambda rig, servo: servo.ping(),
    "read": position,
    "telemetry": telemetry,
    "write": write,
    "write that is kept": keep,
    "torque off": let_go,
}


@pytest.mark.parametrize("what", ANSWERED)
def test_d4_alarm_bits_spoil_no_answer_and_are_told(what: str) -> None:
    rig = Rig()
    servo = Servo(rig.bus, 1)
    servo.prepare()
    for bit in ALARM_BITS["sts"]:
        rig.servos[1].alarm = 1 << bit
        ANSWERED[what](rig, servo)
        assert servo.alarm == alarms(1 << bit) != ()
        rig.servos[1].alarm = 0
        ANSWERED[what](rig, servo)
        assert servo.alarm == ()
    again = rig.bus.statistics.of(1).retries
    assert again == (what == "ping"), (
        "with the alarm of the voltage its answer is what an echo of PING would be"
    )


def test_d4_a_stop_visits_all_whatever_they_have_to_say() -> None:
    rig = Rig()
    servos = [Servo(rig.bus, id) for id in IDS]
    for id, servo in zip(IDS, servos, strict=True):
        servo.prepare()
        servo.enable_torque()
        rig.servos[id].alarm = 1 << (id % 6)
    outcome = rig.bus.estop()
    assert sorted(outcome.acknowledged) == list(IDS)
    assert outcome.silent == ()
    rig.bus.reset()
    for id, servo in zip(IDS, servos, strict=True):
        servo.disable_torque()
        assert rig.servos[id].memory["torque_enable"] == 0
        assert servo.alarm != ()
