"""The controller as a user holds it: one list of verbs, blocking on `Controller`, awaitable on `AsyncController`.

A controller without status, position and checksum makes each of them promise less than its name: what is written is
read back, what runs is waited for, what is stopped was heard. What it cannot do at all, as telling where it is or going
to a position, is absent rather than refused.
"""

from __future__ import annotations

from motorbus.core.verbs import AsyncRunner, Awaiting, Blocking, BlockingRunner, verb
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver import (
    characterising,
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


class ControllerVerbs(Node):
    """What can be said to a controller. Values are in rad, rad/s and s, lengths in the user units of the project.

    Making one costs nothing and sends nothing.
    """

    ping = verb(presence.ping)
    identify = verb(presence.identify)
    read = verb(reading.read)
    read_raw = verb(reading.read_raw)
    read_project = verb(reading.read_project)
    read_input = verb(reading.read_input)
    dump = verb(reading.dump)
    difference = verb(writing.difference)
    write_project = verb(writing.write_project)
    write = verb(writing.write)
    select = verb(selecting.select)
    save = verb(selecting.save)
    clear = verb(selecting.clear)
    backup = verb(copying.backup)
    restore = verb(copying.restore)
    start_project = verb(running.start_project)
    run = verb(running.run)
    set_output = verb(outputs.set_output)
    watch_inputs = verb(inputs.watch_inputs)
    inputs = verb(inputs.inputs)  # last of those, for it takes the module's name
    stop = verb(stopping.stop)
    jog = verb(jogging.jog)
    move_by = verb(jogging.move_by)
    run_once = verb(jogging.run_once)
    jog_forward = verb(jogging.jog_forward)
    jog_reverse = verb(jogging.jog_reverse)
    home = verb(homing.home)
    characterise = verb(characterising.characterise)
    recover = verb(recovery.recover)

    # -- commands of the manual, one frame each: what they set goes to the selected project and is not read back

    select_project = verb(commands.select_project)
    set_microstep_and_angle = verb(commands.set_microstep_and_angle)
    set_turn_distance = verb(commands.set_turn_distance)
    set_step_distance = verb(commands.set_step_distance)
    set_step_direction_start = verb(commands.set_step_direction_start)
    set_step_accel_speed = verb(commands.set_step_accel_speed)
    set_step_output = verb(commands.set_step_output)
    set_step_delay = verb(commands.set_step_delay)
    set_step_start_input = verb(commands.set_step_start_input)
    set_step_stop_input = verb(commands.set_step_stop_input)
    set_segment_loop = verb(commands.set_segment_loop)
    set_project_loop = verb(commands.set_project_loop)
    stop_project = verb(commands.stop_project)
    stop_motor = verb(commands.stop_motor)
    set_stop_mode = verb(commands.set_stop_mode)
    set_mode4 = verb(commands.set_mode4)
    set_power_on_home = verb(commands.set_power_on_home)

    @property
    def last_commanded(self) -> dict[int, bool | None]:
        """What each output was last commanded to be on this bus, see `driver.outputs`; a memory and no reading."""
        return outputs.last_commanded(self)


class Controller(ControllerVerbs, Blocking):
    """The controller of a blocking bus: `Controller(bus).read_project(1)`."""

    def __init__(self, bus: BlockingRunner, node: int = wire.ONLY) -> None:
        ControllerVerbs.__init__(self, node, *_spoken(bus))
        Blocking.__init__(self, bus)


class AsyncController(ControllerVerbs, Awaiting):
    """The controller of an async bus: `await AsyncController(bus).read_project(1)`."""

    def __init__(self, bus: AsyncRunner, node: int = wire.ONLY) -> None:
        ControllerVerbs.__init__(self, node, *_spoken(bus))
        Awaiting.__init__(self, bus)


def _spoken(bus: object) -> tuple[int, Order, Memory | None]:
    """How this bus was opened: the motor's number, the order of bytes in dumps, and what was said on it so far."""
    family = getattr(bus, "family", None)
    order: Order = getattr(family, "_order", "little")
    return getattr(family, "_motor", wire.MOTOR), order, getattr(family, "_memory", None)
