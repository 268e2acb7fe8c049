"""Simulated KST CAN servos, frame for frame.

Each behaviour has its source in the code: the KST CAN protocol manual, public drivers of such servos, CiA 301, or none
(`# assumption`). Left out: stall and steady error under load, other emergencies than low voltage, heartbeat, bus-off,
and a host that is alone on its bus, whose frames no node acknowledges.
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
SHORTEST_INTERVAL = 0.1  # ms; a bus of 1 Mbit/s has no room for more frequent reports


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
    if not (quirks.firmware.isascii() and quirks.firmware.isprintable() and quirks.firmware):
        raise _impossible("firmware", quirks.firmware, "one or more printable ASCII characters")
    if 0 < quirks.reports_ms < SHORTEST_INTERVAL:
        raise _impossible("reports_ms", quirks.reports_ms, f"0, or {SHORTEST_INTERVAL:g} and more")
    try:
        duplicates = [units.whole(word) for word in quirks.duplicate.split("+") if word]
    except ValueError:
        raise _impossible("duplicate", quirks.duplicate, "ids as 0x25 or 0x25+0x26") from None
    return KstBus(ids, PROFILES[name], quirks, duplicates)


def _impossible(option: str, value: object, expected: str) -> RequestError:
    return RequestError(f"option {option}: {value!r} is not possible", expected=expected)
