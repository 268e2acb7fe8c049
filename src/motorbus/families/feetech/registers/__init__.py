"""The six register maps of FEETECH servos."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from motorbus.core.register import RegisterMap
from motorbus.families.feetech.registers.hls import HLS
from motorbus.families.feetech.registers.scs import SCS, SCS2
from motorbus.families.feetech.registers.sms import SMBL, SMCL
from motorbus.families.feetech.registers.sts import STS

__all__ = ["HLS", "SCS", "SCS2", "SMBL", "SMCL", "STS", "TABLES"]

TABLES: Final[Mapping[str, RegisterMap]] = MappingProxyType(
    {table.name: table for table in (STS, SMBL, SMCL, SCS, SCS2, HLS)}
)
"""Every register map by its name."""
