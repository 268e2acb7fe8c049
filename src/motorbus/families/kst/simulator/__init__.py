"""Simulated KST CAN servos, frame for frame.

Each behaviour has its source in the code: the KST CAN protocol manual, public drivers of such servos, CiA 301, or none
(`# assumption`). Left out: stall and steady error under load, alarms and emergencies, heartbeat, the error states of a
CAN controller, and a host that is alone on its bus, whose frames no node acknowledges.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core import units
from motorbus.core.family import Option
from motorbus.core.switches import options as quirk_options
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.kst.profiles import PROFILES
from motorbus.families.kst.simulator.bus import KstBus
from motorbus.families.kst.simulator.quirks import Quirks
from motorbus.families.kst.simulator.servo import Servo

__all__ = ["OPTIONS", "KstBus", "Quirks", "Servo", "simulate"]

OPTIONS = (
    Option("profile", str, "kst", "the make, that is, the variant of the protocol", tuple(PROFILES)),
    *quirk_options(Quirks),
)
"""Options of a simulated bus, beside its ids."""


def simulate(ids: Iterable[int], model: str = "", /, **options: object) -> KstBus:
    """A simulated bus with these ids, at rest; a repeated id is two servos.

    `model` is a profile ("": the option `profile`, by default kst). The other options are the fields of `Quirks`; their
    values may be text. Raises RequestError for an unknown profile or option, an invalid value, or no ids.
    """
    named = str(options.pop("profile", "") or "")
    if model and named and model != named:
        raise RequestError(f"model {model} and profile {named} contradict each other", expected="one of them")
    name = (model or named or "kst").lower()
    if name not in PROFILES:
        raise RequestError(
            f"there is no simulated KST profile {name!r}", expected=f"one of {', '.join(PROFILES)}"
        )
    quirks = switched(Quirks, "kst", options)
    try:
        duplicates = [units.whole(word) for word in quirks.duplicate.split("+") if word]
    except ValueError:
        raise RequestError(
            f"option duplicate: {quirks.duplicate!r} is not possible", expected="ids as 0x25 or 0x25+0x26"
        ) from None
    return KstBus(ids, PROFILES[name], quirks, duplicates)
