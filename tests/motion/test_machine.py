"""The machine file: each wrong text has one error that names the key; edits keep comments; fresh files read back."""

from __future__ import annotations

import tomllib
from math import pi, tau
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.machine import MachineConfig
from motorbus.motion.machine_edit import edit, pose_change, schema, write

GOOD = """\
format = 1
name = "bench"

[bus.arm]
address = "feetech:/dev/ttyACM0,baud=1000000"  # the left port

[axis.pan]
device = "arm#1"
zero = "180 deg"
sign = -1
low = "-90 deg"
high = "90 deg"
max_velocity = "120 deg/s"
exit = "park"

[axis.lift]
device = "arm#0x02"
travel = "5 mm"
low = "0 mm"
high = "120 mm"
max_velocity = "20 mm/s"

[axis.wheel]
device = "arm#3"
kind = "wheel"
max_velocity = "60 rpm"

[group.all]
axes = ["pan", "lift"]

# poses
[pose.park]
pan = "10 deg"
lift = "5 mm"
"""


def test_a_file_is_read() -> None:
    machine = MachineConfig.parse(GOOD)
    pan, lift, wheel = machine.axes.values()
    assert pan.device_limits == pytest.approx((pi / 2, 1.5 * pi))
    assert (lift.node, lift.display_unit) == (2, "mm")
    assert lift.ratio == pytest.approx(tau / 0.005)
    assert wheel.max_velocity == pytest.approx(tau)
    assert (pan.exit_action, lift.exit_action, wheel.exit_action) == ("park", "hold", "stop")
    assert machine.poses["park"] == {"pan": pytest.approx(10 * pi / 180), "lift": 0.005}
    assert machine.axes_of(["all", "wheel"]) == ("pan", "lift", "wheel")
    assert machine.axes_of("arm") == ("pan", "lift", "wheel")
    with pytest.raises(RequestError, match="no axis, group or bus 'pam'"):
        machine.axes_of("pam")


WRONG = {
    "format = 1": ("format = 2", "format is 2"),
    'name = "bench"': ("nam = 3", "unknown key 'nam'"),
    "[bus.arm]": ("[bus.Arm]", "bus.'Arm': not a name"),
    "feetech:/dev/ttyACM0,baud=1000000": ("ttyACM0", "not a bus address"),
    'device = "arm#1"': ('device = "am#1"', "axis.pan.device: no bus 'am'"),
    'device = "arm#0x02"': ('device = "arm#1"', "axis.lift.device: arm#1 belongs to axis.pan"),
    'device = "arm#3"': ('device = "arm3"', "axis.wheel.device: expected"),
    'zero = "180 deg"': ('zero = "180"', 'axis.pan.zero: .180. has no unit: write it as "90 deg"'),
    "sign = -1": ("sign = 2", "axis.pan.sign: invalid enum value 2"),
    'low = "-90 deg"': ('low = "-90 mm"', "axis.pan.low: this axis is not linear"),
    'high = "90 deg"': ("", "axis.pan: low and high are needed together"),
    'low = "0 mm"': ('low = "120 mm"', "axis.lift.low: 120.00 mm is not below high"),
    '"120 deg/s"': ('"0 deg/s"', "axis.pan.max_velocity: 0 deg/s must be above 0"),
    'max_velocity = "20 mm/s"': ("", "axis.lift: object missing required field `max_velocity`"),
    'exit = "park"': ('exit = "stop"', 'axis.pan.exit: "stop" is for a wheel'),
    'travel = "5 mm"': ('travel = "5 deg"', "axis.lift.travel"),
    'kind = "wheel"': (
        'kind = "wheel"\nlow = "1 deg"\nhigh = "2 deg"',
        "axis.wheel.low: a wheel has no position",
    ),
    'max_velocity = "60 rpm"': (
        'max_velocity = "60 rpm"\nexit = "hold"',
        "axis.wheel.exit: 'hold' of a wheel",
    ),
    '"120 mm"': ('"120 mm"\nunit = "deg"', "axis.lift.unit: deg does not measure"),
    'axes = ["pan", "lift"]': ('axes = ["pam"]', "group.all: no axis 'pam'"),
    "[group.all]": ("[group.pan]", "group.pan: an axis has this name"),
    'pan = "10 deg"': ('pan = "100 deg"', "pose.park.pan: 100.0 deg is outside the limits"),
    'lift = "5 mm"': ('lift = "5 deg"', "pose.park.lift: this axis is linear"),
    "[pose.park]": ("[pose.rest]", 'axis.pan.exit: "park" needs its position in'),
    "# poses": ("[bus.arm]", "Cannot declare"),
}


@pytest.mark.parametrize(("old", "new", "error"), [(old, *new) for old, new in WRONG.items()])
def test_a_wrong_file_is_refused_with_its_key(old: str, new: str, error: str) -> None:
    assert GOOD.count(old) >= 1
    with pytest.raises(RequestError, match=error) as caught:
        MachineConfig.parse(GOOD.replace(old, new, 1))
    assert "\n" not in caught.value.summary


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(RequestError, match=r"nowhere\.toml"):
        MachineConfig.load("nowhere.toml")


def test_edits_keep_comments_and_prove_the_result(tmp_path: Path) -> None:
    machine = MachineConfig.parse(GOOD)
    change = pose_change(machine, "ready", {"pan": 0.5, "lift": 0.03})
    text = edit(GOOD, {**change, "axis.pan.max_velocity": "90 deg/s", "axis.lift.gear": 2.0})
    assert "# the left port" in text
    assert "# poses" in text
    made = MachineConfig.parse(text)
    assert made.poses["ready"] == {"pan": 0.5, "lift": 0.03}
    assert (made.axes["pan"].max_velocity, made.axes["lift"].gear) == (pi / 2, 2.0)
    assert MachineConfig.parse(edit(text, {"pose.ready": {"pan": "1 deg"}})).poses["ready"].keys() == {"pan"}
    assert "ready" not in MachineConfig.parse(edit(text, {"pose.ready": None})).poses
    for wrong in ({"axis.pan.lov": "3 deg"}, {"axis.pan.low": "3"}, {"pose.none": None}, {"bus.arm": None}):
        with pytest.raises(RequestError):
            edit(GOOD, wrong)
    assert edit(GOOD.replace("\n", "\r\n"), {"name": "other"}) == GOOD.replace("bench", "other").replace(
        "\n", "\r\n"
    )


def test_a_fresh_file_is_read_as_the_same_machine() -> None:
    machine = MachineConfig.parse(GOOD)
    text = write(machine)
    assert MachineConfig.parse(text) == machine
    assert 'max_velocity = "120 deg/s"' in text


@given(st.floats(-6, 6), st.floats(0.001, 50), st.sampled_from([1, -1]), st.floats(0.1, 10), st.floats(-3, 3))
def test_positions_go_to_the_device_and_back(
    zero: float, velocity: float, sign: int, gear: float, at: float
) -> None:
    text = f'zero = "{zero!r} rad"\nsign = {sign}\ngear = {gear!r}\nmax_velocity = "{velocity!r} rad/s"'
    source = f'format = 1\n[bus.b]\naddress = "kst:sim"\n[axis.a]\ndevice = "b#1"\n{text}\n'
    machine = MachineConfig.parse(source)
    axis = machine.axes["a"]
    assert axis.from_device(axis.to_device(at)) == pytest.approx(at, abs=1e-9)
    assert MachineConfig.parse(write(machine)) == machine


def test_shown_positions_are_in_the_unit_of_the_axis() -> None:
    axes = MachineConfig.parse(GOOD).axes
    assert (axes["pan"].show(-pi / 4), axes["lift"].show(0.0125)) == ("-45.0 deg", "12.50 mm")


def test_the_schema_accepts_good_files_and_refuses_wrong_ones() -> None:
    check = jsonschema.Draft202012Validator(schema())
    assert check.is_valid(tomllib.loads(GOOD))
    for old in ("format = 1", 'name = "bench"', 'zero = "180 deg"', "sign = -1", "[bus.arm]"):
        with pytest.raises(jsonschema.ValidationError):
            check.validate(tomllib.loads(GOOD.replace(old, WRONG[old][0], 1)))
