"""How KST CAN servos and their relatives behave, frame for frame: every profile, and every doubt a named switch.

Each behaviour says in the code where it is known from: the KST CAN protocol manual, public drivers of such servos,
CiA 301, or nowhere, and then it is called an assumption. The simulator knows the wire and the table and never the
driver; time comes in as an argument. What it leaves out: stall and steady error under load, other emergencies than
low voltage, heartbeat, what a controller does at bus-off, and a host that is alone on its bus, whose frames nobody
acknowledges.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from motorbus.core import units
from motorbus.core.family import Option
from motorbus.core.switches import options as switches_of
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.kst.profiles import PROFILES, Profile
from motorbus.families.kst.simulator.bus import KstBus
from motorbus.families.kst.simulator.servo import Servo
from motorbus.families.kst.simulator.switches import Switches

OPTIONS = (
    Option("profile", str, "kst", "which relative of the protocol they speak", tuple(PROFILES)),
    *switches_of(Switches),
)
"""What a bus string may say of a simulated KST bus beside ids."""
SHORTEST: Final = 0.1
"""ms between reports; a bus of 1 Mbit/s has no room for more of them."""


def simulate(ids: Iterable[int], model: str = "", /, **options: object) -> KstBus:
    """A simulated bus with these ids, at rest; an id that comes twice is two servos.

    `model` is the name of a profile ("" is what the option `profile` says, usually kst); the other options are the
    fields of `Switches`, also as text. Raises RequestError for an unknown profile or option, an impossible value, or
    no ids.
    """
    named = str(options.pop("profile", "") or "")
    if model and named and model != named:
        raise RequestError(
            f"model {model} and profile {named} contradict each other", advice="give one of them"
        )
    if options.get("id_format") == "auto":  # of a host, which asks either way
        options["id_format"] = "asked"
    switches = switched(Switches, "kst", options)
    twins = [_number(word) for word in switches.duplicate.split("+") if word]
    _check_text("firmware", switches.firmware)
    _check_text("software", switches.software)
    if 0 < switches.reports_ms < SHORTEST:
        raise RequestError(
            f"option reports_ms: {switches.reports_ms:g} is not possible",
            expected=f"0, or {SHORTEST:g} and more",
        )
    return KstBus(ids, _profile(model or named or "kst"), switches, twins)


def _profile(name: str) -> Profile:
    try:
        return PROFILES[name.lower()]
    except KeyError:
        raise RequestError(
            f"there is no simulated KST profile {name!r}", expected=f"one of {', '.join(PROFILES)}"
        ) from None


def _number(word: str) -> int:
    try:
        return units.whole(word)
    except ValueError:
        raise RequestError(
            f"option duplicate: {word!r} is not a node id", expected="ids as 0x25 or 0x25+0x26"
        ) from None


def _check_text(name: str, text: str) -> None:
    if not (text.isascii() and text.isprintable() and text):
        raise RequestError(
            f"option {name}: {text!r} is not possible", expected="one or more ASCII characters"
        )


__all__ = ["OPTIONS", "KstBus", "Servo", "Switches", "simulate"]
