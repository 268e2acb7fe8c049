"""What can be addressed in KST CAN servos and their kin: object dictionaries, profiles, and exact conversion."""

from __future__ import annotations

from motorbus.families.kst.table.objects import (
    BIT_RATES,
    DEFAULT_NODE,
    DEFAULT_RATE,
    KINGMAX,
    KST,
    KST_EXT,
    RATES,
    REVERSED,
    SAVE,
    XQPOWER,
)
from motorbus.families.kst.table.profiles import PROFILES, TABLES, Profile
from motorbus.families.kst.table.values import current, temperature, text, to_raw, version

__all__ = [
    "BIT_RATES",
    "DEFAULT_NODE",
    "DEFAULT_RATE",
    "KINGMAX",
    "KST",
    "KST_EXT",
    "PROFILES",
    "RATES",
    "REVERSED",
    "SAVE",
    "TABLES",
    "XQPOWER",
    "Profile",
    "current",
    "temperature",
    "text",
    "to_raw",
    "version",
]
