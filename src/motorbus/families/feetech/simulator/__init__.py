"""Simulated FEETECH servos, byte for byte: every known model of all six maps.

Each behaviour has its source in the code, or none (`# assumption`). Left out: heat by load, over-current, a
supply that the servos share, backlash, and a gear that yields to more torque than the motor has.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core import units
from motorbus.core.switches import options as options_of
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.bus import FeetechBus
from motorbus.families.feetech.simulator.models import MODELS, Model, models
from motorbus.families.feetech.simulator.quirks import Quirks
from motorbus.families.feetech.simulator.servo import Servo

__all__ = ["MODELS", "OPTIONS", "FeetechBus", "Model", "Quirks", "Servo", "simulate"]

OPTIONS = options_of(Quirks)
"""Options of a simulated bus, beside ids and model."""


def simulate(ids: Iterable[int], model: str = "", /, **options: object) -> FeetechBus:
    """A simulated bus with these ids, at rest and limp; a repeated id is two servos.

    `model` is the model of all, or one for each id joined by "+"; "" is sts3215. The options are the fields
    of `Quirks`; their values may be text. Raises RequestError for an unknown model or option, an invalid
    value, or no ids.
    """
    quirks = switched(Quirks, "feetech", options)
    nodes = list(ids)
    bus = FeetechBus(nodes, models(model, quirks.firmware, len(nodes)), quirks)
    for word in quirks.duplicate.replace(",", "+").split("+"):
        if word:
            try:
                bus.duplicate(units.whole(word))
            except ValueError:
                raise RequestError(
                    f"option duplicate: {word!r} is no id", expected="ids as 3 or 3+5"
                ) from None
    return bus
