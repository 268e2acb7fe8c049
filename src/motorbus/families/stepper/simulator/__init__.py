"""A simulated stepper controller, byte for byte: 27 commands, four stored projects, inputs, outputs, the home switch.

Left out: the motor itself, which follows every pulse, and mode 4, which the manual does not explain.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core.switches import options as quirk_options
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.stepper.protocol import ONLY, checked_motor
from motorbus.families.stepper.simulator.bus import StepperBus
from motorbus.families.stepper.simulator.controller import Controller
from motorbus.families.stepper.simulator.quirks import Quirks

__all__ = ["OPTIONS", "Controller", "Quirks", "StepperBus", "simulate"]

MODEL = "stepper"
OPTIONS = quirk_options(Quirks)
"""Options of a simulated bus, beside its id."""


def simulate(ids: Iterable[int] = (ONLY,), model: str = "", /, **options: object) -> StepperBus:
    """A simulated line with its one controller, id 1, at rest. The options are the fields of `Quirks`; their values may
    be text. Raises RequestError for other ids, an unknown model or option, or an invalid value.
    """
    found = tuple(ids)
    if found != (ONLY,):
        raise RequestError(
            f"a stepper line has one controller, not {', '.join(map(str, found)) or 'none'}",
            expected=f"the id {ONLY}",
            advice="open a line for each controller",
        )
    if model.lower() not in ("", MODEL):
        raise RequestError(f"there is no simulated stepper controller {model!r}", expected=MODEL)
    quirks = switched(Quirks, "stepper", options)
    checked_motor(quirks.motor)
    return StepperBus(Controller(quirks))
