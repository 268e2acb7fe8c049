"""The objects of a KST CAN servo row by row: what the manual has, and what real drivers add to it.

`KST` is the KST CAN protocol manual and nothing else. The later tables are that table plus differences, and each
difference names the public driver it was read from: those are programs that drive real servos, not vendor
documents. Where sources disagree, `conflict` says who says what, and what was chosen.

Every write of the manual uses specifier 0x22, which does not tell the length of the value; the sizes of its rows
come from the replies it prints, those of the others from what the drivers send.
"""

from __future__ import annotations

from functools import partial
from math import pi
from types import MappingProxyType
from typing import Final

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage, changed
from motorbus.core.request import Effect

BIT_RATES: Final = MappingProxyType(
    dict(enumerate((20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)))
)
"""Bit-rate code of object 0x3001 -> bit/s (KST CAN protocol manual, command 1).

Neither the numbers of slcan's `Sn` nor those of CiA 305 LSS, which both count otherwise.
"""
RATES: Final[tuple[int, ...]] = tuple(BIT_RATES.values())
DEFAULT_NODE: Final = 0x25
DEFAULT_RATE: Final = 500_000
"""Bit/s as shipped; the manual adds "provisional"."""
SAVE: Final = int.from_bytes(b"save", "little")
"""What is written to `store`: the letters "save", the first in the lowest byte (CiA 301, object 1010h)."""
REVERSED: Final = 5
"""The bit of `function_enable` that turns the sense of rotation round."""

MANUAL: Final = "KST CAN protocol manual"
FLIGHT: Final = "public flight-controller driver for KST servos"
FLIGHT_2: Final = "second public flight-controller driver for KST servos"
DEMO: Final = "public STM32 demo driver for KST servos"
KINGMAX_DRIVER: Final = "public ESP32 driver for the Kingmax BLS4510S"
XQPOWER_DRIVER: Final = "public PX4 module and tools for XQPOWER servos, after the vendor's can-sd-v022"

_kept = partial(
    Register, size=1, access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.PERSISTENT, subindex=0
)
_angle = partial(Register, size=2, subindex=0, coding=Coding.TWOS_COMPLEMENT, unit="rad", scale=pi / 1800)
_version = partial(
    Register, size=4, subindex=0, access=Access.READ, storage=Storage.FACTORY, high=0xFFFFFFFF, protected=True
)

_MANUAL_ROWS = (
    _version(
        name="firmware_version", address=0x100A, source=f"{MANUAL}, command 8",
        conflict="the manual: four letters; CiA 301: text of any length, sent in segments. Chosen: four letters",
        note="the first letter in the lowest byte; newer firmware may do as CiA 301; some has its version in 0x100B",
    ),
    _kept(
        name="store", address=0x1010, subindex=1, size=4, access=Access.WRITE, high=0xFFFFFFFF, protected=True,
        choices={SAVE: "save"}, source=f"{MANUAL}, command 3; CiA 301, object 1010h",
        conflict="the manual: it is not answered; CiA 301 demands an answer. Chosen: one that comes is accepted",
        note="keeps node id and bit rate (and travel limits and function bits), never the goal position",
    ),
    _kept(
        name="node_id", address=0x3000, low=1, high=127, default=DEFAULT_NODE, effect=Effect.IDENTITY,
        protected=True, source=f"{MANUAL}, commands 2 and 4 and defaults",
        note="takes effect when saved and restarted; that reading it gives the new id before that is an assumption",
    ),
    _kept(
        name="bit_rate_code", address=0x3001, access=Access.WRITE, high=7, default=5, effect=Effect.IDENTITY,
        protected=True, choices={code: f"{rate} bit/s" for code, rate in BIT_RATES.items()},
        source=f"{MANUAL}, command 1 and defaults",
        note="takes effect when saved and restarted; the manual has no command that reads it",
    ),
    _angle(
        name="present_position", address=0x6002, access=Access.READ, storage=Storage.RAM, low=-900, high=900,
        source=f"{MANUAL}, command 6",
        conflict="the manual, command 7: the status, by this very frame and with an answer alike; four public drivers "
        "read that at 0x6005. Chosen: the position, as in command 6",
    ),
    _angle(
        name="goal_position", address=0x6003, access=Access.READ_WRITE, storage=Storage.RAM, low=-900, high=900,
        effect=Effect.MOTION, source=f"{MANUAL}, command 5",
        note="acts at once and is back at a default after a restart, which the manual does not give; the manual "
        "shows the write only",
    ),
)  # fmt: skip

_LATER_ROWS = (
    _version(
        name="software_version", address=0x100B, source=DEMO,
        conflict="the manual: the version is in 0x100A; the demo driver: here. Chosen: both are asked",
    ),
    Register(
        name="report_interval", address=0x2200, subindex=0, size=1, access=Access.WRITE, storage=Storage.RAM,
        low=1, high=255, unit="s", scale=0.001, source=DEMO,
        note="what 0 does is not known",
    ),
    _kept(
        name="mid_point", address=0x3009, size=4, access=Access.WRITE, high=1, protected=True,
        source=DEMO,
        note="makes the present position the zero, and is then to be saved; the demo driver writes 0. The length is "
        "that of the one sized write seen (0x23), to a servo of XQPOWER",
    ),
    _angle(
        name="negative_limit", address=0x300A, access=Access.READ_WRITE, storage=Storage.EEPROM,
        low=-1000, high=0, effect=Effect.PERSISTENT, source=FLIGHT,
        note="to be saved; while the sense is reversed a change of one limit changes the other too",
    ),
    _angle(
        name="positive_limit", address=0x300B, access=Access.READ_WRITE, storage=Storage.EEPROM,
        low=0, high=1000, effect=Effect.PERSISTENT, source=FLIGHT,
        note="to be saved; while the sense is reversed a change of one limit changes the other too",
    ),
    _kept(
        name="function_enable", address=0x300F, high=255, protected=True, bits={REVERSED: "reversed"},
        source=f"{FLIGHT}; {DEMO}",
        note="the other bits are unknown, so only read-modify-write; a write may fail, or be undone by a restart",
    ),
    Register(
        name="status", address=0x6005, subindex=0, size=4, access=Access.READ, storage=Storage.RAM,
        high=0xFFFFFFFF, source=f"{FLIGHT}; {DEMO}",
        conflict="the manual reads a status at 0x6002; four public drivers here. Chosen: here",
        note="bytes 0 and 1 current (0.01 A, unsigned), byte 2 temperature (°C, signed), byte 3 unused",
    ),
)  # fmt: skip


def _reaching(table: RegisterMap, limit: int, scale: float, source: str) -> tuple[Register, ...]:
    """The two position rows with another range and scale, and who says so."""
    rows = (table["present_position"], table["goal_position"])
    return tuple(
        changed(row, low=-limit, high=limit, scale=scale, source=f"{row.source}; range: {source}")
        for row in rows
    )


KST: Final = RegisterMap("kst", _MANUAL_ROWS, title="KST CAN servo, as its protocol manual says")
KST_EXT: Final = KST.derive(
    "kst-ext",
    *_LATER_ROWS,
    *_reaching(KST, 1000, pi / 1800, f"{FLIGHT}; {FLIGHT_2}; {DEMO}"),
    title="KST CAN servo with newer firmware",
)
KINGMAX: Final = KST_EXT.derive(
    "kingmax", changed(KST_EXT["status"], source=KINGMAX_DRIVER), title="Kingmax CAN servo"
)
XQPOWER: Final = KST_EXT.derive(
    "xqpower",
    changed(
        KST_EXT["report_interval"],
        low=10,
        source=XQPOWER_DRIVER,
        note="less than 10 ms is raised to 10 ms by the servo",
    ),
    changed(
        KST_EXT["mid_point"],
        source=XQPOWER_DRIVER,
        conflict="the PX4 module: writes 1 without a length; the tools: four bytes with it. Chosen: the tools",
        note="makes the present position the zero, and is then to be saved",
    ),
    changed(
        KST_EXT["status"],
        source=XQPOWER_DRIVER,
        conflict="",
        note="bytes 0 and 1 current (1 mA, unsigned), byte 2 temperature (°C, signed), byte 3 unused",
    ),
    *_reaching(KST, 800, pi / 3240, f"{XQPOWER_DRIVER} (18 counts per degree, by test on hardware)"),
    without=("software_version", "negative_limit", "positive_limit", "function_enable"),
    title="XQPOWER CAN servo",
)
