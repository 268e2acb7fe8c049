"""Between what the servo counts and what the API says, exactly where binary fractions would be off by a count.

10.85° is 108.5 counts and must become 109, but in radians and back it is 108.49999999999999. So the noise of binary
arithmetic, far below a millionth of a count, is taken off before the one rounding that decides.
"""

from __future__ import annotations

from decimal import ROUND_HALF_UP, Decimal
from math import degrees, isfinite

from motorbus.core.register import Register
from motorbus.errors import RequestError
from motorbus.families.kst.table.profiles import Profile

_BLANK = "\0 "


def to_raw(profile: Profile, radians: float, row: str = "goal_position") -> int:
    """An angle (rad) -> the nearest raw value of this row; half a count goes away from zero.

    The bounds are those of the row, after rounding. Raises RequestError for what is outside them or no finite number.
    """
    entry = profile.table[row]
    counts = profile.counts_per_degree * degrees(radians)
    if not isfinite(counts):
        what = "out of range" if isfinite(radians) else "not a finite angle"
        raise RequestError(f"{row}: {radians} rad is {what}", advice="give a number; nothing was sent")
    raw = int(Decimal(f"{counts:.6f}").to_integral_value(ROUND_HALF_UP))
    if not entry.low <= raw <= entry.high:
        raise _outside(profile, entry, counts)
    return raw


def _outside(profile: Profile, entry: Register, counts: float) -> RequestError:
    low, high = (f"{bound / profile.counts_per_degree:.6g}°" for bound in (entry.low, entry.high))
    return RequestError(
        f"{entry.name}: {counts / profile.counts_per_degree:.6g}° is out of range {low} to {high}",
        expected=f"{low} to {high} (raw {entry.low} to {entry.high}) by the profile {profile.name}",
        advice="give an angle inside the range, or the profile of this servo; nothing was sent",
    )


def text(row: Register, raw: int) -> str:
    """What a version row says, from its raw value: see `version`."""
    return version(raw.to_bytes(row.size, "little"))


def version(data: bytes) -> str:
    """The bytes of a version, in the order they came, as text without NUL and space around it; else in hex."""
    letters = data.decode("latin-1").strip(_BLANK)
    if letters and letters.isascii() and letters.isprintable():
        return letters
    return data.hex(" ").upper()


def current(profile: Profile, raw: int) -> float:
    """The current in A, from the raw value of `status`. Raises RequestError when the profile has no such row."""
    return (_status(profile, raw) & 0xFFFF) * profile.current_scale


def temperature(profile: Profile, raw: int) -> int:
    """The temperature in °C, from the raw value of `status`. Raises RequestError when the profile has no such row."""
    byte = _status(profile, raw) >> 16 & 0xFF
    return byte - 256 if byte > 127 else byte


def _status(profile: Profile, raw: int) -> int:
    if profile.status_row is None:
        raise RequestError(
            f"the profile {profile.name} does not say what a status means",
            cause="the manual leaves its two bytes open, and reads them by the frame that reads the position",
            advice="take them as they come, or choose the profile of a newer servo (kst-ext, kingmax, xqpower)",
        )
    return raw
