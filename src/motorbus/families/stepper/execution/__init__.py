"""How a project runs: what a controller does with its numbers, as a pure function of them, of time and of its inputs.

It knows no bytes. The simulator makes a device of it, `program` an estimate and a picture before anything turns, and a
driver the progress of a run that no controller tells. Time is in seconds on whatever clock the caller has, position in
pulses, forward positive. Everything is in closed form, so a pause of four hours costs what one of a millisecond does.
"""

from __future__ import annotations

from motorbus.families.stepper.execution.behaviour import USUAL, Behaviour
from motorbus.families.stepper.execution.machine import (
    advance,
    due,
    home,
    jog,
    power_off,
    power_on,
    run_once,
    set_input,
    set_output,
    set_stop_mode,
    start,
    stop_motor,
    stop_project,
)
from motorbus.families.stepper.execution.order import (
    Place,
    exact_pulses,
    following,
    frequency,
    laps,
    last_step,
    move,
    one_pass,
    passes,
    pulses,
    ramp_of,
    sent_in_all,
    times_in_a_pass,
)
from motorbus.families.stepper.execution.profile import Motion, Ramp, motion, still
from motorbus.families.stepper.execution.state import After, Happening, Phase, Run, State
from motorbus.families.stepper.execution.turn import EMPTY_PASS, Next

__all__ = [
    "EMPTY_PASS",
    "USUAL",
    "After",
    "Behaviour",
    "Happening",
    "Motion",
    "Next",
    "Phase",
    "Place",
    "Ramp",
    "Run",
    "State",
    "advance",
    "due",
    "exact_pulses",
    "following",
    "frequency",
    "home",
    "jog",
    "laps",
    "last_step",
    "motion",
    "move",
    "one_pass",
    "passes",
    "power_off",
    "power_on",
    "pulses",
    "ramp_of",
    "run_once",
    "sent_in_all",
    "set_input",
    "set_output",
    "set_stop_mode",
    "start",
    "still",
    "stop_motor",
    "stop_project",
    "times_in_a_pass",
]
