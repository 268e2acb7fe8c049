"""What makes one model differ from another: its register map, its numbers, its supply and its motor.

Every model whose number is known can be simulated. The model number is identity only; what a servo does follows from
its map, which the firmware tells. Variants of one model (supply, gear) share a number, so one of them is simulated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from types import MappingProxyType
from typing import Final

from motorbus.core.plant import Drive
from motorbus.core.register import RegisterMap
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.personality import (
    HIGH_LIMITS,
    HIGH_VOLTAGE,
    MOTORS,
    PERSONALITIES,
    Personality,
)
from motorbus.families.feetech.table import BAUD_CODES, CONTROL, TABLES, Control, map_for
from motorbus.families.feetech.table import MODELS as NUMBERS

_USUAL: Final = "sts3215"


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of servo: `defaults` are the raw values in which it differs from what its table says it ships with.

    `set_to` are raw values that somebody has stored in it since, which a factory restore takes back.
    `turn` is the counts of a turn, `voltage` its supply in V; `control` and `personality` are those of its map.
    """

    name: str
    table: RegisterMap
    turn: int
    drive: Drive
    voltage: float
    control: Control
    personality: Personality
    defaults: Mapping[str, int] = field(default_factory=dict)
    set_to: Mapping[str, int] = field(default_factory=dict)

    @property
    def shipped_rate(self) -> int:
        """The rate that it ships with, in bit/s."""
        code = self.defaults.get("baud_rate", self.table["baud_rate"].default)
        return BAUD_CODES[code or 0]

    @property
    def clears_turns(self) -> bool:
        """Whether it is known to obey 0x0A: HLS, and brushless ones ("STBL" in a public STS3215 table)."""
        return self.control.clear_turns and (self.personality.turns_cleared or self.name.endswith("bl"))


def _models() -> Iterator[tuple[str, Model]]:
    """Every number in each of its maps, by name, the usual ones first."""
    for (major, minor), known in NUMBERS.items():
        for name in known.maps:
            personality = PERSONALITIES[name]
            told = dict(zip(("firmware_major", "firmware_minor"), personality.firmware, strict=True))
            defaults = {**personality.shipped, **told, "model_major": major, "model_minor": minor}
            one = Model(
                name=known.name.lower(),
                table=TABLES[name],
                turn=CONTROL[name].turn,
                drive=MOTORS.get(known.name.lower(), personality.drive),
                voltage=personality.voltage,
                control=CONTROL[name],
                personality=personality,
                defaults=defaults,
            )
            yield one.name, _high_voltage(one) if "hv" in one.name else one


def _high_voltage(one: Model) -> Model:
    return replace(one, voltage=HIGH_VOLTAGE, defaults={**one.defaults, **HIGH_LIMITS})


def _named() -> Mapping[str, list[Model]]:
    found: dict[str, list[Model]] = {}
    for name, one in _models():
        found.setdefault(name, []).append(one)
    return found


_VARIANTS: Final = _named()

MODELS: Final[Mapping[str, Model]] = MappingProxyType({name: known[0] for name, known in _VARIANTS.items()})
"""Every model that can be simulated, by its name in lower case; of several numbers with one name the first."""


def model(name: str, firmware: str = "") -> Model:
    """The model of this name, "" being the usual one, with this firmware ("3.9"; "": one that has its map).

    Where the model occurs with several maps, the firmware chooses; any other changes nothing but what registers 0 and 1
    tell, so that a servo with an unknown one can be simulated. Raises RequestError when there is no such model or the
    firmware is none.
    """
    known = _VARIANTS.get(name.lower() or _USUAL)
    if known is None:
        near = get_close_matches(name.lower(), MODELS, n=3)
        raise RequestError(
            f"there is no simulated FEETECH model {name!r}",
            expected=f"perhaps {', '.join(near)}" if near else f"one of {len(MODELS)}, as {_USUAL}",
            advice="docs/reference/feetech-registers.md lists them",
        )
    if not firmware:
        return known[0]
    major, minor = _version(firmware)
    order = known[0].table["goal_position"].order
    chosen = next((one for one in known if one.table.name == map_for(major, minor, order)), known[0])
    return replace(chosen, defaults={**chosen.defaults, "firmware_major": major, "firmware_minor": minor})


def models(names: str, firmwares: str, ids: Iterable[int]) -> list[Model]:
    """The model of each id, from names and firmwares joined by "+" or ",": one for all, or as many as there are ids.

    Raises RequestError as `model` does, and when the numbers do not agree.
    """
    count = len(list(ids))
    words = _spread("model", names, count)
    versions = _spread("firmware", firmwares, count)
    made: dict[tuple[str, str], Model] = {}
    for pair in zip(words, versions, strict=True):
        if pair not in made:
            made[pair] = model(*pair)
    return [made[pair] for pair in zip(words, versions, strict=True)]


def _spread(what: str, joined: str, count: int) -> list[str]:
    words = joined.replace(",", "+").split("+")
    if len(words) not in (1, count):
        raise RequestError(
            f"{len(words)} {what}s for {count} ids: {joined}",
            expected=f"one {what} for all, or as many as there are ids, joined by +",
        )
    return words if len(words) == count else words * count


def _version(text: str) -> tuple[int, int]:
    major, _, minor = text.partition(".")
    if not (major.isdecimal() and minor.isdecimal() and int(major) < 256 and int(minor) < 256):
        raise RequestError(f"option firmware: {text!r} is not a version", expected="as 3.9")
    return int(major), int(minor)
