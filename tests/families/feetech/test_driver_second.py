"""The second id: read, written for good, refused wherever a write would reach two; and taken along by a new id."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.errors import DeviceError, RequestError
from motorbus.simulation.named import Simulation

NEAR = range(10)
OTHERS = ("sts3215", "scs0009", "scs215-2", "sm60-360m", "sm85blhv")


def hls(ids: Any = "3+4", model: str = "hls3925") -> Simulation:
    return motorbus.simulate("feetech", ids=ids, model=model)


def given(simulation: Simulation, new: Any, old: int = 3, **more: Any) -> Any:
    with motorbus.open(simulation.url) as bus:
        return motorbus.feetech.Servo(bus, old).set_second_id(new, **{"among": NEAR, **more})


def wear(simulation: Simulation) -> int:
    return sum(servo.memory.wear.total() for servo in simulation.simulator.servos)  # type: ignore[attr-defined]


def test_it_is_read_and_written_for_good() -> None:
    with hls() as simulation, motorbus.open(simulation.url) as bus:
        servo = motorbus.feetech.Servo(bus, 3)
        assert servo.second_id() == 3
        simulation[3].memory["torque_enable"] = 1
        assert servo.set_second_id(9, among=NEAR) == 9
        assert servo.second_id() == 9
        assert (simulation[3].memory.wear, simulation[3].locked) == ({7: 1}, True)
        assert simulation[3].memory["torque_enable"] == 0
        simulation[3].power_cycle()
        assert (servo.second_id(), simulation[4].second_id) == (9, 4)


def test_what_it_has_already_is_not_written_again_and_its_own_id_is_none() -> None:
    with hls() as simulation:
        assert given(simulation, 3) == 3
        assert wear(simulation) == 0
        given(simulation, 9)
        assert given(simulation, 3) == 3
        assert wear(simulation) == 2


@pytest.mark.parametrize("model", OTHERS)
def test_a_map_that_has_none_says_so(model: str) -> None:
    with hls("3", model) as simulation, motorbus.open(simulation.url) as bus:
        servo = motorbus.feetech.Servo(bus, 3)
        for work in (servo.second_id, lambda: servo.set_second_id(9)):
            with pytest.raises(RequestError, match="has no second id"):
                work()
    assert wear(simulation) == 0


@pytest.mark.parametrize("new", [-1, 254, True, 2.5])
def test_an_impossible_id_is_refused_before_anything_is_sent(new: Any) -> None:
    with hls() as simulation:
        with pytest.raises(RequestError, match="not the id of a servo"):
            given(simulation, new)
        assert wear(simulation) == 0


def test_an_id_that_another_answers_to_is_refused_unless_forced() -> None:
    with hls() as simulation:
        with pytest.raises(RequestError, match="the id 4 is taken"):
            given(simulation, 4)
        assert wear(simulation) == 0
        assert given(simulation, 4, force=True) == 4


def test_a_second_id_that_another_has_is_refused_unless_forced() -> None:
    with hls() as simulation:
        simulation[4].memory["second_id"] = 9
        with pytest.raises(RequestError, match="servo 4 has 9 as its second id") as caught:
            given(simulation, 9)
        assert "set_second_id(4)" in caught.value.advice
        assert wear(simulation) == 0
        assert given(simulation, 9, force=True) == 9


@pytest.mark.parametrize("force", [False, True])
def test_one_that_would_obey_as_well_is_found_first(force: bool) -> None:
    with hls() as simulation:
        simulation[4].memory["second_id"] = 3
        with pytest.raises(RequestError, match="servo 4 has 3 as its second id"):
            given(simulation, 9, force=force)
        assert wear(simulation) == 0


def test_two_with_its_id_are_refused() -> None:
    with hls((3, 3)) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        with pytest.raises(RequestError, match="two servos seem to have the id 3"):
            given(simulation, 9)
        assert wear(simulation) == 0


def test_a_servo_whose_map_is_not_known_is_refused() -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925", firmware="9.9") as simulation:
        with pytest.raises(DeviceError):
            given(simulation, 9)
        assert wear(simulation) == 0


def test_a_plain_write_names_the_verb() -> None:
    with hls() as simulation, motorbus.open(simulation.url) as bus:
        with pytest.raises(RequestError) as caught:
            motorbus.feetech.Servo(bus, 3).write(second_id=9)
        assert "set_second_id()" in caught.value.advice


# -- with a new id --------------------------------------------------------------------------------------------


def test_new_ones_get_their_ids_one_after_the_other() -> None:
    """Each joins the bus as number 1, and obeys nobody but itself afterwards."""
    with motorbus.simulate("feetech", ids=(1, 2, 3), model="hls3925") as simulation:
        servos = simulation.simulator.servos  # type: ignore[attr-defined]
        for one in servos:
            one.memory.stored[5] = one.memory.stored[7] = 1
            one.power_cycle()
            one.unplug()
        for number, one in enumerate(servos):
            one.plug()
            with motorbus.open(simulation.url) as bus:
                motorbus.feetech.Servo(bus, 1).set_id(11 + number, among=range(1, 15))
        assert [(one.id, one.second_id) for one in servos] == [(11, 11), (12, 12), (13, 13)]


def test_a_second_id_that_stands_in_the_way_is_mended_by_what_the_refusal_says() -> None:
    """As other programs leave them: renamed, and still obeying the id as shipped."""
    with motorbus.simulate("feetech", ids="1+7", model="hls3925") as simulation:
        simulation[7].memory["second_id"] = simulation[7].memory.stored[7] = 1
        with motorbus.open(simulation.url) as bus:
            fresh = motorbus.feetech.Servo(bus, 1)
            with pytest.raises(RequestError, match="servo 7 has 1 as its second id") as caught:
                fresh.set_id(2, among=NEAR)
            assert "set_second_id(7) of servo 7" in caught.value.advice
            assert motorbus.feetech.Servo(bus, 7).set_second_id(7, among=NEAR) == 7
            assert fresh.set_id(2, among=NEAR).node == 2
        assert (simulation[2].second_id, simulation[7].second_id) == (2, 7)
