"""Quantities are exact, and what is not whole is refused with the values on either side."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper.program import quantities
from motorbus.families.stepper.program.quantities import Geometry
from motorbus.families.stepper.table import Project

SCREW = Geometry(Fraction(1600), 5000, Fraction(5))


@pytest.mark.parametrize(
    ("text", "units", "reverse"),
    [
        ("10 mm", 10_000, False),
        ("-10mm", 10_000, True),
        ("0.001 mm", 1, False),
        ("250 um", 250, False),
        ("1.2 cm", 12_000, False),
        ("0.3 turns", 1500, False),
        ("1 turn", 5000, False),
        ("90 deg", 1250, False),
        ("-90°", 1250, True),
        ("16 pulses", 50, False),
        ("+7 units", 7, False),
        ("-0 units", 0, True),
        (".5 turns", 2500, False),
        ("2. turns", 10_000, False),
    ],
)
def test_a_distance(text: str, units: int, reverse: bool) -> None:
    assert quantities.distance(text, "step 1, move", SCREW) == (units, reverse)


@pytest.mark.parametrize(
    ("text", "rpm"),
    [("60 rpm", 60), ("60 RPM", 60), ("1600 Hz", 60), ("5 mm/s", 60), ("360 deg/s", 60), ("0.5 turns/s", 30)],
)
def test_a_speed(text: str, rpm: int) -> None:
    assert quantities.speed(text, "step 1, speed", SCREW) == rpm


@pytest.mark.parametrize(
    ("text", "ms"),
    [("500 ms", 500), ("1.5 s", 1500), ("2 min 30 s", 150_000), ("4 h 40 min", 16_800_000), ("0.001s", 1)],
)
def test_a_pause(text: str, ms: int) -> None:
    assert quantities.milliseconds(text, "step 1, delay") == ms


def test_frequencies_angles_and_lengths() -> None:
    assert quantities.hertz("1.5 kHz", "x") == 1500
    assert quantities.hundredths("1.8 deg", "x") == 180
    assert quantities.hundredths("2.56°", "x") == 256
    assert quantities.millimetres("0.2 m", "x") == 200


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda: quantities.distance("0.3 mm", "step 2, move", Geometry(Fraction(1600), 7, Fraction(5))),
            "0 units or 1 units",
        ),
        (lambda: quantities.speed("100 Hz", "step 2, speed", SCREW), "3 rpm or 4 rpm"),
        (lambda: quantities.milliseconds("0.5 ms", "step 2, delay"), "0 ms or 1 ms"),
        (lambda: quantities.hertz("1.5 Hz", "step 2, start"), "1 Hz or 2 Hz"),
        (lambda: quantities.hundredths("1.875 deg", "step_angle"), "1.87 deg or 1.88 deg"),
    ],
)
def test_what_is_not_whole_is_refused_with_its_neighbours(call: Callable[[], object], says: str) -> None:
    with pytest.raises(RequestError, match="only whole ones") as caught:
        call()
    assert says in caught.value.expected


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: quantities.distance(10, "step 2, move", SCREW), "step 2, move: 10 has no unit"),
        (lambda: quantities.distance("10", "step 2, move", SCREW), "no number with a unit"),
        (lambda: quantities.distance("ten mm", "step 2, move", SCREW), "no number with a unit"),
        (lambda: quantities.distance("1e9 mm", "step 2, move", SCREW), "no unit of distance"),
        (lambda: quantities.distance("10 inch", "step 2, move", SCREW), "no unit of distance"),
        (
            lambda: quantities.distance("10 mm", "step 2, move", SCREW._replace(lead=None)),
            "no unit of distance",
        ),
        (lambda: quantities.speed("10 mm/s", "step 2, speed", SCREW._replace(lead=None)), "no unit of speed"),
        (lambda: quantities.speed("10 mm/h", "step 2, speed", SCREW), "no unit of speed"),
        (lambda: quantities.speed("10 mm", "step 2, speed", SCREW), "no unit of speed"),
        (lambda: quantities.speed("-10 rpm", "step 2, speed", SCREW), "is negative"),
        (lambda: quantities.hertz("10 rpm", "step 2, start"), "no frequency"),
        (lambda: quantities.hertz("-10 Hz", "step 2, start"), "no frequency"),
        (lambda: quantities.milliseconds("", "step 2, delay"), "no time"),
        (lambda: quantities.milliseconds("5", "step 2, delay"), "no time"),
        (lambda: quantities.milliseconds("5 s later", "step 2, delay"), "no time"),
        (lambda: quantities.milliseconds("-5 s", "step 2, delay"), "no time"),
        (lambda: quantities.milliseconds(5, "step 2, delay"), "no time"),
        (lambda: quantities.hundredths("1.8 rad", "step_angle"), "no angle"),
        (lambda: quantities.millimetres("0 mm", "lead"), "no length"),
        (lambda: quantities.millimetres("5 deg", "lead"), "no length"),
        (lambda: quantities.distance("9" * 40 + " mm", "step 2, move", SCREW), "no unit of distance"),
    ],
)
def test_nonsense_is_refused_with_its_place(call: Callable[[], object], says: str) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        call()
    assert caught.value.summary.startswith(("step 2, ", "lead", "step_angle"))
    assert caught.value.expected


@given(st.integers(0, 10**7), st.sampled_from(["units", "pulses", "turns", "deg", "mm"]))
def test_what_is_taken_is_exactly_what_was_said(number: int, unit: str) -> None:
    turns = SCREW.turns(unit)
    assert turns is not None
    text = f"{number / 100:.2f} {unit}"
    units = Fraction(number, 100) * turns * 5000
    if units.denominator == 1:
        assert quantities.distance(text, "x", SCREW) == (int(units), False)
    else:
        with pytest.raises(RequestError):
            quantities.distance(text, "x", SCREW)


# --- motors whose angle the controller cannot be told ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("full_steps", "microsteps", "pair"),
    [
        (200, 8, (180, 8)),
        (400, 16, (90, 16)),
        (48, 25, (180, 6)),
        (96, 25, (180, 12)),
        (24, 1, (150, None)),
    ],
)
def test_a_motor_of_so_many_full_steps(
    full_steps: int, microsteps: int, pair: tuple[int, int | None]
) -> None:
    if pair[1] is None:
        with pytest.raises(RequestError, match="24 pulses a turn"):
            quantities.motor_of(full_steps, microsteps, "full_steps")
        return
    found = quantities.motor_of(full_steps, microsteps, "full_steps")
    assert found == pair
    assert Fraction(36000 * found[1], found[0]) == full_steps * microsteps


@given(st.integers(1, 1000), st.integers(1, 256))
def test_a_pair_has_the_pulses_that_were_wanted(full_steps: int, microsteps: int) -> None:
    try:
        angle, found = quantities.motor_of(full_steps, microsteps, "full_steps")
    except RequestError:
        possible = [a for a in range(1, 256) if full_steps * microsteps * a % 36000 == 0]
        assert not [a for a in possible if 1 <= full_steps * microsteps * a // 36000 <= 65535]
        return
    assert Project(step_angle=angle, microsteps=found).pulses_per_turn == full_steps * microsteps


def test_no_motor_has_no_steps() -> None:
    with pytest.raises(RequestError):
        quantities.motor_of(0, 8, "full_steps")
