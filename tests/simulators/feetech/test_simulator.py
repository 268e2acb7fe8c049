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


def test_mixed_models_each_in_its_place() -> None:
    bus = simulate((7, 4, 9), "sts3215+scs0009+hls3925")
    assert {id: servo.model.name for id, servo in bus.nodes.items()} == {
        7: "sts3215",
        4: "scs0009",
        9: "hls3925",
    }


def test_a_mix_that_ships_unlike_has_one_rate_and_a_pure_bus_its_own() -> None:
    def rates(model: str, **options: object) -> list[int | None]:
        return [servo.baud_rate for servo in simulate((1, 2), model, **options).servos]

    assert rates("sm85blhv") == [115_200, 115_200]
    assert rates("sm85blhv+sm80-360m") == [115_200, 115_200]
    assert rates("sm85blhv+sts3215") == [1_000_000, 1_000_000]
    assert rates("sm85blhv+sts3215", servo_baud="57600") == [57_600, 57_600]


def test_a_rate_that_a_map_has_no_code_for() -> None:
    with pytest.raises(RequestError) as caught:
        simulate((1,), "sts3215", servo_baud=9_600)
    assert "sts3215" in caught.value.summary
    with pytest.raises(RequestError):
        simulate((1,), "sts3215", servo_baud=12_345)


def test_a_duplicate_is_another_servo_of_the_same_id_and_model() -> None:
    bus = simulate((1, 2), "sts3215+hls3925", duplicate="2")
    assert [(servo.id, servo.model.name) for servo in bus.servos] == [
        (1, "sts3215"),
        (2, "hls3925"),
        (2, "hls3925"),
    ]
    assert [servo.id for servo in simulate((1, 2), duplicate="0x1+2,2").servos] == [1, 2, 1, 2, 2]


@pytest.mark.parametrize("word", ["3", "x", "1.0"])
def test_a_duplicate_of_nobody(word: str) -> None:
    with pytest.raises(RequestError) as caught:
        simulate((1, 2), duplicate=word)
    assert word in caught.value.summary


def test_as_many_models_as_ids_or_one() -> None:
    with pytest.raises(RequestError) as caught:
        simulate((1, 2, 3), "sts3215+scs0009")
    assert "2 models for 3 ids" in caught.value.summary
