"""An emergency stop that holds: who tells where it is stays there, whatever its mode, and nobody else is let fall."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus.core.request import Data, Expected, Priority, Reply, Response
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.holding import COUNT, PROMISE, ask, held_ids, holds, resting
from motorbus.families.feetech.driver.line import stop
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.feetech.driver_script import ALL, READ, SYNC_WRITE, WRITE, packet
from tests.families.feetech.maps import HEADS, MODELS, eeprom

HERE = bytes((0x34, 0x02))


class Mute(PerfectLine):
    """A wire on which nothing that servo 2 says arrives."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        lost = sender is Side.DEVICE and isinstance(data, bytes) and data[2] == 2
        return [] if lost else super().carry(sender, data, at)


def registers(name: str, *, torque: int = 1, here: bytes = HERE, **changes: int) -> bytes:
    """Registers 0 to 57 of servo 3."""
    image = bytearray(eeprom(name, **changes)) + bytes(18)
    image[40] = torque
    image[56:58] = here
    return bytes(image)


def answered(data: bytes, node: int = 3) -> Response:
    return Response((Reply(0, node, packet(node, 0, *data)),), (), 1.0)


@pytest.mark.parametrize(
    ("said", "ids"),
    [("", set()), ("1", {1}), ("1+4", {1, 4}), ("1-3+0x7", {1, 2, 3, 7}), ((2, 5), {2, 5}), ("3-1", set())],
)
def test_ids_are_written_as_everywhere(said: Any, ids: set[int]) -> None:
    assert held_ids(said) == ids


@pytest.mark.parametrize("said", ["x", "1+", "254", "1-300", "1,2", (254,), (True,)])
def test_what_is_no_id_is_refused(said: Any) -> None:
    with pytest.raises(RequestError):
        held_ids(said)


def test_everything_that_matters_is_asked_in_one_read_with_the_rank_of_a_stop() -> None:
    exchange = ask(3)
    assert exchange.wire == packet(3, READ, 0, 58)
    assert (exchange.expected, exchange.priority) == ((Expected(3, 3, 64),), Priority.STOP)
    assert exchange.reports_position


@pytest.mark.parametrize("name", MODELS)
def test_in_position_mode_the_goal_becomes_the_place_where_it_is(name: str) -> None:
    here = bytes(reversed(HERE)) if name.startswith("scs") else HERE
    block = resting(3, registers(name, here=here))
    assert (block.address, block.data) == (42, here)
    assert block.goals[0].low == block.goals[0].value == block.goals[0].high


@pytest.mark.parametrize("name", MODELS)
def test_who_is_limp_stays_limp(name: str) -> None:
    block = resting(3, registers(name, torque=0))
    assert (block.address, block.data) == (40, b"\0")


@pytest.mark.parametrize("name", ["sts", "smbl", "hls"])
def test_in_velocity_mode_it_gets_no_velocity(name: str) -> None:
    block = resting(3, registers(name, operating_mode=1))
    assert (block.address, block.data) == (46, b"\0\0")


@pytest.mark.parametrize("mode", [2, 3, 9])
def test_where_no_order_means_stay_it_is_torque_off(mode: int) -> None:
    assert resting(3, registers("sts", at_33=mode)).address == 40


def test_of_a_map_that_nobody_has_described_nothing_but_the_switch_is_written() -> None:
    assert resting(3, registers("sts", at_0=99, at_1=99, at_3=99)).address == 40


def test_nobody_is_sent_turns_away() -> None:
    """Goals count over many turns (both limits 0), and its position is told within one (phase, bit 4)."""
    both: dict[str, Any] = {"min_position_limit": 0, "max_position_limit": 0}
    assert resting(3, registers("sts", phase=0, **both)).address == 40
    assert resting(3, registers("sts", phase=0x10, **both)).address == 42


@given(st.sampled_from(sorted(MODELS)), st.binary(min_size=58, max_size=58))
def test_whatever_a_servo_says_there_is_an_order_for_it(name: str, data: bytes) -> None:
    head = registers(name)[:5]
    for image in (data, head + data[5:]):
        assert resting(3, image).address in (40, 42, 46)


def test_only_an_answer_to_this_very_question_counts() -> None:
    data = registers("sts")
    assert holds({3: answered(data)}, {3})[0].wire == packet(3, WRITE, 42, *HERE)
    for other in (None, answered(HERE), answered(data[:40]), answered(data, node=4)):
        assert holds({3: other}, {3})[0].wire == packet(3, READ, 0, COUNT)


def test_nobody_else_keeps_torque_and_those_who_hold_never_lose_it() -> None:
    frames, promise = stop({1: None, 3: None}, {3, 200})
    requests = [frame.wire for frame in frames]
    assert requests[:4] == [
        packet(ALL, SYNC_WRITE, 40, 1, 1, 0),
        packet(1, WRITE, 40, 0),
        packet(3, READ, 0, 58),
        packet(200, READ, 0, 58),
    ]
    limp = [node for request in requests[4:] for node in bytes(request)[7:-1:2]]  # type: ignore[arg-type]
    assert limp == [node for node in range(254) if node not in (1, 3, 200)]
    assert {frame.priority for frame in frames} == {Priority.STOP}
    assert promise.endswith(PROMISE)


@pytest.mark.parametrize("name", HEADS)
def test_on_a_bus_one_holds_where_it_is_while_the_others_let_go(name: str) -> None:
    with motorbus.simulate("feetech", ids="1-3", model=MODELS[name]) as sim:
        sim.pace = True
        with motorbus.open(sim.url, estop_hold="2") as bus:
            servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2, 3)]
            for servo in servos:
                servo.enable_torque()
            servos[1].move(servos[1].position() + 1.0, velocity=0.5, wait=False)
            bus.link.advance(0.5)  # type: ignore[attr-defined]
            goal, there = sim[2].memory["goal_position"], sim[2].raw_position
            outcome = bus.estop()
            assert set(outcome.acknowledged) == {1, 2, 3}
            assert [sim[node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 1, 0]
            bus.link.advance(2.0)  # type: ignore[attr-defined]
            assert abs(sim[2].raw_position - there) < abs(goal - there) / 4


def test_who_cannot_be_read_keeps_its_torque_and_its_goal() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url, estop_hold="2") as bus:
        for node in (1, 2):
            motorbus.feetech.Servo(bus, node).enable_torque()
        goal = sim[2].memory["goal_position"]
        sim.line = Mute()
        outcome = bus.estop()
        assert (outcome.acknowledged, outcome.silent, outcome.rounds) == ((1,), (2,), 5)
        assert (sim[2].memory["torque_enable"], sim[2].memory["goal_position"]) == (1, goal)
        assert sim[1].memory["torque_enable"] == 0
