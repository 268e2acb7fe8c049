"""The device classes `Servo` and `AsyncServo`.

They have no method for torque: these servos have no torque switch and hold whenever they have power.
"""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.families.kst.driver import access, feedback, identity, motion, provisioning, requests
from motorbus.families.kst.driver.node import DEFAULT, BusSettings, Node


class ServoMethods(Node):
    """The methods of a servo. Values are in rad, A, °C, s and bit/s.

    A servo is the `Node` that driver functions take as first argument; the subclasses add the bus. Creating one sends
    nothing. It has the settings of its bus.

    `set_node_id` and `set_bit_rate` only write. `set_id` and `set_baud`, as in all families, also save, wait for the
    power cycle and verify: they are `provision` with one value.
    """

    _family = "kst"
    ping = device_method(identity.ping)
    identify = device_method(identity.identify)
    version = device_method(identity.version)
    node_id = device_method(identity.node_id)
    set_node_id = device_method(provisioning.set_node_id)
    set_bit_rate = device_method(provisioning.set_bit_rate)
    save = device_method(requests.save)
    provision = device_method(provisioning.provision)
    set_id = device_method(provisioning.set_id)
    set_baud = device_method(provisioning.set_baud)
    read = device_method(access.read)
    read_raw = device_method(access.read_raw)
    write = device_method(access.write)
    position = device_method(feedback.position)
    telemetry = device_method(feedback.telemetry)
    status = device_method(feedback.status)
    current = device_method(feedback.current)
    temperature = device_method(feedback.temperature)
    move = device_method(motion.move)
    stop = device_method(motion.stop)
    set_mid_point = device_method(access.set_mid_point)
    reversed = device_method(access.reversed_)
    set_reversed = device_method(access.set_reversed)


class Servo(ServoMethods, BlockingDevice):
    """One servo on a blocking bus: `Servo(bus, 0x25).position()`."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        ServoMethods.__init__(self, node, settings_of(bus))
        BlockingDevice.__init__(self, bus)


class AsyncServo(ServoMethods, AsyncDevice):
    """One servo on an async bus: `await AsyncServo(bus, 0x25).position()`."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        ServoMethods.__init__(self, node, settings_of(bus))
        AsyncDevice.__init__(self, bus)


def settings_of(bus: object) -> BusSettings:
    """The settings of this bus; those of the manual for anything else."""
    found = getattr(getattr(bus, "driver", None), "settings", None)
    return found if isinstance(found, BusSettings) else DEFAULT
