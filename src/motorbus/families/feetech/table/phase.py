"""What the phase byte (register 18, "setting byte" in some maps) says, which is another thing in each family.

In STS servos its bit 2 decides the unit of every velocity, so the same number means fifty times as much in one servo
as in the next. In HLS servos the same bit is a property of the bridge, and the unit is fixed.
Source: FEETECH notes on special bytes of STS, HLS and SCS servos. Nobody has published the bits of SMS servos: SMBL,
whose map is laid out as the STS map, is taken to have the same, SMCL to have none.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_STS: Final[Mapping[int, str]] = {
    0: "drive direction reversed",
    1: "brushed motor (takes effect after a restart)",
    2: "velocity in units of 1 count/s (else 50)",
    3: "velocity 0 means maximum (else stop)",
    4: "position feedback over many turns (else one)",
    5: "integrated bridge: low voltage sampling, no current feedback",
    6: "PWM at 16 kHz (else 24 kHz)",
    7: "position feedback reversed",
}
_HLS: Final[Mapping[int, str]] = {
    0: "current drive phase reversed (ignored from firmware 3.42 on)",
    1: "current feedback phase reversed",
    2: "bridge phase",
    3: "velocity feedback phase reversed",
    4: "position feedback over many turns (else one)",
    5: "bridge type",
    6: "PWM at 16 kHz (else 24 kHz)",
    7: "position feedback reversed",
}
_SCS: Final[Mapping[int, str]] = {
    0: "drive direction reversed",
    3: "velocity 0 means maximum (else stop)",
    5: "PWM phase",
    6: "voltage sampling for high voltage (else low)",
}

PHASE_BITS: Final[Mapping[str, Mapping[int, str]]] = MappingProxyType(
    {"sts": _STS, "smbl": _STS, "smcl": {}, "scs": _SCS, "scs2": _SCS, "hls": _HLS}
)
"""Map -> bit -> what it says when it is set."""

_UNIT: Final = 2
_ZERO: Final = 3
_TURNS: Final = 4
_NO_CURRENT: Final = 5


def velocity_scale(phase: int, register_map: str = "sts") -> int:
    """What the rows say of a velocity, times this: 50 where bit 2 decides the unit and is clear, else 1.

    The rows of STS and SMBL hold for 1 count/s (as an STS3215 ships: phase 12); those of HLS for 50 counts/s always.
    """
    return 50 if _says(_STS[_UNIT], _UNIT, register_map) and not phase >> _UNIT & 1 else 1


def zero_is_maximum(phase: int, register_map: str = "sts") -> bool:
    """Whether a goal velocity of 0 means "as fast as it can" (bit 3); else, and always on HLS, it means standstill."""
    return _says(_STS[_ZERO], _ZERO, register_map) and bool(phase >> _ZERO & 1)


def many_turns_are_told(phase: int, register_map: str = "sts") -> bool:
    """Whether the present position is counted over many turns (bit 4); else it begins anew with every turn."""
    return _says(_STS[_TURNS], _TURNS, register_map) and bool(phase >> _TURNS & 1)


def with_many_turns_told(phase: int, told: bool) -> int:
    """This phase byte of a servo with that one bit set or cleared (bit 4); all others stay as they are."""
    return phase | 1 << _TURNS if told else phase & ~(1 << _TURNS)


def tells_current(phase: int, register_map: str = "sts") -> bool:
    """Whether the present current means anything: not with the integrated bridge of STS (bit 5), nor on SCS."""
    if register_map == "scs":
        return False
    return not (_says(_STS[_NO_CURRENT], _NO_CURRENT, register_map) and phase >> _NO_CURRENT & 1)


def _says(meaning: str, bit: int, register_map: str) -> bool:
    return PHASE_BITS[register_map].get(bit) == meaning
