"""The device classes: one list of methods, blocking in `Controller`, awaitable in `AsyncController`."""

from __future__ import annotations

from typing import Any

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.families.stepper.driver import bus as bus_driver
from motorbus.families.stepper.driver import io, manual, project1, projects, run, stop
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.node import manual as command_method
from motorbus.families.stepper.protocol import ONLY


class ControllerMethods(Node):
    """Methods of a controller. Angles in rad, velocities in rad/s, times in s, distances in units of the project."""

    _family = "stepper"
    ping = device_method(bus_driver.ping)
    identify = device_method(bus_driver.identify)
    read = device_method(projects.read)
    read_raw = device_method(projects.read_raw)
    read_project = device_method(projects.read_project)
    dump = device_method(projects.dump)
    difference = device_method(projects.difference)
    write_project = device_method(projects.write_project)
    write = device_method(projects.write)
    clear = device_method(projects.clear)
    backup = device_method(projects.backup)
    restore = device_method(projects.restore)
    start_project = device_method(run.start_project)
    run = device_method(run.run)
    stop = device_method(stop.stop)
    read_input = device_method(io.read_input)
    inputs = device_method(io.inputs)
    watch_inputs = device_method(io.watch_inputs)
    set_output = device_method(io.set_output)
    move_by = device_method(manual.move_by)
    jog = device_method(manual.jog)
    jog_forward = device_method(manual.jog_forward)
    jog_reverse = device_method(manual.jog_reverse)
    run_once = device_method(manual.run_once)
    home = device_method(manual.home)
    recover = device_method(project1.recover)

    # Commands of the manual, one request each. The others of its 27 items are above, verified.
    select_project = device_method(command_method("select_project"))
    set_microstep_and_angle = device_method(command_method("set_microstep_and_angle"))
    set_turn_distance = device_method(command_method("set_turn_distance"))
    set_step_distance = device_method(command_method("set_step_distance"))
    set_step_direction_start = device_method(command_method("set_step_direction_start"))
    set_step_accel_speed = device_method(command_method("set_step_accel_speed"))
    set_step_output = device_method(command_method("set_step_output"))
    set_step_delay = device_method(command_method("set_step_delay"))
    set_step_start_input = device_method(command_method("set_step_start_input"))
    set_step_stop_input = device_method(command_method("set_step_stop_input"))
    set_segment_loop = device_method(command_method("set_segment_loop"))
    set_project_loop = device_method(command_method("set_project_loop"))
    stop_project = device_method(command_method("stop_project"))
    save_project = device_method(command_method("save_project"))
    clear_project = device_method(command_method("clear_project"))
    stop_motor = device_method(command_method("stop_motor"))
    set_stop_mode = device_method(command_method("set_stop_mode"))
    set_mode4 = device_method(command_method("set_mode4"))
    set_power_on_home = device_method(command_method("set_power_on_home"))

    @property
    def last_commanded(self) -> dict[int, bool | None]:
        """The level last sent on this bus, by output 1 to 3 and 5 for the LEDs; None: unknown. It is not a reading."""
        return dict(self.state.outputs)


class Controller(ControllerMethods, BlockingDevice):
    """The controller of a blocking bus: `Controller(bus).read_project(1)`."""

    def __init__(self, bus: BlockingRunner, node: int = ONLY) -> None:
        ControllerMethods.__init__(self, node, *_settings(bus))
        BlockingDevice.__init__(self, bus)


class AsyncController(ControllerMethods, AsyncDevice):
    """The controller of an async bus: `await AsyncController(bus).read_project(1)`."""

    def __init__(self, bus: AsyncRunner, node: int = ONLY) -> None:
        ControllerMethods.__init__(self, node, *_settings(bus))
        AsyncDevice.__init__(self, bus)


def _settings(bus: object) -> tuple[Any, ...]:
    """Motor number, byte order, ramp tick and state of this bus; those of a new node for anything else."""
    driver = getattr(bus, "driver", None)
    if not isinstance(driver, bus_driver.StepperDriver):
        return ()
    return driver.motor, driver.order, driver.tick_ms, driver.state
