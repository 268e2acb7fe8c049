"""Object dictionaries and profiles of the makers that share this protocol, and exact conversion of angles.

`KST` holds the objects of the KST CAN protocol manual. The other dictionaries are derived from it, and each difference
names the public driver that it was read from: programs that drive real servos, not vendor documents. Where sources
disagree, `conflict` says which source says what, and what was chosen. A `Profile` adds the habits of a maker. No servo
reports its maker, so a bus is opened with a profile (`kst:PORT,profile=xqpower`).

Sizes are those of the replies that the manual prints, else of what the drivers send: the writes of the manual
(specifier 0x22) state no length.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import ROUND_HALF_UP, Decimal
from functools import partial
from math import degrees, isfinite, pi
from typing import Final

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage, changed
from motorbus.core.request import Effect
from motorbus.errors import RequestError

RATES: Final = (20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""bit/s by the code of object 0x3001 (KST CAN protocol manual, command 1).

Neither the numbers of slcan nor those of CiA 305 LSS.
"""
DEFAULT_NODE: Final = 0x25
DEFAULT_RATE: Final = 500_000  # bit/s as shipped; the manual adds "provisional"
SAVE: Final = int.from_bytes(b"save", "little")
"""What is written to `store`: the letters "save", the first in the lowest byte (CiA 301, object 1010h)."""
VERSIONS: Final = ("firmware_version", "software_version")
REVERSED: Final = 5  # the bit of `function_enable` that turns the sense of rotation round

MANUAL: Final = "KST CAN protocol manual"
AUTOPILOT: Final = "public autopilot driver for KST servos"
AUTOPILOT_2: Final = "second public autopilot driver for KST servos"
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
        conflict="manual: four letters; CiA 301: text of any length, sent in segments. Chosen: four letters",
        note="first letter in the lowest byte; newer firmware may follow CiA 301 or have its version in 0x100B",
    ),
    _kept(
        name="store", address=0x1010, subindex=1, size=4, access=Access.WRITE, high=0xFFFFFFFF, protected=True,
        choices={SAVE: "save"}, source=f"{MANUAL}, command 3; CiA 301, object 1010h",
        conflict="manual: no reply; CiA 301: a reply. Chosen: a reply is accepted and not required",
        note="keeps node id and bit rate (and travel limits and function bits), never the goal position",
    ),
    _kept(
        name="node_id", address=0x3000, low=1, high=127, default=DEFAULT_NODE, effect=Effect.IDENTITY,
        protected=True, source=f"{MANUAL}, commands 2 and 4 and defaults",
        note="takes effect after a save and a restart; that a read gives the new id earlier is an assumption",
    ),
    _kept(
        name="bit_rate_code", address=0x3001, access=Access.WRITE, high=7, default=5, effect=Effect.IDENTITY,
        protected=True, choices={code: f"{rate} bit/s" for code, rate in enumerate(RATES)},
        source=f"{MANUAL}, command 1 and defaults",
        note="takes effect after a save and a restart; the manual has no command that reads it",
    ),
    _angle(
        name="present_position", address=0x6002, access=Access.READ, storage=Storage.RAM, low=-900, high=900,
        source=f"{MANUAL}, command 6",
        conflict="manual, command 7: the same frame reads the status; four public drivers read the status at 0x6005. "
        "Chosen: the position, as in command 6",
    ),
    _angle(
        name="goal_position", address=0x6003, access=Access.READ_WRITE, storage=Storage.RAM, low=-900, high=900,
        effect=Effect.MOTION, source=f"{MANUAL}, command 5",
        note="acts at once; a restart sets a default that the manual does not state. The manual shows the write only",
    ),
)  # fmt: skip

_LATER_ROWS = (
    _version(
        name="software_version", address=0x100B, source=DEMO,
        conflict="manual: the version is in 0x100A; demo driver: in 0x100B. Chosen: both are read",
    ),
    Register(
        name="report_interval", address=0x2200, subindex=0, size=1, access=Access.WRITE, storage=Storage.RAM,
        low=1, high=255, unit="s", scale=0.001, source=DEMO,
        note="what 0 does is not known",
    ),
    _kept(
        name="mid_point", address=0x3009, size=4, access=Access.WRITE, high=1, protected=True,
        source=DEMO,
        note="makes the present position the zero; needs a save. The demo driver writes 0. The length is that of the "
        "one sized write seen (0x23), to a servo of XQPOWER",
    ),
    *(
        _angle(
            name=name, address=address, access=Access.READ_WRITE, storage=Storage.EEPROM,
            low=low, high=low + 1000, effect=Effect.PERSISTENT, source=AUTOPILOT,
            note="needs a save; in reversed sense a change of one limit changes the other too",
        )
        for name, address, low in (("negative_limit", 0x300A, -1000), ("positive_limit", 0x300B, 0))
    ),
    _kept(
        name="function_enable", address=0x300F, high=255, protected=True, bits={REVERSED: "reversed"},
        source=f"{AUTOPILOT}; {DEMO}",
        note="bit 5 reverses the sense; the other bits are unknown, so only read-modify-write; a write may fail, or be "
        "undone by a restart",
    ),
    Register(
        name="status", address=0x6005, subindex=0, size=4, access=Access.READ, storage=Storage.RAM,
        high=0xFFFFFFFF, source=f"{AUTOPILOT}; {DEMO}",
        conflict="manual: status at 0x6002; four public drivers: at 0x6005. Chosen: 0x6005",
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
    *_reaching(KST, 1000, pi / 1800, f"{AUTOPILOT}; {AUTOPILOT_2}; {DEMO}"),
    title="KST CAN servo with newer firmware",
)
KINGMAX: Final = KST_EXT.derive(
    "kingmax", changed(KST_EXT["status"], source=KINGMAX_DRIVER), title="Kingmax CAN servo"
)
XQPOWER: Final = KST_EXT.derive(
    "xqpower",
    changed(
        KST_EXT["report_interval"], low=10, source=XQPOWER_DRIVER,
        note="the servo raises less than 10 ms to 10 ms",
    ),
    changed(
        KST_EXT["mid_point"], source=XQPOWER_DRIVER,
        conflict="PX4 module: 1 without a length; tools: four bytes with a length. Chosen: the tools",
        note="makes the present position the zero; needs a save",
    ),
    changed(
        KST_EXT["status"], source=XQPOWER_DRIVER, conflict="",
        note="bytes 0 and 1 current (1 mA, unsigned), byte 2 temperature (°C, signed), byte 3 unused",
    ),
    *_reaching(KST, 800, pi / 3240, f"{XQPOWER_DRIVER} (18 counts per degree, by test on hardware)"),
    without=("software_version", "negative_limit", "positive_limit", "function_enable"),
    title="XQPOWER CAN servo",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """How the servos of one maker, or of one generation, speak the protocol.

    `counts_per_degree` is exact. `current_scale` is A per count of the status. `nmt` says how reports (and at XQPOWER
    motion) are started: "none", "vendor" (CAN id = node, `01 00`) or "standard" (CAN id 0, `01 node`).
    `mid_point_value` is written to make the present position the zero. `conflicts` is where sources disagree.
    """

    table: RegisterMap
    counts_per_degree: int = 10
    current_scale: float = 0.01
    nmt: str
    mid_point_value: int = 0
    source: str
    conflicts: str

    @property
    def name(self) -> str:
        return self.table.name

    @property
    def limit(self) -> int:
        """The largest raw position, either way."""
        return self.table["goal_position"].high


_KST = Profile(
    table=KST,
    nmt="none",
    source=f"{MANUAL}; the wait after a save: {AUTOPILOT}",
    conflicts="the manual has one frame for position (command 6) and status (command 7); it prints CAN ids of four "
    "bytes and calls the frames standard",
)
_KST_EXT = replace(
    _KST,
    table=KST_EXT,
    nmt="vendor",
    source=f"{AUTOPILOT}; {DEMO}; the rest: {MANUAL}",
    conflicts="range ±100° where the manual has ±90°; status at 0x6005 where the manual has 0x6002; version at 0x100B "
    "where the manual has 0x100A; the demo driver uses 29-bit ids, the others 11-bit ones",
)
_KINGMAX = replace(
    _KST_EXT,
    table=KINGMAX,
    source=f"{KINGMAX_DRIVER} for position, status and scale; the rest is taken over from kst-ext",
    conflicts="range, start and configuration objects are assumed to be those of kst-ext",
)
_XQPOWER = replace(
    _KST_EXT,
    table=XQPOWER,
    counts_per_degree=18,
    current_scale=0.001,
    nmt="standard",
    mid_point_value=1,
    source=f"{XQPOWER_DRIVER}; node id, bit rate, save and version are taken over from the {MANUAL}",
    conflicts="18 counts per degree and 1 mA where the others have 10 and 0.01 A; position writes are ignored until "
    "it has been started; the firmware driver writes everything by 0x22, the tools 0x2200 and 0x3009 with a length",
)

PROFILES: Final[Mapping[str, Profile]] = {
    profile.name: profile for profile in (_KST, _KST_EXT, _KINGMAX, _XQPOWER)
}
"""Every profile by its name; the first is the default."""
TABLES: Final[Mapping[str, RegisterMap]] = {name: profile.table for name, profile in PROFILES.items()}
"""Every object dictionary by the name of its profile."""


# -- values ----------------------------------------------------------------------------------------------------


def to_raw(profile: Profile, radians: float, row: str = "goal_position") -> int:
    """Angle (rad) -> nearest raw value of this row; half a count rounds away from zero, exactly as in decimal.

    10.85° is 108.5 counts and must become 109; in binary radians it is 108.49999999999999, so the value is first
    rounded to a millionth of a count. Raises RequestError outside the range of the row.
    """
    register = profile.table[row]
    counts = profile.counts_per_degree * degrees(radians)
    if isfinite(counts):
        raw = int(Decimal(f"{counts:.6f}").to_integral_value(ROUND_HALF_UP))
        if register.low <= raw <= register.high:
            return raw
    low, high = (f"{end / profile.counts_per_degree:.6g}°" for end in (register.low, register.high))
    raise RequestError(
        f"{row}: {degrees(radians):.6g}° is out of range {low} to {high}",
        expected=f"raw {register.low} to {register.high} by the profile {profile.name}",
        advice="give an angle inside the range, or the profile of this servo",
    )


def version_text(data: bytes) -> str:
    """The bytes of a version as text, without NUL and space at its ends; as hex where it is no text."""
    letters = data.decode("latin-1").strip("\0 ")
    if letters and letters.isascii() and letters.isprintable():
        return letters
    return data.hex(" ").upper()


def current(profile: Profile, raw: int) -> float:
    """Supply current (A) in the raw value of `status`."""
    return (raw & 0xFFFF) * profile.current_scale


def temperature(raw: int) -> int:
    """Temperature (°C) in the raw value of `status`."""
    return (raw >> 16 & 0xFF ^ 0x80) - 0x80


def bit_rate_code(rate: int) -> int:
    """Code of a bit rate (bit/s). Raises RequestError for a rate without a code."""
    if rate in RATES:
        return RATES.index(rate)
    raise RequestError(
        f"{rate!r} bit/s is no rate of these servos", expected=f"one of {', '.join(map(str, RATES))}"
    )
