"""The servo as a user holds it: one list of verbs, blocking on `Servo`, awaitable on `AsyncServo`."""

from __future__ import annotations

from motorbus.core.verbs import AsyncRunner, Awaiting, Blocking, BlockingRunner, verb
from motorbus.families.feetech.driver import (
    alarm,
    blocked,
    calibration,
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
    second,
    sharing,
    torque,
    tuning,
    turns,
)
from motorbus.families.feetech.driver.node import Node


class ServoVerbs(Node):
    """What can be said to a servo. Values are in rad, rad/s, rad/s², A, V, °C and fractions.

    Making one costs nothing and sends nothing; the first verb that has to know the servo asks it.
    """

    ping = verb(identity.ping)
    identify = verb(identity.identify)
    prepare = verb(identity.prepare)
    read = verb(registers.read)
    read_raw = verb(registers.read_raw)
    write = verb(registers.write)
    rewrite = verb(registers.rewrite)
    reg_write = verb(registers.reg_write)
    action = verb(registers.action)
    position = verb(feedback.position)
    velocity = verb(feedback.velocity)
    load = verb(feedback.load)
    current = verb(feedback.current)
    voltage = verb(feedback.voltage)
    temperature = verb(feedback.temperature)
    telemetry = verb(feedback.telemetry)
    enable_torque = verb(motion.enable_torque)
    disable_torque = verb(torque.disable_torque)
    move = verb(motion.move)
    stop = verb(motion.stop)
    mode = verb(modes.mode)
    set_mode = verb(modes.set_mode)
    set_velocity = verb(drive.set_velocity)
    set_duty = verb(drive.set_duty)
    set_current = verb(drive.set_current)
    step = verb(drive.step)
    duplicates = verb(sharing.duplicates)
    set_id = verb(renaming.set_id)
    set_baud = verb(rates.set_baud)
    second_id = verb(second.second_id)
    set_second_id = verb(second.set_second_id)
    recover = verb(recovery.recover)
    factory_restore = verb(restoring.factory_restore)
    calibrate = verb(calibration.calibrate)
    zero = verb(calibration.zero)
    clear_turns = verb(turns.clear_turns)
    many_turns = verb(counting.many_turns)
    set_many_turns = verb(counting.set_many_turns)
    torque_limit = verb(tuning.torque_limit)
    set_torque_limit = verb(tuning.set_torque_limit)
    gains = verb(tuning.gains)
    set_gains = verb(tuning.set_gains)
    protection = verb(tuning.protection)
    set_protection = verb(tuning.set_protection)
    recover_overload = verb(overload.recover_overload)
    alarms = verb(alarm.alarms)
    blockers = verb(blocked.blockers)


class Servo(ServoVerbs, Blocking):
    """One servo on a blocking bus: `Servo(bus, 3).position()`."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        ServoVerbs.__init__(self, node)
        Blocking.__init__(self, bus)


class AsyncServo(ServoVerbs, Awaiting):
    """One servo on an async bus: `await AsyncServo(bus, 3).position()`."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        ServoVerbs.__init__(self, node)
        Awaiting.__init__(self, bus)
