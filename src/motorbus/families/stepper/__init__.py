"""A programmable controller for one stepper motor: 27 commands, four stored projects of up to ten steps.

It answers with an acknowledgement, a project dump, the level of one input, and one message of its own: a project that
was started has ended. There is no position, no state and no error to ask for, so what a host shows while the motor
turns is a model. That model is `execution`, a pure function; `program` makes it a file that can be checked and timed
before a motor turns, and `simulator` makes it a device.

    Program      a project as a file, an image or frames: read, checked, timed, planned
    Conditions   what a project is judged against
    Behaviour    how a controller carries a project out where nobody knows

`FAMILY` comes with the driver; until then discovery passes this folder over.
"""

from __future__ import annotations

from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Conditions, Estimate, Finding, Plan, Program

__all__ = ["Behaviour", "Conditions", "Estimate", "Finding", "Plan", "Program"]
