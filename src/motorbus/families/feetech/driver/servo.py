"""The servo as a user holds it: one list of verbs, blocking on `Servo`, awaitable on `AsyncServo`."""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.families.feetech.driver import (
    alarm,
    blocked,
    calibration,
    capping,
    counting,
    drive,
    feedback,
    identity,
    modes,
    motion,
    overload,
    rates,
    recovery,
    registers,
    renaming,
    restoring,
    torque,
    turns,
)
from motorbus.families.feetech.driver.node import Node


class ServoMethods(Node):
    """The methods of a servo. Values are in rad, rad/s, rad/s², A, V, °C and fractions.

    A servo is the `Node` that driver functions take as first argument; the subclasses add the bus. Creating one sends
    nothing; the first method that needs the register map reads it.
    """

    _family = "feetech"
    ping = device_method(identity.ping)
    identify = device_method(identity.identify)
    prepare = device_method(identity.prepare)
    read = device_method(registers.read)
    read_raw = device_method(registers.read_raw)
    write = device_method(registers.write)
    rewrite = device_method(registers.rewrite)
    reg_write = device_method(registers.reg_write)
    action = device_method(registers.action)
    position = device_method(feedback.position)
    velocity = device_method(feedback.velocity)
    load = device_method(feedback.load)
    current = device_method(feedback.current)
    voltage = device_method(feedback.voltage)
    temperature = device_method(feedback.temperature)
    telemetry = device_method(feedback.telemetry)
    enable_torque = device_method(motion.enable_torque)
    disable_torque = device_method(torque.disable_torque)
    move = device_method(motion.move)
    stop = device_method(motion.stop)
    mode = device_method(modes.mode)
    set_mode = device_method(modes.set_mode)
    set_velocity = device_method(drive.set_velocity)
    set_duty = device_method(drive.set_duty)
    set_current = device_method(drive.set_current)
    step = device_method(drive.step)
    set_id = device_method(renaming.set_id)
    set_baud = device_method(rates.set_baud)
    recover = device_method(recovery.recover)
    factory_restore = device_method(restoring.factory_restore)
    calibrate = device_method(calibration.calibrate)
    zero = device_method(calibration.zero)
    clear_turns = device_method(turns.clear_turns)
    many_turns = device_method(counting.many_turns)
    set_many_turns = device_method(counting.set_many_turns)
    cap_torque = device_method(capping.cap_torque)
    cap_current = device_method(capping.cap_current)
    recover_overload = device_method(overload.recover_overload)
    alarms = device_method(alarm.alarms)
    blockers = device_method(blocked.blockers)


class Servo(ServoMethods, BlockingDevice):
    """One servo on a blocking bus: `Servo(bus, 3).position()`."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        ServoMethods.__init__(self, node)
        BlockingDevice.__init__(self, bus)


class AsyncServo(ServoMethods, AsyncDevice):
    """One servo on an async bus: `await AsyncServo(bus, 3).position()`."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        ServoMethods.__init__(self, node)
        AsyncDevice.__init__(self, bus)
