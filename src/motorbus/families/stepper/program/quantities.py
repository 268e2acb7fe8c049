"""What people write for a distance, a speed, a frequency or a pause, and the whole number it is for the controller.

Arithmetic is exact: 0.3 turns of 1600 units are 480 units and not 479.99999. What does not come out whole is refused,
with the two values on either side, for a file that says one thing and a motor that does another are worse than a
question; what is out of range is refused with the range in the unit of the file. Every quantity has its unit in the
file; a bare number could be anything.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from math import ceil, floor
from typing import Final, NamedTuple

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper.table import PARAMETERS, Project

_NUMBER: Final = re.compile(r"\s*([+-]?)\s*(\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})\s*", re.ASCII)
_MORE: Final = re.compile(r"[eE][+-]?\d|[\d.]")
"""What behind a number makes it one that is not read: an exponent, or more digits than anybody needs."""
_PART: Final = re.compile(r"\s*(\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})\s*([a-zµμ]+)\s*", re.ASCII)
TIME: Final[Mapping[str, Fraction]] = {
    "ms": Fraction(1),
    "s": Fraction(1000),
    "min": Fraction(60_000),
    "h": Fraction(3_600_000),
}
"""ms of each unit of time."""
LENGTH: Final[Mapping[str, Fraction]] = {
    "mm": Fraction(1),
    "um": Fraction(1, 1000),
    "µm": Fraction(1, 1000),
    "μm": Fraction(1, 1000),
    "cm": Fraction(10),
    "m": Fraction(1000),
}
"""mm of each unit of length."""
NEEDS_LEAD: Final = "millimetres need `lead` in [motor]"
DISTANCES: Final = ("units", "pulses", "turns", "deg", *LENGTH)
SPEEDS: Final = ("rpm", "Hz", "deg/s", "mm/s")
_SAME: Final = {
    "unit": "units",
    "pulse": "pulses",
    "turn": "turns",
    "°": "deg",
    "degrees": "deg",
    "RPM": "rpm",
}


class Geometry(NamedTuple):
    """What one turn of the motor is: in pulses, in user units, and in mm where a lead is given; 0: it is not known."""

    pulses: Fraction
    units: int
    lead: Fraction | None = None

    @classmethod
    def of(cls, project: Project, lead: Fraction | None = None) -> Geometry:
        """That of a project."""
        return cls(project.pulses_per_turn or Fraction(0), project.turn_distance, lead)

    def turns(self, unit: str) -> Fraction | None:
        """Turns of the motor in one of this unit of distance; None when it is unknown, or mm without a lead."""
        if unit == "units":
            return Fraction(1, self.units) if self.units else None
        if unit == "pulses":
            return 1 / self.pulses if self.pulses else None
        if unit in ("turns", "deg"):
            return Fraction(1, 1 if unit == "turns" else 360)
        if unit in LENGTH and self.lead:
            return LENGTH[unit] / self.lead
        return None

    def each(self, unit: str) -> Fraction | None:
        """User units in one of this unit of distance, also of a motor of which nothing else is known; or None."""
        turns = self.turns(unit)
        return Fraction(1) if unit == "units" else turns * self.units if turns is not None else None

    def said(self, units: tuple[str, ...]) -> str:
        """These units as one may say them here: those of length only with a lead."""
        usable = [unit for unit in units if self.lead or unit.partition("/")[0] not in LENGTH]
        return f"a number with one of {', '.join(usable)}"


class Amount(NamedTuple):
    """A number and its unit, as written; `negative` also tells -0 from 0."""

    number: Fraction
    unit: str
    negative: bool


def refuse(what: str, expected: str, why: str = "") -> RequestError:
    """The error for something in a file that cannot be."""
    return RequestError(what, expected=expected, cause=why, advice="correct the file; nothing was sent")


def amount(text: object, where: str, expected: str) -> Amount:
    """`-12.5 mm` taken apart. Raises RequestError, naming `where`, for what is no number with a unit."""
    if not isinstance(text, str):
        raise refuse(f"{where}: {shown(text)} has no unit", expected)
    match = _NUMBER.match(text)
    unit = text[match.end() :].strip() if match else ""
    if match is None or not unit or _MORE.match(unit):
        why = "a number has 20 digits at most, and no exponent" if match and unit else ""
        raise refuse(f"{where}: {shown(text)} is no number with a unit", expected, why)
    number = Fraction(match[2] + "0" if match[2].endswith(".") else match[2])
    negative = match[1] == "-"
    return Amount(-number if negative else number, _SAME.get(unit, unit), negative)


def whole(
    number: Fraction, where: str, said: object, unit: str, name: str, back: Callable[[int], str] = str
) -> int:
    """The whole number that a parameter is to be; `back` says such a number as the file would.

    Raises RequestError with the range when it lies outside, and with the two on either side when it is not whole.
    """
    row = PARAMETERS[name]
    if not row.low <= number <= row.high:
        raise refuse(
            f"{where}: {shown(said)} is not possible",
            f"{back(row.low)} to {back(row.high)} (raw {row.low} to {row.high})",
        )
    if number.denominator == 1:
        return int(number)
    low, high = floor(number), ceil(number)
    raise refuse(
        f"{where}: {shown(said)} is {float(number):.10g} {unit}, and only whole ones can be said",
        f"{back(low)} or {back(high)}",
        "the controller counts in whole numbers",
    )


def in_unit(number: Fraction, unit: str) -> str:
    """A number for people, never above what it is: `16777.215 mm`."""
    return f"{float(Fraction(floor(number * 10**6), 10**6)):.15g} {unit}"


def clock(ms: int) -> str:
    """A pause as a file says it: 4 h 39 min 37.215 s."""
    if ms < 1000:
        return f"{ms} ms"
    minutes, rest = divmod(ms, 60_000)
    hours, minutes = divmod(minutes, 60)
    parts = (hours and f"{hours} h", minutes and f"{minutes} min", rest and f"{rest / 1000:.15g} s")
    return " ".join(part for part in parts if part)


def distance(text: object, where: str, geometry: Geometry) -> tuple[int, bool]:
    """A signed distance -> user units, and whether it is in reverse (also for -0)."""
    expected = geometry.said(DISTANCES)
    said = amount(text, where, expected)
    each = geometry.each(said.unit)
    if not each:
        why = NEEDS_LEAD if said.unit in LENGTH and not geometry.lead else ""
        raise refuse(f"{where}: {shown(text)} has no unit of distance that is known here", expected, why)
    count = abs(said.number) * each
    if count > PARAMETERS["distance"].high:
        most = PARAMETERS["distance"].high
        raise refuse(
            f"{where}: {shown(text)} is not possible",
            f"0 to {in_unit(most / each, said.unit)}, either way (raw 0 to {most} units)",
        )
    return whole(count, where, text, "units", "distance", lambda raw: f"{raw} units"), said.negative


def speed(text: object, where: str, geometry: Geometry) -> int:
    """A speed -> RPM."""
    expected = geometry.said(SPEEDS)
    said = amount(text, where, expected)
    each = Fraction(1)
    if said.unit != "rpm":
        per, _, time = said.unit.rpartition("/")
        turns = geometry.turns("pulses" if said.unit == "Hz" else per)
        if turns is None or (said.unit != "Hz" and time != "s"):
            why = "mm/s needs `lead` in [motor]" if per in LENGTH and not geometry.lead else ""
            raise refuse(f"{where}: {shown(text)} has no unit of speed that is known here", expected, why)
        each = turns * 60
    if said.number < 0:
        raise refuse(
            f"{where}: {shown(text)} is negative", expected, "the sign of `move` says which way it turns"
        )
    rpm, most = said.number * each, PARAMETERS["speed"].high
    if rpm > most:
        raise refuse(
            f"{where}: {shown(text)} is not possible",
            f"0 to {in_unit(most / each, said.unit)} (raw 0 to {most} rpm)",
        )
    return whole(rpm, where, text, "rpm", "speed", lambda count: f"{count} rpm")


def hertz(text: object, where: str, name: str = "start_frequency") -> int:
    """A frequency of pulses -> Hz; `name` is the parameter it is for."""
    said = amount(text, where, "a number with Hz or kHz")
    scale = {"Hz": 1, "kHz": 1000}.get(said.unit)
    if scale is None or said.number < 0:
        raise refuse(f"{where}: {shown(text)} is no frequency", "a number with Hz or kHz")
    return whole(said.number * scale, where, text, "Hz", name, lambda count: f"{count} Hz")


def milliseconds(text: object, where: str) -> int:
    """A pause, such as `500 ms` or `4 h 39 min`, -> ms."""
    expected = "numbers with ms, s, min or h, such as 1.5 s or 2 min 30 s"
    total, rest = Fraction(0), text if isinstance(text, str) else ""
    while match := _PART.match(rest):
        if match[2] not in TIME:
            break
        total += Fraction(match[1] + "0" if match[1].endswith(".") else match[1]) * TIME[match[2]]
        rest = rest[match.end() :]
    if rest or not isinstance(text, str) or not text.strip():
        raise refuse(f"{where}: {shown(text)} is no time", expected)
    return whole(total, where, text, "ms", "delay", clock)


def hundredths(text: object, where: str, *, expert: bool = False) -> int:
    """A step angle, such as `1.8 deg`, -> hundredths of a degree; an `expert` may say that there is none, 0."""
    said = amount(text, where, "an angle such as 1.8 deg")
    if said.unit != "deg" or said.number < 0:
        raise refuse(f"{where}: {shown(text)} is no angle", "an angle such as 1.8 deg")
    if expert and not said.number:
        return 0
    return whole(
        said.number * 100, where, text, "hundredths", "step_angle", lambda count: f"{count / 100:g} deg"
    )


def millimetres(text: object, where: str) -> Fraction:
    """A length above 0 -> mm, exact."""
    said = amount(text, where, "a length such as 5 mm")
    if said.unit not in LENGTH or said.number <= 0:
        raise refuse(f"{where}: {shown(text)} is no length", "a length such as 5 mm")
    return said.number * LENGTH[said.unit]


def motor_of(full_steps: int, microsteps: int, where: str) -> tuple[int, int]:
    """Step angle (hundredths of a degree) and microsteps that give a motor of so many full steps its pulses per turn.

    One byte holds the angle, so 2.55 degrees are the most; a motor of 48 full steps (7.5 degrees) at 25 microsteps has
    1200 pulses a turn, which 1.8 degrees and 6 microsteps give too. That only the pulses count is an assumption: a unit
    with a driver of its own may set that by the microsteps. Raises RequestError when no pair gives them.
    """
    pulses = full_steps * microsteps
    exact = Fraction(36000, full_steps) if full_steps > 0 else Fraction(0)
    wanted = [int(exact)] if exact.denominator == 1 and 1 <= exact <= 255 else []
    for angle in (*wanted, 180, 90, *range(255, 0, -1)):
        found = Fraction(pulses * angle, 36000)
        if found.denominator == 1 and 1 <= found <= 0xFFFF:
            return angle, int(found)
    raise refuse(
        f"{where}: {shown(full_steps)} full steps of {shown(microsteps)} microsteps are {shown(pulses)} pulses a turn, "
        "which the controller cannot be told",
        "36000 * microsteps / step angle, with 1 to 65535 and 1 to 255",
    )
