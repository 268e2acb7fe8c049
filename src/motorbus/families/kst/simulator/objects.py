"""What it means to read or write each object of a servo: the object dictionary come to life.

Here are values and consequences; who asked, and in which frames, is told in `server.py`. A write that is refused
gives the code of the refusal, by CiA 301 and the manual's list.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from motorbus.families.kst.profiles import BIT_RATES, SAVE
from motorbus.families.kst.simulator.memory import REVERSE

if TYPE_CHECKING:
    from motorbus.families.kst.simulator.servo import Servo

NOT_STORED: Final = 0x08000020
"""CiA 301, object 0x1010: a wrong signature shall be refused with this code."""
RANGE: Final = 0x06090030
TOO_HIGH: Final = 0x06090031
TOO_LOW: Final = 0x06090032
INTERVAL: Final = 20
"""ms between reports as shipped; an assumption: the public drivers expect 50 a second."""


def read(servo: Servo, name: str, at: float) -> int:
    """The raw value a host reads at this moment."""
    return _READ[name](servo, at) if name in _READ else servo.values[name]


def write(servo: Servo, name: str, raw: int, at: float) -> int:
    """Write a raw value; gives the code of the refusal, or 0."""
    if name in _WRITE:
        return _WRITE[name](servo, raw, at)
    row = servo.profile.table[name]
    if not row.low <= raw <= row.high:
        return RANGE
    servo.values[name] = raw
    return 0


# -- reading -------------------------------------------------------------------------------------------------


def _node_id(servo: Servo, at: float) -> int:
    return servo.values["node_id"] if servo.switches.pending_id == "pending" else servo.node


def _present_position(servo: Servo, at: float) -> int:
    return servo.shaft.reading(at)


def _status(servo: Servo, at: float) -> int:
    """Current in counts of the profile (16 bits), temperature in °C (8 bits, signed), one byte unused."""
    scale = servo.profile.current_scale
    current = max(0, min(0xFFFF, round(abs(servo.current(at)) / scale))) if scale else 0
    temperature = max(-128, min(127, round(servo.temperature))) & 0xFF
    return current | temperature << 16


def _firmware(servo: Servo, at: float) -> int:
    return _first_four(servo.switches.firmware)


def _software(servo: Servo, at: float) -> int:
    return _first_four(servo.switches.software)


def _first_four(text: str) -> int:
    return int.from_bytes(text.encode()[:4], "little")


_READ: Final[Mapping[str, Callable[[Servo, float], int]]] = {
    "node_id": _node_id,
    "present_position": _present_position,
    "status": _status,
    "firmware_version": _firmware,
    "software_version": _software,
}


# -- writing -------------------------------------------------------------------------------------------------


def _write_node_id(servo: Servo, raw: int, at: float) -> int:
    """1 to 127 (manual, defaults); it counts after save and restart (manual, command 2)."""
    if not 1 <= raw <= 127:
        return RANGE
    servo.values["node_id"] = raw
    return 0


def _write_bit_rate(servo: Servo, raw: int, at: float) -> int:
    """One of eight codes; it counts after save and restart (manual, command 1)."""
    if raw not in BIT_RATES:
        return RANGE
    servo.values["bit_rate_code"] = raw
    return 0


def _save(servo: Servo, raw: int, at: float) -> int:
    """The word "save" (manual, command 3), else nothing is saved."""
    servo.values["store"] = raw
    if raw != SAVE or servo.switches.save_reply == "abort":
        return NOT_STORED
    switches = servo.switches
    servo.values.save(at, switches.flash_time, without_reverse=switches.reverse_rolls_back)
    return 0


def _write_goal(servo: Servo, raw: int, at: float) -> int:
    """It acts at once (manual, command 5); before a start XQPOWER acknowledges and ignores it."""
    limit = servo.profile.limit
    raw, refusal = _into_range(servo, raw, -limit, limit)
    if refusal:
        return refusal
    low, high = servo.travel
    if not low <= raw <= high and servo.switches.beyond_limits == "abort":
        return TOO_HIGH if raw > high else TOO_LOW
    if servo.heeds_positions:
        servo.values["goal_position"] = max(low, min(high, raw))
        servo.shaft.go(servo.values["goal_position"], at)
    return 0


def _into_range(servo: Servo, raw: int, low: int, high: int) -> tuple[int, int]:
    """The value to take and 0, or the value and why it is refused."""
    if low <= raw <= high:
        return raw, 0
    if servo.switches.out_of_range == "clamp":
        return max(low, min(high, raw)), 0
    return raw, TOO_HIGH if raw > high else TOO_LOW


def _write_interval(servo: Servo, raw: int, at: float) -> int:
    """Milliseconds between reports. XQPOWER raises what is too short (public module); 0 means none, an assumption."""
    shortest = servo.profile.table["report_interval"].low
    if raw or shortest > 1:
        raw = max(shortest, raw)
    servo.values["report_interval"] = raw
    servo.report_every(raw / 1000, at)
    return 0


def _set_middle(servo: Servo, raw: int, at: float) -> int:
    """The present position reads 0 from now on. One source writes 0 and one 1, so any value does it."""
    servo.shaft.make_middle(at)
    servo.values["mid_point"] = raw
    servo.values["zero"] = servo.shaft.zero
    _retarget(servo, at)
    return 0


def _retarget(servo: Servo, at: float) -> None:
    """Positions have another meaning now: what becomes of the target?"""
    if servo.switches.old_target == "kept":
        servo.shaft.go(servo.values["goal_position"], at)
    else:
        servo.values["goal_position"] = servo.shaft.reading(at)


def _write_limit(servo: Servo, name: str, other: str, raw: int) -> int:
    """A travel limit. In the reversed state the other one changes too: as its mirror image, an assumption."""
    row = servo.profile.table[name]
    raw, refusal = _into_range(servo, raw, row.low, row.high)
    if not refusal:
        servo.values[name] = raw
        if servo.shaft.reversed and servo.switches.reversed_limits == "mirror":
            servo.values[other] = -raw
    return refusal


def _write_negative(servo: Servo, raw: int, at: float) -> int:
    return _write_limit(servo, "negative_limit", "positive_limit", raw)


def _write_positive(servo: Servo, raw: int, at: float) -> int:
    return _write_limit(servo, "positive_limit", "negative_limit", raw)


def _write_functions(servo: Servo, raw: int, at: float) -> int:
    """Bit 5 reverses at once and the shaft stays where it is, an assumption; the other bits are only kept."""
    servo.values["function_enable"] = raw
    if bool(raw & REVERSE) != servo.shaft.reversed:
        servo.shaft.halt(at)
        servo.shaft.reversed = not servo.shaft.reversed
        _retarget(servo, at)
    return 0


_WRITE: Final[Mapping[str, Callable[[Servo, int, float], int]]] = {
    "node_id": _write_node_id,
    "bit_rate_code": _write_bit_rate,
    "store": _save,
    "goal_position": _write_goal,
    "report_interval": _write_interval,
    "mid_point": _set_middle,
    "negative_limit": _write_negative,
    "positive_limit": _write_positive,
    "function_enable": _write_functions,
}
