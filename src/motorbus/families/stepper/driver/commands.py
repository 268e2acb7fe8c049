"""The commands of the manual, one function and one frame each, with the numbers as the manual has them.

This is the floor on which the rest of the driver stands. Whoever uses it directly should know what the manual does
not say aloud: what is set goes to whichever project is selected, an acknowledgement repeats no value, and nothing is
kept before it is saved. `write_project` and its like take care of that.

Items are those of the stepper controller serial protocol manual. Reading a project and an input are in `reading`. What
moves the motor takes more than its frame to be safe: start project, jog forward and in reverse, one move and home are
made by `motion`, which wants to know where to.

Every function here raises RequestError, naming the field and what is allowed, before anything is sent; its exchange
raises UnexpectedReply when the acknowledgement differs in any byte from the one that is due.
"""

from __future__ import annotations

from motorbus.core.request import Precondition, Priority, Request
from motorbus.core.setpoint import Setpoint
from motorbus.families.stepper.driver.exchanges import command
from motorbus.families.stepper.driver.node import Node


def nothing(reply: bytes) -> None:
    """An acknowledgement carries no value."""


def motion(
    node: Node, name: str, goals: tuple[Setpoint, ...], refusal: Precondition | None = None, /, **values: int
) -> Request[None]:
    """A command that moves the motor, with what it orders: the gate lets nothing through that does not say.

    `refusal` is asked just before it leaves: why it must not after all, see `Request`."""
    return command(
        node,
        name,
        nothing,
        priority=Priority.CONTROL,
        timeout=None,
        goals=goals,
        refusal=refusal,
        expert=False,
        **values,
    )


def select_project(node: Node, project: int, total_steps: int) -> Request[None]:
    """Select a project, 1 to 4, and set how many steps it has, 1 to 10: both in one, there is no other way (item 1).

    The edits that follow go to it, and edits of another project that are not saved are lost; both are assumptions.
    `select` does the same without changing the number of steps."""
    return command(
        node,
        "select_project",
        nothing,
        priority=Priority.CONFIGURATION,
        project=project,
        total_steps=total_steps,
    )


def set_microstep_and_angle(node: Node, microsteps: int, step_angle: int) -> Request[None]:
    """Set microsteps for a full step, 1 to 65535, and the step angle in hundredths of a degree, 1 to 255 (item 2)."""
    return command(
        node,
        "set_microstep_and_angle",
        nothing,
        priority=Priority.CONFIGURATION,
        microsteps=microsteps,
        step_angle=step_angle,
    )


def set_turn_distance(node: Node, turn_distance: int) -> Request[None]:
    """Set how many user units make one turn of the motor, 1 to 16777215 (item 3): the unit of all distances."""
    return command(
        node, "set_turn_distance", nothing, priority=Priority.CONFIGURATION, turn_distance=turn_distance
    )


def set_step_distance(node: Node, step: int, distance: int) -> Request[None]:
    """Set the distance of a step, 1 to 10, in user units, 0 to 16777215 (item 4)."""
    return command(
        node, "set_step_distance", nothing, priority=Priority.CONFIGURATION, step=step, distance=distance
    )


def set_step_direction_start(node: Node, step: int, direction: int, start_frequency: int) -> Request[None]:
    """Set the direction of a step, 0 forward or 1 reverse, and its start frequency in Hz, 0 to 65535 (item 5)."""
    return command(
        node,
        "set_step_direction_start",
        nothing,
        priority=Priority.CONFIGURATION,
        step=step,
        direction=direction,
        start_frequency=start_frequency,
    )


def set_step_accel_speed(node: Node, step: int, acceleration: int, speed: int) -> Request[None]:
    """Set the acceleration of a step in Hz, 0 to 65535, and its speed in RPM, 0 to 65535 (item 6).

    Nobody says per what the frequency grows by the acceleration.
    """
    return command(
        node,
        "set_step_accel_speed",
        nothing,
        priority=Priority.CONFIGURATION,
        step=step,
        acceleration=acceleration,
        speed=speed,
    )


def set_step_output(node: Node, step: int, output: int) -> Request[None]:
    """Set what a step does to the outputs, 0 to 8, see `StepOutput` (item 7)."""
    return command(
        node, "set_step_output", nothing, priority=Priority.CONFIGURATION, step=step, output=output
    )


def set_step_delay(node: Node, step: int, delay: int) -> Request[None]:
    """Set the pause after the motion of a step in ms, 0 to 16777215 (item 8)."""
    return command(node, "set_step_delay", nothing, priority=Priority.CONFIGURATION, step=step, delay=delay)


def set_step_start_input(node: Node, step: int, start_input: int) -> Request[None]:
    """Set the input that a step waits for: 1, 2 or 5, or 0 for none (item 9)."""
    return command(
        node,
        "set_step_start_input",
        nothing,
        priority=Priority.CONFIGURATION,
        step=step,
        start_input=start_input,
    )


def set_step_stop_input(node: Node, step: int, stop_input: int) -> Request[None]:
    """Set the input that ends the motion of a step: 1, 2 or 5, or 0 for none (item 10)."""
    return command(
        node,
        "set_step_stop_input",
        nothing,
        priority=Priority.CONFIGURATION,
        step=step,
        stop_input=stop_input,
    )


def set_segment_loop(node: Node, loop_first: int, loop_last: int, loop_count: int) -> Request[None]:
    """Set the step loop: from step, to step, and how often, 0 to 254; 0, 0, 0 for none (item 11)."""
    return command(
        node,
        "set_segment_loop",
        nothing,
        priority=Priority.CONFIGURATION,
        loop_first=loop_first,
        loop_last=loop_last,
        loop_count=loop_count,
    )


def set_project_loop(node: Node, project_loop: int) -> Request[None]:
    """Set how often the project runs, 0 to 255; 255 is without an end, and without a notice (item 12)."""
    return command(
        node, "set_project_loop", nothing, priority=Priority.CONFIGURATION, project_loop=project_loop
    )


def stop_project(node: Node) -> Request[None]:
    """Stop the project (item 14). `stop` says this and `stop_motor`, until both are accepted."""
    return command(node, "stop_project", nothing, priority=Priority.STOP)


def save_project(node: Node, project: int) -> Request[None]:
    """Save what is being edited as this project, 1 to 4 (item 16). `save` reads it back."""
    return command(node, "save_project", nothing, priority=Priority.CONFIGURATION, project=project)


def clear_project(node: Node, project: int) -> Request[None]:
    """Set all of a project, 1 to 4, to zero, what is stored and what is edited (item 17a). `clear` is guarded."""
    return command(node, "clear_project", nothing, priority=Priority.CONFIGURATION, project=project)


def stop_motor(node: Node) -> Request[None]:
    """Stop the motor (item 20). `stop` says this and `stop_project`, until both are accepted."""
    return command(node, "stop_motor", nothing, priority=Priority.STOP)


def set_stop_mode(node: Node, stop_mode: int) -> Request[None]:
    """Set what a stop does: 0 ramps down, 1 ends at once (item 21)."""
    return command(node, "set_stop_mode", nothing, priority=Priority.CONFIGURATION, stop_mode=stop_mode)


def set_output(node: Node, port: int, level: int) -> Request[None]:
    """Switch outputs: 1 to 3, 4 for all three, 5 for the LEDs; level 1 is active, pulled low, 0 is not (item 23)."""
    return command(node, "set_output", nothing, priority=Priority.CONTROL, port=port, level=level)


def set_mode4(node: Node, mode4: int) -> Request[None]:
    """Set the variant of mode 4, 0 to 2, of which nobody knows what it does (item 25)."""
    return command(node, "set_mode4", nothing, priority=Priority.CONFIGURATION, mode4=mode4)


def set_power_on_home(node: Node, power_on_home: int) -> Request[None]:
    """Set whether it homes when the supply comes: 1 makes the motor move then (item 26)."""
    return command(
        node, "set_power_on_home", nothing, priority=Priority.CONFIGURATION, power_on_home=power_on_home
    )
