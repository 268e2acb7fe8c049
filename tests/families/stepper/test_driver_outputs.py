"""Outputs by hand, and the memory of what was commanded last, which is all there is."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import OutcomeUnknown, RequestError
from tests.families.stepper.bench import bench
from tests.families.stepper.vectors import DUMP_A

UNKNOWN = {1: None, 2: None, 3: None, 5: None}


def test_at_first_nothing_is_known() -> None:
    with bench() as there:
        assert there.device.last_commanded == UNKNOWN


@pytest.mark.parametrize(
    ("port", "frame", "known"),
    [
        (1, "FF AA 00 0C 01 01 00 00 00 00 B7", {1}),
        (3, "FF AA 00 0C 03 01 00 00 00 00 B9", {3}),
        (4, "FF AA 00 0C 04 01 00 00 00 00 BA", {1, 2, 3}),
        (5, "FF AA 00 0C 05 01 00 00 00 00 BB", {5}),
    ],
)
def test_what_was_acknowledged_is_remembered(port: int, frame: str, known: set[int]) -> None:
    with bench() as there:
        there.device.ping()
        there.sent()
        there.device.set_output(port, True)
        assert there.sent() == [frame]
        assert there.device.last_commanded == {**UNKNOWN, **dict.fromkeys(known, True)}
        assert there.simulated.outputs == tuple(number in known for number in (1, 2, 3))
        assert there.simulated.state.leds is (5 in known)
        there.device.set_output(port, False)
        assert there.device.last_commanded == {**UNKNOWN, **dict.fromkeys(known, False)}
        assert there.simulated.outputs == (False, False, False)


def test_what_was_not_acknowledged_is_not_known() -> None:
    with bench() as there:
        there.device.set_output(4, True)
        there.simulated.switch(reply_fault="lost")
        with pytest.raises(OutcomeUnknown):
            there.device.set_output(2, False)
        assert there.device.last_commanded == {**UNKNOWN, 1: True, 3: True}


def test_a_project_makes_the_outputs_unknown_and_not_the_leds() -> None:
    with bench() as there:
        there.device.set_output(4, True)
        there.device.set_output(5, True)
        there.device.run(1)
        assert there.device.last_commanded == {**UNKNOWN, 5: True}


def test_two_faces_of_one_bus_have_one_memory_and_it_is_handed_out_as_a_copy() -> None:
    with bench() as there:
        there.device.set_output(1, True)
        there.device.last_commanded[1] = None
        assert type(there.device)(there.bus).last_commanded[1] is True


@pytest.mark.parametrize(
    ("port", "level"),
    [
        (0, True),
        (6, True),
        (-1, False),
        (1, 2),
        (1, None),
        (1, "on"),
        ("1", True),
        (1.0, True),
        (True, True),
        (None, True),
    ],
)
def test_bad_input_changes_nothing(port: Any, level: Any) -> None:
    with bench() as there:
        there.device.set_output(1, True)
        there.sent()
        with pytest.raises(RequestError, match="nothing was sent"):
            there.device.set_output(port, level)
        assert there.sent() == []
        assert there.device.last_commanded[1] is True


def test_the_dump_of_the_example_switches_nothing() -> None:
    with bench() as there:
        there.device.set_output(1, True)
        assert there.device.dump(1) == DUMP_A
        assert there.device.last_commanded[1] is True
