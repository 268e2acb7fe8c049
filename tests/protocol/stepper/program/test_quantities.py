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
    [
        ("500 ms", 500),
        ("1.5 s", 1500),
        ("2 min 30 s", 150_000),
        ("4 h 39 min 37.215 s", 0xFFFFFF),
        ("0.001s", 1),
    ],
)
def test_a_pause(text: str, ms: int) -> None:
    assert quantities.milliseconds(text, "step 1, delay") == ms


def test_frequencies_angles_and_lengths() -> None:
    assert quantities.hertz("1.5 kHz", "x") == 1500
    assert quantities.hundredths("1.8 deg", "x") == 180
    assert quantities.hundredths("2.55°", "x") == 255
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
        (lambda: quantities.distance("1e9 mm", "step 2, move", SCREW), "no number with a unit"),
        (lambda: quantities.speed("1e999 rpm", "step 2, speed", SCREW), "no number with a unit"),
        (lambda: quantities.speed("1.5.2 rpm", "step 2, speed", SCREW), "no number with a unit"),
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
        (lambda: quantities.distance("9" * 5000 + " mm", "step 2, move", SCREW), "no number with a unit"),
        (lambda: quantities.speed("9" * 5000, "step 2, speed", SCREW), "no number with a unit"),
    ],
)
def test_nonsense_is_refused_with_its_place(call: Callable[[], object], says: str) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        call()
    assert caught.value.summary.startswith(("step 2, ", "lead", "step_angle"))
    assert len(caught.value.summary) < 120
    assert caught.value.expected


@given(st.integers(0, 10**7), st.sampled_from(["units", "pulses", "turns", "deg", "mm"]))
def test_what_is_taken_is_exactly_what_was_said(number: int, unit: str) -> None:
    turns = SCREW.turns(unit)
    assert turns is not None
    text = f"{number / 100:.2f} {unit}"
    units = Fraction(number, 100) * turns * 5000
    if units.denominator == 1 and units <= 0xFFFFFF:
        assert quantities.distance(text, "x", SCREW) == (int(units), False)
    else:
        with pytest.raises(RequestError):
            quantities.distance(text, "x", SCREW)


@pytest.mark.parametrize(
    ("call", "says", "allows"),
    [
        (
            lambda: quantities.distance("-16777.216 mm", "step 2, move", SCREW),
            "step 2, move: '-16777.216 mm'",
            "0 to 16777.215 mm, either way (raw 0 to 16777215 units)",
        ),
        (
            lambda: quantities.distance("3356 turns", "step 2, move", SCREW),
            "step 2, move: '3356 turns'",
            "0 to 3355.443 turns, either way (raw 0 to 16777215 units)",
        ),
        (
            lambda: quantities.speed("65536 rpm", "step 2, speed", SCREW),
            "step 2, speed: '65536 rpm'",
            "0 to 65535 rpm (raw 0 to 65535 rpm)",
        ),
        (
            lambda: quantities.speed("6000 mm/s", "step 2, speed", SCREW),
            "step 2, speed: '6000 mm/s'",
            "0 to 5461.25 mm/s (raw 0 to 65535 rpm)",
        ),
        (
            lambda: quantities.hertz("70 kHz", "step 2, start"),
            "step 2, start: '70 kHz'",
            "0 Hz to 65535 Hz (raw 0 to 65535)",
        ),
        (
            lambda: quantities.milliseconds("4 h 40 min", "step 2, delay"),
            "step 2, delay: '4 h 40 min'",
            "0 ms to 4 h 39 min 37.215 s (raw 0 to 16777215)",
        ),
        (
            lambda: quantities.milliseconds("16777215.5 ms", "step 2, delay"),
            "step 2, delay: '16777215.5 ms'",
            "0 ms to 4 h 39 min 37.215 s (raw 0 to 16777215)",
        ),
        (
            lambda: quantities.hundredths("2.56 deg", "step_angle"),
            "step_angle: '2.56 deg'",
            "0.01 deg to 2.55 deg (raw 1 to 255)",
        ),
        (
            lambda: quantities.hundredths("0 deg", "step_angle"),
            "step_angle: '0 deg'",
            "0.01 deg to 2.55 deg (raw 1 to 255)",
        ),
    ],
)
def test_what_is_out_of_range_is_told_in_the_unit_of_the_file(
    call: Callable[[], object], says: str, allows: str
) -> None:
    with pytest.raises(RequestError) as caught:
        call()
    assert (caught.value.summary, caught.value.expected) == (f"{says} is not possible", allows)


@given(st.integers(1, 0xFFFFFF), st.sampled_from(["units", "pulses", "turns", "deg", "mm"]))
def test_the_end_of_a_range_is_inside_it(turn: int, unit: str) -> None:
    """What an error suggests is never refused for its size."""
    geometry = Geometry(Fraction(1600), turn, Fraction(5))
    with pytest.raises(RequestError) as caught:
        quantities.distance(f"{'9' * 20} {unit}", "x", geometry)
    number, named = caught.value.expected.split(" to ")[1].split(",")[0].split()
    turns = geometry.turns(unit)
    assert named == unit
    assert turns is not None
    assert 0xFFFFFF - turns * turn <= Fraction(number) * turns * turn <= 0xFFFFFF


@pytest.mark.parametrize(
    ("ms", "text"),
    [(0, "0 ms"), (999, "999 ms"), (1500, "1.5 s"), (3_600_000, "1 h"), (3_660_001, "1 h 1 min 0.001 s")],
)
def test_a_clock_says_what_a_file_would(ms: int, text: str) -> None:
    assert quantities.clock(ms) == text
    assert quantities.milliseconds(text, "x") == ms


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
