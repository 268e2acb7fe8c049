"""What makes one model differ from another: its register map, its number, its figures.

Source of the figures of the STS3215: its memory table V3.6 (no-load speed 50 rpm = 3400 counts/s, no-load
current 150 mA, 4096 counts a turn); the current register of an STS ends at about 500 units = 3.25 A, which is
taken for the stall.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from motorbus.core.entry import Table
from motorbus.core.plant import Drive
from motorbus.errors import RequestError
from motorbus.families.feetech.table import TABLES


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of servo: `defaults` are the raw values in which it differs from what its table says it ships with."""

    name: str
    table: Table
    turn: int
    drive: Drive
    voltage: float
    defaults: Mapping[str, int] = field(default_factory=dict)


MODELS: Final[Mapping[str, Model]] = MappingProxyType(
    {
        "sts3215": Model(
            name="sts3215",
            table=TABLES["sts"],
            turn=4096,
            drive=Drive(top_speed=3400.0, idle_current=0.15, stall_current=3.25),
            voltage=7.4,
            defaults={
                "firmware_major": 3,
                "firmware_minor": 10,
                "byte_order": 0,
                "model_major": 9,
                "model_minor": 3,
            },
        )
    }
)
"""Every model that can be simulated, by its name in lower case."""


def model(name: str) -> Model:
    """The model of this name, "" being the usual one. Raises RequestError when there is none."""
    try:
        return MODELS[name.lower() or "sts3215"]
    except KeyError:
        raise RequestError(
            f"there is no simulated FEETECH model {name!r}", expected=f"one of {', '.join(MODELS)}"
        ) from None
