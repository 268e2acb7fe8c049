"""The servo as a user holds it: one list of verbs, blocking on `Servo`, awaitable on `AsyncServo`.

There is no verb for torque: these servos have no torque switch, they hold whenever they have power.
"""

from __future__ import annotations

from motorbus.core.verbs import AsyncRunner, Awaiting, Blocking, BlockingRunner, verb
from motorbus.families.kst.driver import (
    configuration,
    feedback,
    identity,
    keeping,
    motion,
    provisioning,
    registers,
)
from motorbus.families.kst.driver.dialect import Dialect, dialect_of
from motorbus.families.kst.driver.node import Node


class ServoVerbs(Node):
    """What can be said to a servo. Values are in rad, A, °C, s and bit/s.

    Making one costs nothing and sends nothing. It is spoken to as its bus is configured; `profile` is for a bus with
    servos of several makers.
    """

    ping = verb(identity.ping)
    identify = verb(identity.identify)
    read = verb(registers.read)
    read_raw = verb(registers.read_raw)
    write = verb(registers.write)
    position = verb(feedback.position)
    telemetry = verb(feedback.telemetry)
    status = verb(feedback.status)
    current = verb(feedback.current)
    temperature = verb(feedback.temperature)
    move = verb(motion.move)
    stop = verb(motion.stop)
    version = verb(identity.version)
    node_id = verb(identity.node_id)
    set_node_id = verb(identity.set_node_id)
    bit_rate = verb(identity.bit_rate)
    set_bit_rate = verb(identity.set_bit_rate)
    save = verb(keeping.save)
    provision = verb(provisioning.provision)
    set_id = verb(provisioning.set_id)
    set_baud = verb(provisioning.set_baud)
    start_reports = verb(configuration.start_reports)
    stop_reports = verb(configuration.stop_reports)
    set_mid_point = verb(configuration.set_mid_point)
    travel_limits = verb(configuration.travel_limits)
    set_travel_limits = verb(configuration.set_travel_limits)
    reversed = verb(configuration.reversed_)
    set_reversed = verb(configuration.set_reversed)


class Servo(ServoVerbs, Blocking):
    """One servo on a blocking bus: `Servo(bus, 0x25).position()`."""

    def __init__(self, bus: BlockingRunner, node: int, *, profile: str = "") -> None:
        ServoVerbs.__init__(self, node, _dialect(bus, profile))
        Blocking.__init__(self, bus)


class AsyncServo(ServoVerbs, Awaiting):
    """One servo on an async bus: `await AsyncServo(bus, 0x25).position()`."""

    def __init__(self, bus: AsyncRunner, node: int, *, profile: str = "") -> None:
        ServoVerbs.__init__(self, node, _dialect(bus, profile))
        Awaiting.__init__(self, bus)


def _dialect(bus: object, profile: str) -> Dialect:
    dialect = dialect_of(getattr(bus, "family", None))
    return dialect.like(profile) if profile else dialect
