"""How real FEETECH servos behave, byte for byte: STS3215 with firmware 3.10, and every doubt a named switch.

Each behaviour says in the code who observed it. The simulator knows the wire and the table and never the driver;
time comes in as an argument. What it leaves out: heat, stall, backlash and steady error under load, the bootloader
itself, and bytes that collide with the host's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from motorbus.core.family import Option
from motorbus.core.switches import options as switches_of
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.bus import FeetechBus
from motorbus.families.feetech.simulator.model import MODELS, Model, model
from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.switches import Switches

OPTIONS = (
    Option("position", int, 2048, "where the servos stand at first, in raw counts"),
    *switches_of(Switches),
)
"""What a bus string may say of a simulated FEETECH bus beside ids and model."""


def simulate(ids: Iterable[int], model_name: str = "", /, **options: object) -> FeetechBus:
    """A simulated bus with these ids, all of one model ("" is sts3215), at rest and limp.

    The option `position` is where they stand in raw counts, for all or as a mapping by id; the others are the
    fields of `Switches`, also as text. Raises RequestError for an unknown model or option, an impossible value,
    or no ids.
    """
    position = _position(options.pop("position", None))
    switches = switched(Switches, "feetech", options)
    return FeetechBus(ids, model(model_name), position=position, switches=switches)


def _position(position: object) -> int | Mapping[int, int] | None:
    if position is None or isinstance(position, Mapping):
        return position
    try:
        return int(str(position))
    except ValueError:
        raise RequestError(
            f"option position: {position!r} is not a raw position", expected="0 to 4095"
        ) from None


__all__ = ["MODELS", "OPTIONS", "FeetechBus", "Model", "Servo", "Switches", "model", "simulate"]
