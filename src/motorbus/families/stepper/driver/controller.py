"""The controller as a user holds it: one list of verbs, blocking on `Controller`, awaitable on `AsyncController`.

A controller without status, position and checksum makes each of them promise less than its name: what is written is
read back, what runs is waited for, what is stopped was heard. What it cannot do at all, as telling where it is or going
to a position, is absent rather than refused.
"""

from __future__ import annotations

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver import (
    commands,
    copying,
    homing,
    inputs,
    jogging,
    outputs,
    presence,
    reading,
    recovery,
    running,
    selecting,
    stopping,
    writing,
)
from motorbus.families.stepper.driver.memory import Memory
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.table import Order


class ControllerMethods(Node):
    """What can be said to a controller. Values are in rad, rad/s and s, lengths in the user units of the project.

    Making one costs nothing and sends nothing.
    """

    _family = "stepper"
    ping = device_method(presence.ping)
    identify = device_method(presence.identify)
    read = device_method(reading.read)
    read_raw = device_method(reading.read_raw)
    read_project = device_method(reading.read_project)
    read_input = device_method(reading.read_input)
    dump = device_method(reading.dump)
    difference = device_method(writing.difference)
    write_project = device_method(writing.write_project)
    write = device_method(writing.write)
    select = device_method(selecting.select)
    save = device_method(selecting.save)
    clear = device_method(selecting.clear)
    backup = device_method(copying.backup)
    restore = device_method(copying.restore)
    start_project = device_method(running.start_project)
    run = device_method(running.run)
    set_output = device_method(outputs.set_output)
    watch_inputs = device_method(inputs.watch_inputs)
    inputs = device_method(inputs.inputs)  # last of those, for it takes the module's name
    stop = device_method(stopping.stop)
    jog = device_method(jogging.jog)
    move_by = device_method(jogging.move_by)
    run_once = device_method(jogging.run_once)
    jog_forward = device_method(jogging.jog_forward)
    jog_reverse = device_method(jogging.jog_reverse)
    home = device_method(homing.home)
    recover = device_method(recovery.recover)

    # -- commands of the manual, one frame each: what they set goes to the selected project and is not read back

    select_project = device_method(commands.select_project)
    set_microstep_and_angle = device_method(commands.set_microstep_and_angle)
    set_turn_distance = device_method(commands.set_turn_distance)
    set_step_distance = device_method(commands.set_step_distance)
    set_step_direction_start = device_method(commands.set_step_direction_start)
    set_step_accel_speed = device_method(commands.set_step_accel_speed)
    set_step_output = device_method(commands.set_step_output)
    set_step_delay = device_method(commands.set_step_delay)
    set_step_start_input = device_method(commands.set_step_start_input)
    set_step_stop_input = device_method(commands.set_step_stop_input)
    set_segment_loop = device_method(commands.set_segment_loop)
    set_project_loop = device_method(commands.set_project_loop)
    stop_project = device_method(commands.stop_project)
    stop_motor = device_method(commands.stop_motor)
    set_stop_mode = device_method(commands.set_stop_mode)
    set_mode4 = device_method(commands.set_mode4)
    set_power_on_home = device_method(commands.set_power_on_home)

    @property
    def last_commanded(self) -> dict[int, bool | None]:
        """What each output was last commanded to be on this bus, see `driver.outputs`; a memory and no reading."""
        return outputs.last_commanded(self)


class Controller(ControllerMethods, BlockingDevice):
    """The controller of a blocking bus: `Controller(bus).read_project(1)`."""

    def __init__(self, bus: BlockingRunner, node: int = wire.ONLY) -> None:
        ControllerMethods.__init__(self, node, *_spoken(bus))
        BlockingDevice.__init__(self, bus)


class AsyncController(ControllerMethods, AsyncDevice):
    """The controller of an async bus: `await AsyncController(bus).read_project(1)`."""

    def __init__(self, bus: AsyncRunner, node: int = wire.ONLY) -> None:
        ControllerMethods.__init__(self, node, *_spoken(bus))
        AsyncDevice.__init__(self, bus)


def _spoken(bus: object) -> tuple[int, Order, Memory | None]:
    """How this bus was opened: the motor's number, the order of bytes in dumps, and what was said on it so far."""
    driver = getattr(bus, "driver", None)
    order: Order = getattr(driver, "order", "little")
    return getattr(driver, "motor", wire.MOTOR), order, getattr(driver, "memory", None)
