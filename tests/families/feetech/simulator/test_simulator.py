"""Making a simulated bus from what a person or a bus string says."""

from __future__ import annotations

import pytest

from motorbus.core.family import Simulator
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import OPTIONS, simulate


def test_it_is_a_simulator() -> None:
    bus: Simulator = simulate((1, 2))
    assert set(bus.nodes) == {1, 2}
    assert (bus.due(), bus.advance(1.0)) == (None, [])


def test_positions_for_all_or_by_id() -> None:
    assert [servo.raw_position for servo in simulate((1, 2)).servos] == [2048, 2048]
    assert [servo.raw_position for servo in simulate((1, 2), position="1304").servos] == [1304, 1304]
    assert [servo.raw_position for servo in simulate((1, 2), position={2: 7}).servos] == [2048, 7]


def test_options_reach_the_switches() -> None:
    assert simulate((1,), "sts3215", id_ack="old").switches.id_ack == "old"


@pytest.mark.parametrize("wrong", [{"position": "left"}, {"no_such": "1"}, {"id_ack": "both"}])
def test_wrong_options_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(RequestError):
        simulate((1,), **wrong)


def test_options_name_the_position_too() -> None:
    assert OPTIONS[0].name == "position"
