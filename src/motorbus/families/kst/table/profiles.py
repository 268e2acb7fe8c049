"""What differs between the makers who speak this protocol, as data: a profile is a table and a few habits.

A driver and a simulator are given a profile and hold no constants of their own, so another maker is another
profile. `kst`, the manual, is the default; the others rest on public drivers for real servos and say so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from motorbus.core.register import Register, RegisterMap
from motorbus.families.kst.table.objects import (
    DEMO,
    FLIGHT,
    KINGMAX,
    KINGMAX_DRIVER,
    KST,
    KST_EXT,
    MANUAL,
    XQPOWER,
    XQPOWER_DRIVER,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """How the servos of one maker, or of one generation, speak the protocol.

    `counts_per_degree` is exact and `limit` the greatest raw position, either way. `status_row` is None where status
    is the manual's command 7, the same frame as the position, which nothing decodes. `current_scale` is A per
    count of the status. `nmt` says how reports (and at XQPOWER motion) are started: "none", "vendor" (CAN id = node,
    `01 00`) or "standard" (CAN id 0, `01 node`). `version_rows` are asked in order. `flash_wait` is how long a node is
    left alone after a save, `mid_point_wait` after a new mid point (s), which is set by writing `mid_point_value`.
    `report_forms` are the ids on which reports come, of "sdo" (0x580 + node) and "pdo" (0x180 + node); `conflicts` is
    where sources disagree.
    """

    name: str
    title: str
    vendor: str
    table: RegisterMap
    counts_per_degree: int
    limit: int
    status_row: Register | None
    current_scale: float
    nmt: str
    version_rows: tuple[Register, ...]
    flash_wait: float
    mid_point_value: int
    mid_point_wait: float
    report_forms: tuple[str, ...]
    source: str
    conflicts: str


_KST = Profile(
    name=KST.name,
    title=KST.title,
    vendor="KST",
    table=KST,
    counts_per_degree=10,
    limit=900,
    status_row=None,
    current_scale=0.01,
    nmt="none",
    version_rows=(KST["firmware_version"],),
    flash_wait=0.15,
    mid_point_value=0,
    mid_point_wait=0.15,
    report_forms=(),
    source=f"{MANUAL}; the wait after a save: {FLIGHT}",
    conflicts="commands 6 and 7 of the manual, position and status, are one and the same frame; it prints ids of four "
    "bytes and calls the frames standard ones",
)
_KST_EXT = replace(
    _KST,
    name=KST_EXT.name,
    title=KST_EXT.title,
    table=KST_EXT,
    limit=1000,
    status_row=KST_EXT["status"],
    nmt="vendor",
    version_rows=(KST_EXT["firmware_version"], KST_EXT["software_version"]),
    report_forms=("sdo",),
    source=f"{FLIGHT}; {DEMO}; the rest: {MANUAL}",
    conflicts="range ±100° where the manual has ±90°; status at 0x6005 where the manual has 0x6002; version at 0x100B "
    "where the manual has 0x100A; the demo driver uses 29-bit ids, the others 11-bit ones",
)
_KINGMAX = replace(
    _KST_EXT,
    name=KINGMAX.name,
    title=KINGMAX.title,
    vendor="Kingmax",
    table=KINGMAX,
    status_row=KINGMAX["status"],
    version_rows=(KINGMAX["firmware_version"], KINGMAX["software_version"]),
    source=f"{KINGMAX_DRIVER} for position, status and scale; the rest is taken over from kst-ext",
    conflicts="that range, start rule and configuration objects are those of kst-ext is an assumption",
)
_XQPOWER = replace(
    _KST_EXT,
    name=XQPOWER.name,
    title=XQPOWER.title,
    vendor="XQPOWER",
    table=XQPOWER,
    counts_per_degree=18,
    limit=800,
    status_row=XQPOWER["status"],
    current_scale=0.001,
    nmt="standard",
    version_rows=(XQPOWER["firmware_version"],),
    mid_point_value=1,
    mid_point_wait=0.5,
    report_forms=("sdo", "pdo"),
    source=f"{XQPOWER_DRIVER}; node id, bit rate, save and version are taken over from the {MANUAL}",
    conflicts="18 counts per degree and 1 mA where the others have 10 and 0.01 A; position writes are ignored until "
    "it has been started; the firmware driver writes everything by 0x22, the tools 0x2200 and 0x3009 with a length",
)

PROFILES: Final[Mapping[str, Profile]] = MappingProxyType(
    {profile.name: profile for profile in (_KST, _KST_EXT, _KINGMAX, _XQPOWER)}
)
"""Every profile by its name; the first is the default."""
TABLES: Final[Mapping[str, RegisterMap]] = MappingProxyType(
    {profile.name: profile.table for profile in PROFILES.values()}
)
"""Every object dictionary by the name of its profile."""
