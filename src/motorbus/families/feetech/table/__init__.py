"""What can be addressed in FEETECH servos: the six register maps, and how to tell which one a servo has."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from motorbus.core.register import RegisterMap
from motorbus.families.feetech.table.codes import (
    ALARM_BITS,
    ALARM_BITS_OF,
    BAUD_CODES,
    BAUD_CODES_OF,
    FIRMWARE,
    MODELS,
    Choice,
    Model,
    alarms,
    choose,
    map_for,
    model_number,
)
from motorbus.families.feetech.table.control import CONTROL, Control, Middle, Mode, mode_of
from motorbus.families.feetech.table.hls import HLS
from motorbus.families.feetech.table.phase import PHASE_BITS, tells_current, velocity_scale, zero_is_maximum
from motorbus.families.feetech.table.scs import SCS, SCS2, SCS_COUNT
from motorbus.families.feetech.table.sms import SMBL, SMCL
from motorbus.families.feetech.table.sts import AMPERE, COUNT, STS

TABLES: Final[Mapping[str, RegisterMap]] = MappingProxyType(
    {table.name: table for table in (STS, SMBL, SMCL, SCS, SCS2, HLS)}
)
"""Every register map by its name."""

__all__ = [
    "ALARM_BITS",
    "ALARM_BITS_OF",
    "AMPERE",
    "BAUD_CODES",
    "BAUD_CODES_OF",
    "CONTROL",
    "COUNT",
    "FIRMWARE",
    "HLS",
    "MODELS",
    "PHASE_BITS",
    "SCS",
    "SCS2",
    "SCS_COUNT",
    "SMBL",
    "SMCL",
    "STS",
    "TABLES",
    "Choice",
    "Control",
    "Middle",
    "Mode",
    "Model",
    "alarms",
    "choose",
    "map_for",
    "mode_of",
    "model_number",
    "tells_current",
    "velocity_scale",
    "zero_is_maximum",
]
