"""Small numbers of FEETECH servos: baud codes, alarm bits, bits of the phase byte, each by map.

Baud codes: FEETECH SDK headers SMS_STS.h and SCSCL.h (0 to 7), public headers with twelve codes. Some well-known
libraries give 57600, 38400 and 19200 for the codes 5, 6 and 7; every source of the vendor says 76800, 57600 and 38400.
Alarm bits: STS3215 memory table V3.6, HLS and SCS memory tables. Phase: FEETECH notes on special bytes of STS, HLS and
SCS servos. The phase bits of SMS servos are not published: SMBL, laid out as STS, is taken to have the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_RATES: Final = (
    *(1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800),
    *(57_600, 38_400, 19_200, 14_400, 9_600, 4_800),
)
BAUD_CODES: Final[Mapping[int, int]] = dict(enumerate(_RATES))
"""Value of the baud rate register -> bit/s."""
BAUD_CODES_OF: Final[Mapping[str, range]] = {
    "sts": range(8),
    "smbl": range(12),
    "smcl": range(8),
    "scs": range(11),
    "scs2": range(8),
    "hls": range(8),
}
"""Map -> the codes its servos take, as FD allows them; for SMCL, where FD allows 0 to 254, as the SDK names them."""


def _alarms(defined: int) -> Mapping[int, str]:
    """Names of the alarm bits, of which these are defined."""
    names = ("voltage", "sensor", "temperature", "current", "angle", "overload", "", "")
    return {bit: name if defined >> bit & 1 else f"undefined bit {bit}" for bit, name in enumerate(names)}


ALARM_BITS: Final[Mapping[str, Mapping[int, str]]] = {
    "sts": _alarms(0b0011_1111),
    "smbl": _alarms(0b0011_1111),
    "smcl": _alarms(0b0011_1111),
    "scs": _alarms(0b0010_0101),
    "scs2": _alarms(0b0010_1101),  # assumption: the over-current of its registers 31 and 32 is bit 3
    "hls": _alarms(0b0010_1111),
}
"""Map -> bits of the error byte, of hardware_error and of both masks.

SCS servos have voltage, temperature and overload only. HLS pages and newer STS pages leave bit 4 unused; table V3.6 of
the STS3215 calls it the angle limit.
"""


def alarms(error: int, register_map: str = "sts") -> tuple[str, ...]:
    """The names of all bits that are set in an error byte, undefined ones too; an unknown map reads as STS."""
    bits = ALARM_BITS.get(register_map, ALARM_BITS["sts"])
    return tuple(name for bit, name in bits.items() if error >> bit & 1)


_STS_PHASE: Final[dict[int, str]] = {
    0: "drive direction reversed",
    1: "brushed motor (takes effect after a restart)",
    2: "velocity in units of 1 count/s (else 50)",
    3: "velocity 0 means maximum (else stop)",
    4: "position feedback over many turns (else one)",
    5: "integrated bridge: low voltage sampling, no current feedback",
    6: "PWM at 16 kHz (else 24 kHz)",
    7: "position feedback reversed",
}
_HLS_PHASE: Final = _STS_PHASE | {
    0: "current drive phase reversed (ignored from firmware 3.42 on)",
    1: "current feedback phase reversed",
    2: "bridge phase",
    3: "velocity feedback phase reversed",
    5: "bridge type",
}
_SCS_PHASE: Final[Mapping[int, str]] = {
    0: "drive direction reversed",
    3: "velocity 0 means maximum (else stop)",
    5: "PWM phase",
    6: "voltage sampling for high voltage (else low)",
}
PHASE_BITS: Final[Mapping[str, Mapping[int, str]]] = {
    "sts": _STS_PHASE,
    "smbl": _STS_PHASE,
    "smcl": {},
    "scs": _SCS_PHASE,
    "scs2": _SCS_PHASE,
    "hls": _HLS_PHASE,
}
"""Map -> bit of the phase byte -> its meaning when it is set."""
