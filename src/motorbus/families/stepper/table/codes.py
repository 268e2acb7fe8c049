"""What the small numbers mean, and what they do to the outputs.

The three outputs are coded twice, and differently: as the action of a step, where 5 switches output 1 off, and as the
port of the command "set output", where 5 is a pair of LEDs. Two enumerations, so that nobody takes one for the other.

Source: stepper controller serial protocol manual, items 5, 7, 9, 10, 21 and 23.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

OUTPUTS: Final = 3
INPUTS: Final = 5
ALL: Final = (1 << OUTPUTS) - 1
"""All three outputs, as bits: bit 0 is output 1."""
START_INPUT: Final = 3
"""The input that starts a project."""
STOP_INPUT: Final = 4
"""The input that stops a project."""
HOME_INPUT: Final = 5
"""The input of the home switch."""
STEP_INPUTS: Final = (1, 2, 5)
"""Inputs that a step may wait for or be ended by; 3 and 4 start and stop projects."""
ENDLESS: Final = 255
"""The project loop count that means: until stopped."""


class Direction(IntEnum):
    """Which way a step goes (item 5). Homing always runs in reverse. That forward counts up is our convention."""

    FORWARD = 0
    REVERSE = 1


class StopMode(IntEnum):
    """What a stop does (item 21): ramp down, or end at once."""

    SLOW = 0
    IMMEDIATE = 1


class StepOutput(IntEnum):
    """What a step does to the outputs at its beginning (item 7): one action only."""

    NONE = 0
    ON_1 = 1
    ON_2 = 2
    ON_3 = 3
    ALL_ON = 4
    OFF_1 = 5
    OFF_2 = 6
    OFF_3 = 7
    ALL_OFF = 8


class OutputPort(IntEnum):
    """What "set output" switches (item 23); its level says on (1, active: 5 V outputs pulled low) or off (0)."""

    OUTPUT_1 = 1
    OUTPUT_2 = 2
    OUTPUT_3 = 3
    ALL = 4
    LEDS = 5


def after_step(outputs: int, action: int, *, zero_is_off: bool = False) -> int:
    """The outputs, as bits, after the action of a step; an action that is none changes nothing.

    Whether 0, "no output", leaves them alone or switches them off is not settled: `zero_is_off`.
    """
    if action == StepOutput.NONE:
        return 0 if zero_is_off else outputs
    if action in (StepOutput.ALL_ON, StepOutput.ALL_OFF):
        return ALL if action == StepOutput.ALL_ON else 0
    if StepOutput.ON_1 <= action <= StepOutput.ON_3:
        return outputs | 1 << action - StepOutput.ON_1
    if StepOutput.OFF_1 <= action <= StepOutput.OFF_3:
        return outputs & ~(1 << action - StepOutput.OFF_1)
    return outputs


def after_port(outputs: int, port: int, level: int) -> int:
    """The outputs, as bits, after "set output"; the LEDs are none of them."""
    if port == OutputPort.ALL:
        return ALL if level else 0
    if OutputPort.OUTPUT_1 <= port <= OutputPort.OUTPUT_3:
        bit = 1 << port - OutputPort.OUTPUT_1
        return outputs | bit if level else outputs & ~bit
    return outputs


def step_output_of(output: int, on: bool) -> StepOutput:
    """The action of a step that switches this output, 1 to 3 (0: all of them), on or off."""
    if not output:
        return StepOutput.ALL_ON if on else StepOutput.ALL_OFF
    return StepOutput(output if on else output + StepOutput.ALL_ON)
