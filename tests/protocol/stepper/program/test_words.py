"""Errors speak of the fields of a file by its own words, and say ranges in its units."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program import text, words
from motorbus.families.stepper.table import BASE_NAMES, STEP_NAMES


def test_every_parameter_is_called_by_a_word_that_files_have() -> None:
    known = {*text.TOP, *text.MOTOR, *text.STEP, *(f"[loop], {key}" for key in text.LOOP), "the sign of move"}
    for name in (*BASE_NAMES, *STEP_NAMES):
        assert words.WORDS.get(name, name) in known


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("delay", "0 ms to 4 h 39 min 37.215 s (raw 0 to 16777215)"),
        ("step_angle", "0.01 deg to 2.55 deg (raw 1 to 255)"),
        ("microsteps", "1 to 65535 microsteps per full step"),
        ("loop_count", "0 to 254; 0 is off"),
    ],
)
def test_a_range_is_said_in_the_units_of_a_file(name: str, says: str) -> None:
    assert words.range_of(name) == says


@pytest.mark.parametrize("name", ["loop_count", "microsteps", "step_angle", "turn_distance"])
def test_an_expert_may_say_what_a_controller_may_hold(name: str) -> None:
    raw = 255 if name == "loop_count" else 0
    words.within(name, raw, expert=True)
    with pytest.raises(RequestError, match="is not possible"):
        words.within(name, raw)
    assert words.range_of(name, expert=True).startswith("0 to ")
    for beyond in (-1, words.HELD[name][-1] + 1):
        with pytest.raises(RequestError, match="is not possible"):
            words.within(name, beyond, expert=True)


def test_what_is_outside_is_told_with_its_step() -> None:
    words.within("start_input", 5, 3)
    words.within("start_input", 4, 3, expert=True)
    with pytest.raises(RequestError, match="^step 3, wait_for: 4 is not possible\n") as caught:
        words.within("start_input", 4, 3)
    assert caught.value.expected == "1, 2, 5, or 0 for none"
    with pytest.raises(RequestError, match="^project: 9{40}… is not possible\n"):
        words.within("project", int("9" * 4000))
