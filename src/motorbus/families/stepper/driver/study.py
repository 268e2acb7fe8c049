"""The course of a characterisation: which experiment after which, and what each adds to the profile.

First what dumps tell by themselves, then two runs of a known time, which say what is fixed in each time. Only what
these agree on is the ground for the rest. Whatever goes wrong on the line is a doubt, and with a doubt nothing is
believed that rests on silence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from motorbus.core.operation import Operation, Pause, Report
from motorbus.errors import VerificationFailed
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver.experiments import Motor, Seen, Trial, Verdict, judged
from motorbus.families.stepper.driver.listening import Heard, listened, timed, write
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.reading import dump, dump_once
from motorbus.families.stepper.driver.trials import controls, trials
from motorbus.families.stepper.driver.views import Views
from motorbus.families.stepper.program.profile import KNOWN, Profile, Setting
from motorbus.families.stepper.table import Order, Project

UNTRIED: Final[Mapping[str, str]] = {
    "start_input": "only a hand on an input could tell",
    "stop_input": "only a hand on an input could tell",
    "stop_input_scope": "only a hand on an input could tell",
    "notice_on_in3": "only a hand on input 3 could tell",
    "home_stop": "only homing against its switch could tell",
    "output_zero": "no command reads an output",
    "outputs_on_stop": "no command reads an output",
    "jog_reverse_while_jogging": "no command tells which way the motor turns",
    "save_cross": "telling it would store over a project",
    "save_cut": "only a supply that goes while it saves could tell",
    "clear_notice": "no project is without steps, and none is cleared for it",
}
"""What no experiment here is made for, and why."""
_STEADY: Final = 0.03
"""s by which two runs of the same may differ."""
_CLOCK: Final = 0.1
"""Part by which the clock of a controller may be off."""
_MARGIN: Final = 0.6
"""s that are waited beyond the latest moment at which any reading says anything."""


class Experiment(NamedTuple):
    """An event, and an entry of the plan: this is about to be tried.

    `settles` are the questions it asks, `turns` how far the motor turns each way, `seconds` how long one run takes.
    """

    name: str
    what: str
    settles: tuple[str, ...]
    turns: float
    seconds: float
