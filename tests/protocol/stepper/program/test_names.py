"""Names of inputs and outputs, both ways."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program import names

OUT = {"gripper": 1, "lamp": 3}


@pytest.mark.parametrize(
    ("said", "number"),
    [("none", 0), ("button", 2), ("input 5", 5), (5, 5), (0, 0), (" button ", 2)],
)
def test_an_input(said: object, number: int) -> None:
    assert names.input_of(said, "step 1, wait_for", {"button": 2}) == number


@pytest.mark.parametrize("said", ["Button", "5", True, 1.0, None, "", "input"])
def test_no_input(said: object) -> None:
    with pytest.raises(RequestError, match="step 1, wait_for: there is no input") as caught:
        names.input_of(said, "step 1, wait_for", {"button": 2})
    assert "button" in caught.value.expected


@pytest.mark.parametrize(
    ("said", "says"),
    [(3, "3 is not"), ("input 4", "'input 4' is not"), ("door", "'door' is input 3, and that is not")],
)
def test_inputs_3_and_4_are_for_experts(said: object, says: str) -> None:
    with pytest.raises(RequestError, match=f"step 1, stop_on: {says} possible") as caught:
        names.input_of(said, "step 1, stop_on", {"door": 3})
    assert caught.value.expected == "none, or an input: 1, 2, 5"
    assert "expert = true" in caught.value.cause
    assert names.input_of(said, "step 1, stop_on", {"door": 3}, expert=True) in (3, 4)


@pytest.mark.parametrize("said", [6, -1, "input 9"])
def test_there_is_no_sixth_input(said: object) -> None:
    with pytest.raises(RequestError, match="is not possible") as caught:
        names.input_of(said, "step 1, wait_for", {}, expert=True)
    assert (caught.value.expected, caught.value.cause) == ("none, or an input: 1, 2, 3, 4, 5", "")


@pytest.mark.parametrize("action", range(9))
def test_every_action_of_a_step_has_a_name_and_is_found_by_it(action: int) -> None:
    for table in (OUT, {}):
        said = names.output_name(action, table)
        assert names.output_of(said, "step 1, output", table) == action
    assert names.output_name(5, OUT) == "gripper off"
    assert names.output_name(2, OUT) == "output 2 on"


@pytest.mark.parametrize(
    "said", ["gripper", "gripper up", "output 0 on", "output 4 on", "on", 5, "valve on", ""]
)
def test_no_action(said: object) -> None:
    with pytest.raises(RequestError, match="nothing a step can do") as caught:
        names.output_of(said, "step 1, output", OUT)
    assert "gripper on" in caught.value.expected


def test_names_are_found_both_ways() -> None:
    assert names.input_name(2, {"button": 2}) == "button"
    assert names.input_name(1, {"button": 2}) == "input 1"
    assert names.input_name(0, {}) == "none"


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"none": 1}, "'none' is no name"),
        ({"Input 2": 1}, "is no name"),
        ({"1st": 1}, "is no name"),
        ({"a\nb": 1}, "is no name"),
        ({"a": 6}, "a = 6 is no input"),
        ({"a": 0}, "a = 0 is no input"),
        ({"a": True}, "a = True is no input"),
        ({"a": "1"}, "is no input"),
        ({"a": 1, "b": 1}, "input 1 has two names"),
        (3, "is no table"),
    ],
)
def test_what_is_no_name(table: object, says: str) -> None:
    with pytest.raises(RequestError, match=says):
        names.named(table, "input")


def test_there_are_three_outputs_and_five_inputs() -> None:
    assert names.named({"a": 5}, "input") == {"a": 5}
    with pytest.raises(RequestError, match="no output"):
        names.named({"a": 4}, "output")
