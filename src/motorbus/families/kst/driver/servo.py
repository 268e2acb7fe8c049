"""The servo as a user holds it: one list of verbs, blocking on `Servo`, awaitable on `AsyncServo`.

There is no verb for torque: these servos have no torque switch, they hold whenever they have power.
"""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
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

    ping = device_method(identity.ping)
    identify = device_method(identity.identify)
    read = device_method(registers.read)
    read_raw = device_method(registers.read_raw)
    write = device_method(registers.write)
    position = device_method(feedback.position)
    telemetry = device_method(feedback.telemetry)
    status = device_method(feedback.status)
    current = device_method(feedback.current)
    temperature = device_method(feedback.temperature)
    move = device_method(motion.move)
    stop = device_method(motion.stop)
    version = device_method(identity.version)
    node_id = device_method(identity.node_id)
    set_node_id = device_method(identity.set_node_id)
    bit_rate = device_method(identity.bit_rate)
    set_bit_rate = device_method(identity.set_bit_rate)
    save = device_method(keeping.save)
    provision = device_method(provisioning.provision)
    set_id = device_method(provisioning.set_id)
    set_baud = device_method(provisioning.set_baud)
    start_reports = device_method(configuration.start_reports)
    stop_reports = device_method(configuration.stop_reports)
    set_mid_point = device_method(configuration.set_mid_point)
    travel_limits = device_method(configuration.travel_limits)
    set_travel_limits = device_method(configuration.set_travel_limits)
    reversed = device_method(configuration.reversed_)
    set_reversed = device_method(configuration.set_reversed)


class Servo(ServoVerbs, BlockingDevice):
    """One servo on a blocking bus: `Servo(bus, 0x25).position()`."""

    def __init__(self, bus: BlockingRunner, node: int, *, profile: str = "") -> None:
        ServoVerbs.__init__(self, node, _dialect(bus, profile))
        BlockingDevice.__init__(self, bus)


class AsyncServo(ServoVerbs, AsyncDevice):
    """One servo on an async bus: `await AsyncServo(bus, 0x25).position()`."""

    def __init__(self, bus: AsyncRunner, node: int, *, profile: str = "") -> None:
        ServoVerbs.__init__(self, node, _dialect(bus, profile))
        AsyncDevice.__init__(self, bus)


def _dialect(bus: object, profile: str) -> Dialect:
    dialect = dialect_of(getattr(bus, "family", None))
    return dialect.like(profile) if profile else dialect
