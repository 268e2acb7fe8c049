"""Simulated FEETECH servos, byte for byte: every known model of all six maps.

Each behaviour has its source in the code, or none (`# assumption`). Left out: heat by load, over-current, a supply
that the servos share, backlash, and a gear that yields to more torque than the motor has.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from motorbus.core import units
from motorbus.core.family import Option
from motorbus.core.switches import options as quirk_options
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.feetech_new.registers.codes import BAUD_CODES, BAUD_CODES_OF
from motorbus.families.feetech_new.simulator.bus import USUAL_RATE, FeetechBus
from motorbus.families.feetech_new.simulator.models import MODELS, Model, models
from motorbus.families.feetech_new.simulator.quirks import Quirks
from motorbus.families.feetech_new.simulator.servo import Servo

__all__ = ["MODELS", "OPTIONS", "FeetechBus", "Model", "Quirks", "Servo", "simulate"]

OPTIONS = (
    Option("position", int, 2048, "their first position, raw counts; left out: the middle"),
    *quirk_options(Quirks),
)
"""Options of a simulated bus, beside ids and model."""


def simulate(ids: Iterable[int], model: str = "", /, **options: object) -> FeetechBus:
    """A simulated bus with these ids, at rest and limp; a repeated id is two servos.

    `model` is the model of all, or one for each id joined by "+"; "" is sts3215. The option `position` may be a mapping
    by id; the others are the fields of `Quirks`, and their values may be text. Raises RequestError for an unknown
    model or option, an invalid value, or no ids.
    """
    position = _position(options.pop("position", None))
    quirks = switched(Quirks, "feetech", options)
    nodes = list(ids)
    found = _with_rate(models(model, quirks.firmware, len(nodes)), quirks.servo_baud)
    bus = FeetechBus(nodes, found, quirks, position)
    for word in quirks.duplicate.replace(",", "+").split("+"):
        if word:
            bus.duplicate(_duplicate(word, nodes))
    return bus


def _position(position: object) -> int | Mapping[int, int] | None:
    if position is None or isinstance(position, Mapping):
        return position
    try:
        return units.whole(str(position))
    except ValueError:
        raise RequestError(f"option position: {position!r} is not a number", expected="0 to 4095") from None


def _duplicate(word: str, ids: Sequence[int]) -> int:
    try:
        id = units.whole(word)
    except ValueError:
        id = -1
    if id not in ids:
        raise RequestError(
            f"option duplicate: {word!r} is none of the ids", expected="ids of this bus, as 3 or 3+5"
        )
    return id


def _with_rate(found: Sequence[Model], rate: int) -> Sequence[Model]:
    """The models with this rate; 0: as shipped, or 1 Mbit/s where they ship with different ones."""
    if not rate and len({one.rate for one in found}) > 1:
        rate = USUAL_RATE
    codes = {rate: code for code, rate in BAUD_CODES.items()}
    made: dict[int, Model] = {}
    for one in found if rate else ():
        if codes[rate] not in BAUD_CODES_OF[one.table.name]:
            raise RequestError(f"a {one.name} has no rate of {rate} bit/s", expected="a rate of its map")
        made.setdefault(id(one), replace(one, stored={"baud_rate": codes[rate]}))
    return [made.get(id(one), one) for one in found]
