"""A simulated stepper controller, byte for byte: 27 commands, four stored projects, inputs, outputs, the home switch.

Left out: the motor itself, which follows every pulse, and mode 4, which the manual does not explain.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core.family import Option
from motorbus.core.switches import options as quirk_options
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.stepper_new.parameters import checked_order
from motorbus.families.stepper_new.protocol import MOTOR, ONLY, checked_motor
from motorbus.families.stepper_new.simulator.bus import StepperBus
from motorbus.families.stepper_new.simulator.controller import Controller
from motorbus.families.stepper_new.simulator.quirks import Quirks

__all__ = ["OPTIONS", "Controller", "Quirks", "StepperBus", "simulate"]

MODEL = "stepper"
OPTIONS = (
    Option("motor", int, MOTOR, "its motor number; it does not reply to others", span=(1, 255)),
    Option("dump_order", str, "little", "the byte of a number that is first in a dump", ("little", "big")),
    *quirk_options(Quirks),
)
"""Options of a simulated bus, beside its id."""


def simulate(ids: Iterable[int] = (ONLY,), model: str = "", /, **options: object) -> StepperBus:
    """A simulated line with its one controller, id 1, at rest. The options are motor, dump_order and those of `Quirks`.

    Their values may be text. Raises RequestError for other ids, an unknown model or option, or an invalid value.
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
    motor = checked_motor(int(str(options.pop("motor", MOTOR))))
    order = checked_order(options.pop("dump_order", "little"))
    return StepperBus(Controller(switched(Quirks, "stepper", options), motor, order))
