"""What nobody has settled about how a controller carries a project out, each as a named switch with its default.

The manual is ten pages, no code for this controller is public and none was at hand. So every reading that another one
could stand beside is chosen here by name: the simulator takes them as options, an estimate is made with any of them,
and a device that behaves otherwise needs another option and no other code. What is assumed without a choice is listed
in the reference page "What is assumed of the stepper controller".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from motorbus.core.switches import switch

_MANUAL: Final = "stepper controller serial protocol manual"
_ASSUMED: Final = "an assumption, no source"
_TICK: Final = (1e-3, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """How a project is carried out where nobody knows."""

    # -- how it moves -------------------------------------------------------------------------------------------

    ramp: str = switch(
        "time",
        "the frequency grows by the acceleration in every tick of time, or with every pulse",
        "time",
        "pulse",
        source=f"{_MANUAL}, item 6 gives Hz and no more; both readings give its example a plausible move",
    )
    ramp_tick_ms: float = switch(
        1.0,
        "that tick in ms, with ramp=time",
        source=f"{_ASSUMED}; the example of the manual takes 0.69 s with 1 ms, 1.43 s with 10 ms",
        span=_TICK,
    )
    rounding: str = switch(
        "trunc",
        "pulses that are not whole are cut off, rounded, or carried on to the next step",
        "trunc",
        "nearest",
        "carry",
        source=_ASSUMED,
    )
    zero_distance: str = switch(
        "skip",
        "a step of distance 0 does not move, or moves without an end",
        "skip",
        "endless",
        source=f"{_ASSUMED}; outputs and delay of such a step take place",
    )

    # -- the order of steps ---------------------------------------------------------------------------------------

    seg_loop: str = switch(
        "total",
        "the count of the step loop is how often it runs in all, or how often it is repeated",
        "total",
        "extra",
        source=f"{_MANUAL}, item 11: 1 2, then 3 to 5 twice, then 6 to 8, without a plain pass before",
    )
    proj_loop: str = switch(
        "total",
        "the count of the project loop is how often it runs in all (0 and 1: once), or how often it is repeated",
        "total",
        "extra",
        source=_ASSUMED,
    )

    # -- inputs, outputs and stops --------------------------------------------------------------------------------

    start_input: str = switch(
        "level",
        "a step that waits begins when its input is active, or only when it becomes active meanwhile",
        "level",
        "edge",
        source=f"{_ASSUMED}; {_MANUAL}, item 9: a button is pressed once, then this step runs",
    )
    stop_input: str = switch(
        "immediate",
        "the stop input of a step ends its motion at once, or as the stop mode says",
        "immediate",
        "mode",
        source=f"{_MANUAL}, item 10: the motor must stop at once",
    )
    stop_input_scope: str = switch(
        "step", "it ends the motion of its step, or the project", "step", "project", source=_ASSUMED
    )
    motor_stop_ends_project: bool = switch(
        True, "stop motor ends a project that runs", source=f"{_ASSUMED}; no: only the motion of the step"
    )
    stop_project_scope: str = switch(
        "project",
        "stop project and input 4 stop projects only, or jog, single move and homing too",
        "project",
        "all",
        source=f"{_MANUAL}, item 14 says project",
    )
    flags_scope: str = switch(
        "project",
        "stop mode and homing at power-on belong to each project, or to the device",
        "project",
        "device",
        source=f"{_MANUAL}: they stand in each dump, and their commands name no project",
    )
    output_zero: str = switch(
        "keep",
        "a step with output action 0 leaves the outputs alone, or switches all off",
        "keep",
        "off",
        source=f"{_MANUAL}, item 7: 0 is no output, and 8 is all off already",
    )
    outputs_on_stop: str = switch(
        "hold",
        "the outputs stay as they are when a project ends, or go off",
        "hold",
        "off",
        source=f"{_ASSUMED}; inactive at power-on",
    )
    home_stop: str = switch(
        "immediate",
        "homing ends at once when input 5 is active, or as the stop mode says",
        "immediate",
        "mode",
        source=_ASSUMED,
    )
    jog_reverse_while_jogging: str = switch(
        "reverse",
        "the other jog command stops and turns round, or is ignored",
        "reverse",
        "ignore",
        source=_ASSUMED,
    )
    busy: str = switch(
        "ignore",
        "a start while something runs is acknowledged and ignored, not answered, or begins anew",
        "ignore",
        "silent",
        "restart",
        source=_ASSUMED,
    )

    # -- the notice that a project has ended -----------------------------------------------------------------------

    notice_on_stop: bool = switch(
        False,
        "it also comes when a project was stopped",
        source=f"{_MANUAL}, item 13: when it has run to its end",
    )
    notice_on_in3: bool = switch(
        False,
        "it also comes for a project that input 3 started",
        source=f"{_MANUAL}, item 13 has it as the second answer to a command",
    )
    notice_on_once: bool = switch(
        False,
        "it also comes at the end of a single move and of homing",
        source=f"{_MANUAL} has it for start project only",
    )
    clear_notice: bool = switch(
        True, "a project without steps ends at once, with a notice; no: without", source=_ASSUMED
    )


USUAL: Final = Behaviour()
