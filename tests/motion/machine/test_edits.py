"""Edits: the person's comments, order and blanks stay, only what was meant changes, and the result is a machine."""

from __future__ import annotations

import difflib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.machine import Machine, edited, keys
from tests.motion.machine.files import GOOD, axes

MACHINE = Machine.parse(GOOD)


def changed(after: str, before: str = GOOD) -> list[str]:
    """The lines that differ, with + and -."""
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return [line for line in lines if line[0] in "+-" and not line.startswith(("+++", "---"))]


def test_a_value_changes_and_its_comment_stays() -> None:
    after = edited(GOOD, {"axis.shoulder.zero": "12 deg"})
    assert changed(after) == [
        '-zero = "180 deg"                # measured by hand',
        '+zero = "12 deg"                # measured by hand',
    ]


SHOULDER = '-shoulder = "10 deg"             # up'
LEFT = 'axes = ["shoulder", "elbow"]    # top to bottom'


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({}, []),
        ({"name": "other"}, ['-name = "bench"', '+name = "other"']),
        ({"name": None}, ['-name = "bench"']),
        (
            {"axis.elbow.park": None, "axis.elbow.exit": "leave"},
            ['-exit = "park"', '-park = "0 deg"', '+exit = "leave"'],
        ),
        ({"axis.shoulder.park": "1 deg"}, ['+park = "1 deg"']),
        ({"axis.slide.max_step": "1 mm"}, ['+max_step = "1 mm"']),
        ({"axis.shoulder.sign": 1}, ["-sign = -1", "+sign = 1"]),
        ({"pose.ready.slide": None}, ['-slide = "30 mm"']),
        ({"pose.ready": None}, ["-[pose.ready]", SHOULDER, '-elbow = "-20 deg"', '-slide = "30 mm"']),
        ({"pose.rest": {"elbow": "1 deg"}}, ["+", "+[pose.rest]", '+elbow = "1 deg"']),
        (
            {"pose.ready": {"elbow": "1 deg"}},
            [SHOULDER, '-elbow = "-20 deg"', '-slide = "30 mm"', '+elbow = "1 deg"'],
        ),
        ({"bus.third": {"address": "x:y"}}, ["+", "+[bus.third]", '+address = "x:y"']),
        ({"axis.wrist.device": "arm#3"}, ["+", "+[axis.wrist]", '+device = "arm#3"']),
        ({"group.left.axes": ["elbow"]}, [f"-{LEFT}", '+axes = ["elbow"]    # top to bottom']),
    ],
)
def test_only_what_was_meant_changes(changes: dict[str, Any], lines: list[str]) -> None:
    assert sorted(changed(edited(GOOD, changes))) == sorted(lines)


CHANGES = st.fixed_dictionaries(
    {},
    optional={
        "name": st.sampled_from(["a", None]),
        "axis.shoulder.zero": st.sampled_from(["1 deg", "0.5 rad", None]),
        "axis.shoulder.max_step": st.sampled_from([None, "0.1 rad"]),
        "axis.elbow.zero": st.just("3 deg"),
        "axis.elbow.unit": st.just("rad"),
        "axis.slide.high": st.just("200 mm"),
        "axis.wrist": st.sampled_from([{"device": "arm#3"}, {"device": "gimbal#1", "travel": "1 m"}]),
        "bus.third": st.just({"address": "x:y"}),
        "group.right": st.just({"axes": ["elbow"]}),
        "group.left": st.just({"axes": ["slide"]}),
        "pose.ready": st.sampled_from([{"slide": "1 mm"}, None]),
        "pose.rest": st.just({"elbow": "0 rad", "slide": "0 m"}),
    },
)


MAY_GO = {
    '-name = "bench"',
    '-zero = "180 deg"                # measured by hand',
    '-max_step = "10 deg"',
    '-high = "120 mm"',
    f"-{LEFT}",
    "-[pose.ready]",
    SHOULDER,
    '-elbow = "-20 deg"',
    '-slide = "30 mm"',
}
"""Lines that one of these changes is about; what is behind a comment sign on them stays where the line does."""


@given(CHANGES)
def test_whatever_changes_the_rest_stays(changes: dict[str, Any]) -> None:
    after = edited(GOOD, changes)
    taken = [line for line in changed(after) if line.startswith("-")]
    comments = [line for line in GOOD.splitlines() if line.startswith("#")]
    assert [line for line in after.splitlines() if line.startswith("#")] == comments
    assert set(taken) <= MAY_GO
    assert edited(after, {key: value for key, value in changes.items() if value is not None}) == after
    for comment, head in (("# The shoulder was", "[axis.shoulder]"), ("# Handle with care.", "[axis.elbow]")):
        lines = after.splitlines()
        place = next(number for number, line in enumerate(lines) if line.startswith(comment))
        assert (lines[place - 1], lines[place + 1]) == ("", head)


def test_a_first_name_comes_before_the_tables() -> None:
    text = GOOD.replace('name = "bench"\n', "")
    assert changed(edited(text, {"name": "bench"}), text) == ['+name = "bench"']


def test_comments_stay_with_what_they_are_about() -> None:
    after = edited(GOOD, {"axis.shoulder.park": "1 deg", "bus.third": {"address": "x:y"}})
    assert 'torque = 0.5\npark = "1 deg"\n\n# Handle with care.\n[axis.elbow]\n' in after
    assert (
        '\n\n[bus.third]\naddress = "x:y"\n\n# The shoulder was replaced in March.\n[axis.shoulder]\n'
        in after
    )


def test_the_first_of_its_kind_comes_last() -> None:
    text = 'format = 1 # one\n\n[bus.a]\naddress = "x:y"\n# the end\n'
    after = edited(text, {"axis.b": {"device": "a#1"}, "pose.c": {"b": "1 rad"}, "group.d": {"axes": ["b"]}})
    assert after.startswith(text)
    assert Machine.parse(after).poses == {"c": {"b": 1.0}}


def test_a_file_may_be_written_from_nothing() -> None:
    after = edited("", {"format": 1, "name": "new", "bus.a.address": "x:y", "axis.b.device": "a#1"})
    assert (Machine.parse(after).name, list(Machine.parse(after).axes)) == ("new", ["b"])


@pytest.mark.parametrize(
    "text",
    [
        'format = 1\nbus = {a = {address = "x:y"}}\naxis = {b = {device = "a#1", zero = "1 rad"}} # here',
        'format = 1\n[bus]\na = {address = "x:y"}\n[axis]\nb = {device = "a#1", zero = "1 rad"} # here',
        'format = 1\n[axis.b]\ndevice = "a#1"\n[bus.a]\naddress = "x:y"\n[axis.c]\ndevice = "a#2"\n# here',
        'format = 1\n[axis]\n[axis.b]\n"device" = "a#1"\n\'zero\' = "1 rad" # here\n[bus."a"]\naddress = "x:y"',
    ],
)  # fmt: skip
def test_other_ways_to_write_a_file(text: str) -> None:
    after = edited(text, {"axis.b.zero": "2 rad", "axis.b.gear": 2.0, "axis.d.device": "a#9"})
    found = Machine.parse(after).axes
    assert (found["b"].zero, found["b"].gear, found["d"].node) == (2.0, 2.0, 9)
    assert after.count("# here") == 1


def test_a_table_among_keys_with_points_is_left_to_the_person() -> None:
    text = 'format = 1\nbus.a.address = "x:y"\naxis.b.device = "a#1"\naxis.b.zero = "1 rad" # here\n'
    after = edited(text, {"axis.b.zero": "2 rad", "axis.b.gear": 2})
    assert sorted(changed(after, text)) == [
        "+axis.b.gear = 2",
        '+axis.b.zero = "2 rad" # here',
        '-axis.b.zero = "1 rad" # here',
    ]
    with pytest.raises(RequestError, match="cannot be edited without changing more"):
        edited(text, {"axis.c.device": "a#2"})


def test_ends_of_lines_and_a_mark_at_the_start_stay() -> None:
    text = "\ufeff" + GOOD.replace("\n", "\r\n")
    after = edited(text, {"axis.shoulder.zero": "1 deg", "pose.rest": {"elbow": "1 deg"}})
    assert after.startswith("\ufeff#")
    assert after.count("\r\n") == after.count("\n") == GOOD.count("\n") + 3


@given(axes(), st.sampled_from(["shoulder", "elbow", "wrist"]))
def test_whatever_an_axis_may_be_it_can_become(spec: Any, name: str) -> None:
    text = edited(GOOD, {"pose.ready": None, "group.left": None})
    table = {
        key: f"{value!r} {keys.api_unit(row.measure.of(spec.linear))}"
        if row.measure and row.needs_unit
        else value
        for key, row in keys.AXIS.items()
        if (value := getattr(spec, key)) is not None
    }
    after = edited(text, {f"axis.{name}": {**table, "device": "arm#77"}})
    found = Machine.parse(after)
    assert found.axes[name].gear == spec.gear
    assert {**found.axes, name: None} == {**MACHINE.axes, name: None}
    assert "\n\n# Handle with care.\n[axis.elbow]\n" in after


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"axis.shoulder.low": "91 deg"}, "axis.shoulder.low: 91.0 deg is above high"),
        ({"axis.shoulder.zer": 1}, "axis.shoulder.zer: there is no such key"),
        ({"axis.elbow.exit": None, "axis.elbow.speed": None}, "axis.elbow.speed: it is not there"),
        ({"axis.shoulder": None}, "pose.ready.shoulder: there is no axis 'shoulder'"),
        ({"name.x": 1}, "name: this is no table"),
        ({"axis..low": 1}, '"axis..low": this is no place'),
        ({"a.b.c.d": 1}, '"a.b.c.d": this is no place'),
        ({"": 1}, '"": this is no place'),
        ({"axis.shoulder.low": object()}, "axis.shoulder.low: this cannot stand in a file"),
        ({"axis.shoulder.low": float("nan")}, "axis.shoulder.low: nan is no finite number"),
        ({"format": None}, "format: is missing"),
        ({"axis.shoulder.low": {"a": 1}}, "axis.shoulder.low: this is no table"),
    ],
)
def test_an_edit_that_gives_no_machine_is_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(RequestError) as caught:
        edited(GOOD, changes)
    assert caught.value.summary.startswith(says)


def test_addresses_are_judged_in_edits_too() -> None:
    def check(address: str) -> None:
        raise RequestError(f"not {address}", expected="another", advice="no")

    with pytest.raises(RequestError, match=r"bus\.arm\.address: not feetech"):
        edited(GOOD, {"name": "x"}, check_address=check)
