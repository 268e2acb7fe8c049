"""How real FEETECH servos behave, byte for byte: every known model of all six maps, and every doubt a named switch.

Each behaviour says in the code who observed it. The simulator knows the wire and the table and never the driver;
time comes in as an argument.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from motorbus.core import units
from motorbus.core.family import Option
from motorbus.core.switches import options as switches_of
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.bus import FeetechBus
from motorbus.families.feetech.simulator.model import MODELS, Model, model, models
from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import BAUD_CODES, BAUD_CODES_OF

_COMMON_RATE = 1_000_000

OPTIONS = (
    Option("position", int, 2048, "where the servos stand at first, in raw counts; left out: in the middle"),
    *switches_of(Switches),
)
"""What a bus string may say of a simulated FEETECH bus beside ids and model."""


def simulate(ids: Iterable[int], model_name: str = "", /, **options: object) -> FeetechBus:
    """A simulated bus with these ids, at rest and limp.

    `model_name` is the model of all, or as many joined by "+" as there are ids; "" is sts3215. The option `position` is
    where they stand in raw counts, for all or as a mapping by id; the others are the fields of `Switches`, also as
    text. Raises RequestError for an unknown model or option, an impossible value, or no ids.
    """
    position = _position(options.pop("position", None))
    switches = switched(Switches, "feetech", options)
    numbers = list(ids)
    kinds = models(model_name, switches.firmware, numbers)
    twins = [_twin(word, numbers) for word in switches.duplicate.replace(",", "+").split("+") if word]
    kinds += [kinds[numbers.index(twin)] for twin in twins]
    rated = _rated(kinds, switches.servo_baud)
    bus = FeetechBus([*numbers, *twins], rated, position=position, switches=switches)
    bus.twins = frozenset(bus.servos[len(numbers) :])
    return bus


def _position(position: object) -> int | Mapping[int, int] | None:
    if position is None or isinstance(position, Mapping):
        return position
    try:
        return units.whole(str(position))
    except ValueError:
        raise RequestError(
            f"option position: {position!r} is not a raw position", expected="0 to 4095"
        ) from None


def _twin(word: str, ids: Sequence[int]) -> int:
    try:
        id = units.whole(word)
    except ValueError:
        id = -1
    if id not in ids:
        raise RequestError(
            f"option duplicate: {word!r} is none of the ids", expected="ids of this bus, as 3 or 3+5"
        )
    return id


def _rated(kinds: Sequence[Model], wish: int) -> list[Model]:
    """The models with this rate. 0: as shipped, unless they ship unlike, since a bus has one rate."""
    shipped = {one.shipped_rate for one in kinds}
    rate = wish or (_COMMON_RATE if len(shipped) > 1 else 0)
    if not rate:
        return list(kinds)
    made = {id(one): _set_to(one, rate) for one in kinds}
    return [made[id(one)] for one in kinds]


def _set_to(one: Model, rate: int) -> Model:
    code = next(code for code, known in BAUD_CODES.items() if known == rate)
    if code not in BAUD_CODES_OF[one.table.name]:
        raise RequestError(
            f"a {one.name} has no rate of {rate} bit/s", expected="one that its map has a code for"
        )
    return replace(one, set_to={"baud_rate": code})


__all__ = ["MODELS", "OPTIONS", "FeetechBus", "Model", "Servo", "Switches", "model", "simulate"]
