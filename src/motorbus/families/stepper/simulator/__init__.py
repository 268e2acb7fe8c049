"""How the stepper controller behaves, byte for byte and moment for moment: every doubt a named switch.

It answers the 27 commands, carries projects out by `execution`, tells their end, and forgets what was not saved. Since
a real one tells nothing while it works, this is not only a stand-in for tests: it is the one place where one can see
what a project does. It knows the wire and the table and never the driver; time comes in as an argument.

What it leaves out: the motor itself, which follows every pulse, and mode 4, of which nobody knows what it does.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core.switches import options as switches_of
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.simulator.bus import StepperBus
from motorbus.families.stepper.simulator.controller import Controller
from motorbus.families.stepper.simulator.inputs import Change, parse
from motorbus.families.stepper.simulator.switches import Switches

OPTIONS = switches_of(Switches)
"""What a bus string may say of a simulated stepper bus beside ids."""
MODEL = "stepper"


def simulate(ids: Iterable[int] = (wire.ONLY,), model: str = "", /, **options: object) -> StepperBus:
    """A simulated line with its controller, at rest. There is no address on the line, so there is one of them.

    `ids` is 1, by which `nodes` has it; the options are the fields of `Switches`, also as text. Raises
    RequestError for another id, an unknown model or option, or an impossible value.
    """
    found = tuple(ids)
    if found != (wire.ONLY,):
        raise RequestError(
            f"a stepper line has one controller, not {', '.join(map(str, found)) or 'none'}",
            expected=f"the id {wire.ONLY}",
            cause="its frames carry no address",
            advice="open a line for each of them",
        )
    if model.lower() not in ("", MODEL):
        raise RequestError(f"there is no simulated stepper controller {model!r}", expected=MODEL)
    switches = switched(Switches, "stepper", options)
    if switches.motor not in wire.MOTORS:
        raise RequestError(
            f"option motor: {switches.motor} is not possible", expected="1 to 255, not ending in E in hex"
        )
    return StepperBus(wire.ONLY, switches)


__all__ = ["MODEL", "OPTIONS", "Change", "Controller", "StepperBus", "Switches", "parse", "simulate"]
