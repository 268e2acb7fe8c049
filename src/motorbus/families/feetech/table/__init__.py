"""What can be addressed in FEETECH servos: the register maps, and how to tell which one a servo has."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from motorbus.core.entry import Table
from motorbus.families.feetech.table.codes import (
    ALARM_BITS,
    BAUD_CODES,
    MODELS,
    Model,
    alarms,
    map_for,
    model_number,
    velocity_scale,
)
from motorbus.families.feetech.table.sts import AMPERE, COUNT, STS

TABLES: Final[Mapping[str, Table]] = MappingProxyType({STS.name: STS})
"""Every register map that is described, by its name."""

__all__ = [
    "ALARM_BITS",
    "AMPERE",
    "BAUD_CODES",
    "COUNT",
    "MODELS",
    "STS",
    "TABLES",
    "Model",
    "alarms",
    "map_for",
    "model_number",
    "velocity_scale",
]
