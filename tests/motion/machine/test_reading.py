"""Files that are wrong: each is refused in one message with the place and the fix, and nothing else ever comes out."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.machine import Machine
from motorbus.motion.machine.reading import read
from tests.motion.machine.files import BROKEN, GOOD, Broken

LINES = GOOD.splitlines()


@pytest.mark.parametrize("broken", [pytest.param(one, id=one.says[:50]) for one in BROKEN])
def test_a_broken_file_is_refused_in_one_message(broken: Broken) -> None:
    with pytest.raises(RequestError) as caught:
        read(broken.text)
    error = caught.value
    assert error.summary.startswith(broken.says)
    assert "\n" not in error.summary
    assert len(error.summary) < 200
    assert error.expected
    assert broken.fix in f"{error.summary} / {error.expected} / {error.advice}"
    assert re.fullmatch(r".{6,}; nothing was opened", error.advice)


def test_there_are_fifty_of_them_and_more() -> None:
    assert len({(one.old, one.new) for one in BROKEN}) == len(BROKEN) >= 50


@pytest.mark.parametrize(
    "line", [number for number, line in enumerate(LINES) if re.match(r"\w+ = ", line)], ids=LINES.__getitem__
)
@pytest.mark.parametrize(
    "value", ["true", "[]", "{}", "{a.b.c = 1}", "-0", "1e300", '"\\u0000"', '"x"', "nan"]
)
def test_no_value_of_any_key_gives_anything_but_a_machine_or_our_error(line: int, value: str) -> None:
    key = LINES[line].partition(" = ")[0]
    text = "\n".join([*LINES[:line], f"{key} = {value}", *LINES[line + 1 :]])
    try:
        Machine.parse(text).text()
    except RequestError as error:
        place = error.summary.partition(": ")[0]
        assert re.fullmatch(r"(format|name|(bus|axis|group|pose)\.\w+(\.\w+)?)(\[\d\])?", place)


@given(st.integers(0, len(GOOD)), st.integers(0, 40), st.text(max_size=10))
def test_no_text_gives_anything_but_a_machine_or_our_error(start: int, length: int, instead: str) -> None:
    text = GOOD[:start] + instead + GOOD[start + length :]
    refusal, machine = "", Machine()
    try:
        machine = Machine.parse(text)
    except RequestError as error:
        refusal = error.summary
    assert "\n" not in refusal
    assert len(refusal) < 300
    assert Machine.parse(machine.text()) == machine


def test_a_long_complaint_about_toml_keeps_its_line() -> None:
    with pytest.raises(RequestError) as caught:
        read(f"[axis.{'x' * 5000}]\n[axis.{'x' * 5000}]")
    assert len(caught.value.summary) < 200
    assert "(at line 2, column 5007)" in caught.value.summary


def test_a_value_of_a_pose_is_explained_as_one() -> None:
    with pytest.raises(RequestError) as caught:
        read(GOOD.replace('"30 mm"', "true"))
    assert caught.value.summary == "pose.ready.slide: true is no length"
    assert caught.value.advice.startswith('write it as slide = "30 mm" (where this axis is in the pose)')


def test_a_unit_needs_no_blank_and_a_fraction_no_unit() -> None:
    text = GOOD.replace('"120 deg/s"', '"2rad/s"').replace('max_step = "10 deg"', 'max_step = "10deg"')
    shoulder = read(text).axes["shoulder"]
    assert (shoulder.max_velocity, round(shoulder.max_step or 0, 4)) == (2.0, 0.1745)
    assert read(GOOD.replace("torque = 0.5", 'torque = "50 %"')).axes["shoulder"].torque == 0.5
