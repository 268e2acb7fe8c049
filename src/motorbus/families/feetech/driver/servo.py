"""One servo with all methods: blocking as `Servo`, async as `AsyncServo`."""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.families.feetech.driver import (
    access,
    address,
    calibration,
    diagnosis,
    feedback,
    identity,
    maintenance,
    modes,
    motion,
)
from motorbus.families.feetech.driver.node import BusFacts, Node


class ServoMethods(Node):
    """The methods of a servo, in rad, rad/s, rad/s², A, V, °C and fractions.

    Creating one sends nothing; the first method that needs the register map reads it.
    """

    _family = "feetech"
    ping = device_method(identity.ping)
    identify = device_method(identity.identify)
    prepare = device_method(identity.identify)
    read = device_method(access.read)
    read_raw = device_method(access.read_raw)
    write = device_method(access.write)
    reg_write = device_method(access.reg_write)
    action = device_method(access.action)
    position = device_method(feedback.position)
    velocity = device_method(feedback.velocity)
    load = device_method(feedback.load)
    current = device_method(feedback.current)
    voltage = device_method(feedback.voltage)
    temperature = device_method(feedback.temperature)
    telemetry = device_method(feedback.telemetry)
    enable_torque = device_method(motion.enable_torque)
    disable_torque = device_method(motion.disable_torque)
    move = device_method(motion.move)
    stop = device_method(motion.stop)
    cap_torque = device_method(motion.cap_torque)
    cap_current = device_method(motion.cap_current)
    mode = device_method(modes.mode)
    set_mode = device_method(modes.set_mode)
    set_velocity = device_method(modes.set_velocity)
    set_duty = device_method(modes.set_duty)
    set_current = device_method(modes.set_current)
    jog = device_method(modes.jog)
    step = device_method(modes.step)
    set_id = device_method(address.set_id)
    set_baud = device_method(address.set_baud)
    recover = device_method(address.recover)
    calibrate = device_method(calibration.calibrate)
    zero = device_method(calibration.zero)
    set_multi_turn = device_method(calibration.set_multi_turn)
    clear_turns = device_method(maintenance.clear_turns)
    factory_restore = device_method(maintenance.factory_restore)
    recover_overload = device_method(maintenance.recover_overload)
    alarms = device_method(diagnosis.alarms)
    why_not_moving = device_method(diagnosis.why_not_moving)


class Servo(ServoMethods, BlockingDevice):
    """One servo on a blocking bus: `Servo(bus, 3).position()`."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        ServoMethods.__init__(self, node, facts_of(bus))
        BlockingDevice.__init__(self, bus)


class AsyncServo(ServoMethods, AsyncDevice):
    """One servo on an async bus: `await AsyncServo(bus, 3).position()`."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        ServoMethods.__init__(self, node, facts_of(bus))
        AsyncDevice.__init__(self, bus)


def facts_of(bus: object) -> BusFacts | None:
    """What is known of the servos of this open bus."""
    facts: BusFacts | None = getattr(getattr(bus, "driver", None), "facts", None)
    return facts
