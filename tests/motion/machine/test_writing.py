"""A fresh file: in the units of people, each key explained where it first stands."""

from __future__ import annotations

import tomllib
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.motion.machine import BusSpec, Machine
from motorbus.motion.machine.writing import quantity_text, quoted, write
from tests.motion.machine.files import GOOD, axis

FRESH = """\
# A machine: its buses, what moves on them, and how far and how fast it may.
# Angles, lengths and velocities have a unit, in quotes.
format = 1
name = "bench"

[bus.arm]
address = "feetech:/dev/ttyACM0,baud=1000000"  # where the bus is: FAMILY:PORT, options after commas

[bus.gimbal]
address = "kst:can://slcan/dev/ttyACM1,bitrate=500000"

[axis.shoulder]
device = "arm#1"                # what moves it: BUS#ID
zero = "180 deg"                # angle of the device at which the axis is at 0
sign = -1                       # 1, or -1 where the axis turns against the device
gear = 3.0                      # turns of the device for one turn of the axis
unit = "deg"                    # how people see its positions
low = "-90 deg"                 # lowest position; needs `high`
high = "90 deg"                 # highest position; needs `low`
max_velocity = "120 deg/s"      # it is never led faster
max_acceleration = "500 deg/s2"  # it never starts or stops harder
max_step = "10 deg"             # farthest that one command may be from the measured position
exit = "hold"                   # what it does when the program ends, however that comes
torque = 0.5                    # cap of its torque; not with `current`

[axis.elbow]
device = "arm#2"
zero = "0 deg"
sign = 1
gear = 1.0
unit = "deg"
low = "-2 rad"
high = "2 rad"
max_velocity = "90 deg/s"
max_acceleration = "360 deg/s2"
exit = "park"
park = "0 deg"                  # where parking goes; needed with exit = "park"
current = "0.4 A"               # cap of its current; not with `torque`
guard = false                   # whether a movement ends when its motor pushes too hard for too long, or is too hot

[axis.slide]
device = "gimbal#0x25"
zero = "0 deg"
sign = 1
gear = 1.0
travel = "5 mm"                 # makes the axis linear: its way for one turn
unit = "mm"
low = "0 mm"
high = "120 mm"
max_velocity = "50 mm/s"
max_acceleration = "200 mm/s2"
exit = "hold"

[group.left]
axes = ["shoulder", "elbow"]

[pose.ready]
shoulder = "10 deg"
elbow = "-20 deg"
slide = "30 mm"
"""


def test_a_fresh_file_reads_like_one() -> None:
    assert Machine.parse(GOOD).text() == FRESH


@pytest.mark.parametrize(
    ("unit", "travel", "velocity"),
    [
        ("rad", None, "1.5 rad/s"),
        ("turn", None, "1.5 rad/s"),
        ("m", 0.005, "1.5 m/s"),
        ("mm", 0.005, "1500 mm/s"),
    ],
)
def test_rates_are_in_the_unit_of_positions(unit: str, travel: float | None, velocity: str) -> None:
    machine = Machine(buses={"arm": BusSpec(address="x:y")}, axes={"a": axis(unit=unit, travel=travel)})
    assert f'max_velocity = "{velocity}"' in machine.text()


@pytest.mark.parametrize(
    "parts", [{"gear": float("nan")}, {"sign": 0}, {"zero": float("inf")}, {"low": float("nan")}]
)
def test_what_no_file_may_say_is_not_written(parts: dict[str, float]) -> None:
    with pytest.raises(RequestError, match=r"axis\.a\."):
        write(Machine(buses={"arm": BusSpec(address="x:y")}, axes={"a": axis(**parts)}))


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_text_can_be_quoted(text: str) -> None:
    assert tomllib.loads(f"it = {quoted(text)}") == {"it": text}


@pytest.mark.parametrize(
    ("value", "quantity", "unit", "text"),
    [
        (pi / 2, "position", "deg", "90 deg"),
        (-pi, "position", "turn", "-0.5 turn"),
        (1.25, "position", "rad", "1.25 rad"),
        (0.123456789012345, "length", "mm", "123.456789012345 mm"),
        (0.03, "length", "mm", "30 mm"),
    ],
)
def test_quantity_text_has_the_fewest_digits(value: float, quantity: str, unit: str, text: str) -> None:
    assert quantity_text(value, quantity, unit) == text


@given(
    st.floats(-1e6, 1e6),
    st.sampled_from([(kind, unit) for kind, all in units.SCALES.items() for unit in all]),
)
def test_quantity_text_parses_to_the_same_number(value: float, shown: tuple[str, str]) -> None:
    quantity, unit = shown
    assert units.parse(quantity_text(value, quantity, unit), quantity) == value
