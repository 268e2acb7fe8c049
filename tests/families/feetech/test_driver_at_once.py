"""REG WRITE to several servos: everyone begins at the same moment, or nobody moves, whatever goes wrong on the way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import tau
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Data
from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.feetech import Servo, action_all, reg_write_all
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.gate import Gate

COUNT = tau / 4096
IDS = (1, 2, 3, 4)
GOAL = {"goal_position": 2500 * COUNT}
REG_WRITE, ACTION = 4, 5
FIRST, SECOND, LAST = 1, 2, 4


class Wire(PerfectLine):
    """Keeps the instructions that the host sends; on its way home the first acknowledgement of REG WRITE by `lost` is
    lost, and what `meanwhile` does happens when the REG WRITE for that servo has arrived."""

    def __init__(self, lost: int = 0) -> None:
        self.sent: list[tuple[int, int]] = []
        self.lost = lost
        self.cut: int | None = None

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.HOST:
            self.sent.append((data[2], data[4]))
            if self.sent[-1] == (self.cut, REG_WRITE):
                self.cut = None
                raise KeyboardInterrupt
            return super().carry(sender, data, at)
        if self.sent[-1:] == [(self.lost, REG_WRITE)]:
            self.lost = 0
            return []
        return super().carry(sender, data, at)

    def said(self, instruction: int) -> list[int]:
        return [node for node, said in self.sent if said == instruction]


@contextmanager
def four(**options: Any) -> Iterator[tuple[Any, Any, list[Servo], Wire]]:
    """A simulation, its bus, four servos of it that hold, and the wire."""
    with motorbus.simulate("feetech", ids="1-4", **options) as sim, motorbus.open(sim.url) as bus:
        servos = [Servo(bus, node) for node in IDS]
        for servo in servos:
            servo.enable_torque()
        sim.line = wire = Wire()
        yield sim, bus, servos, wire


def orders(servos: list[Servo]) -> dict[Servo, dict[str, float]]:
    return dict.fromkeys(servos, GOAL)


def places(sim: Any, bus: Any, seconds: float = 3.0) -> list[int]:
    """Where the shafts are after a while."""
    bus.link.advance(seconds)
    return [sim[node].raw_position for node in IDS]


def all_released(sim: Any, bus: Any) -> list[int]:
    """Where they are after somebody whom nobody asked has sent ACTION to everyone."""
    bus.run(action_all())
    return places(sim, bus)


def test_they_begin_in_the_same_instant_each_having_acknowledged() -> None:
    with four() as (sim, bus, servos, wire):
        bus.run(reg_write_all(orders(servos)))
        assert wire.said(REG_WRITE) == [1, 2, 3, 4]
        assert wire.said(ACTION) == [254]
        assert len({sim.simulator.nodes[node].motion.start for node in IDS}) == 1
        assert places(sim, bus) == [2500] * 4
        assert {servo.read_raw("reg_write_pending")["reg_write_pending"] for servo in servos} == {0}


def test_ids_alone_will_do_and_each_may_get_other_registers() -> None:
    with four() as (sim, bus, _, wire):
        bus.run(reg_write_all({1: GOAL, 2: {"goal_velocity": 1.0}}))
        assert (wire.said(REG_WRITE), wire.said(ACTION)) == ([1, 2], [254])
        assert places(sim, bus) == [2500, 2048, 2048, 2048]


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("dead", [FIRST, SECOND, LAST])
def test_a_dead_servo_keeps_everyone_where_he_is(dead: int, known: bool) -> None:
    with four() as (sim, bus, servos, wire):
        sim[dead].unplug()
        with pytest.raises(OutcomeUnknown if known else NoReply) as caught:
            bus.run(reg_write_all(orders(servos)) if known else reg_write_all(dict.fromkeys(IDS, GOAL)))
        assert caught.value.node == dead
        assert wire.said(ACTION) == []
        sim[dead].plug()
        assert places(sim, bus) == [2048] * 4
        assert all_released(sim, bus) == [2048] * 4
        if known:
            assert any(f"servo {dead} " in note for note in caught.value.__notes__)
        else:
            assert wire.said(REG_WRITE) == []


@pytest.mark.parametrize("lost", [FIRST, SECOND, LAST])
def test_a_lost_acknowledgement_keeps_everyone_where_he_is(lost: int) -> None:
    with four() as (sim, bus, servos, wire):
        wire.lost = lost
        with pytest.raises(OutcomeUnknown) as caught:
            bus.run(reg_write_all(orders(servos)))
        assert caught.value.node == lost
        assert not hasattr(caught.value, "__notes__")
        assert wire.said(ACTION) == []
        assert wire.said(REG_WRITE) == [*range(1, lost + 1), *range(1, lost + 1)]
        assert all_released(sim, bus) == [2048] * 4
        assert [servo.read_raw("lock")["lock"] for servo in servos] == [1] * 4


def test_afterwards_it_can_be_said_again() -> None:
    with four() as (sim, bus, servos, wire):
        wire.lost = LAST
        with pytest.raises(OutcomeUnknown):
            bus.run(reg_write_all(orders(servos)))
        bus.run(reg_write_all(orders(servos)))
        assert places(sim, bus) == [2500] * 4


def test_an_alarm_keeps_everyone_where_he_is_unless_somebody_wants_it_so() -> None:
    with four() as (sim, bus, servos, wire):
        sim[3].alarm = 0x01
        with pytest.raises(DeviceError, match="node 3 tells an alarm"):
            bus.run(reg_write_all(orders(servos)))
        assert wire.said(ACTION) == []
        assert all_released(sim, bus) == [2048] * 4
        bus.run(reg_write_all(orders(servos), despite_alarms=True))
        assert places(sim, bus) == [2500] * 4


def test_a_goal_that_the_gate_refuses_keeps_everyone_where_he_is() -> None:
    with four() as (sim, bus, servos, wire):
        assert isinstance(bus.interlock, Gate)
        bus.interlock.faults[3] = "it has started anew"
        with pytest.raises(MotorbusError, match="started anew"):
            bus.run(reg_write_all(orders(servos)))
        assert wire.said(ACTION) == []
        assert all_released(sim, bus) == [2048] * 4


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({1: GOAL, 2: {"goal_position": 1e9}}, RequestError),
        ({1: GOAL, 2: {"goal_position": 7.0}}, LimitExceeded),
        ({1: GOAL, 2: {"goal_position": float("nan")}}, RequestError),
        ({1: GOAL, 2: {"id": 7}}, RequestError),
        ({1: GOAL, 2: {"goal_position": 1.0, "torque_limit": 0.5, "lock": 1}}, RequestError),
        ({}, RequestError),
    ],
)
def test_what_cannot_be_ordered_is_refused_before_anything_is_handed_over(
    values: dict[int, dict[str, float]], error: type[MotorbusError]
) -> None:
    with four() as (sim, bus, _, wire):
        with pytest.raises(error):
            bus.run(reg_write_all(values))
        assert (wire.said(ACTION), all_released(sim, bus)) == ([], [2048] * 4)


def test_ctrl_c_in_the_middle_takes_back_what_was_handed_over() -> None:
    with four() as (sim, bus, servos, wire):
        wire.cut = 3
        with pytest.raises(KeyboardInterrupt):
            bus.run(reg_write_all(orders(servos)))
        assert wire.said(ACTION) == []
        assert all_released(sim, bus) == [2048] * 4


def test_servos_that_drop_a_second_one_are_not_released_from_here() -> None:
    with four(reg_write_again="refuse") as (sim, bus, servos, wire):
        wire.lost = LAST
        with pytest.raises(OutcomeUnknown):
            bus.run(reg_write_all(orders(servos)))
        with pytest.raises(RequestError, match="taken back"):
            bus.run(action_all(servos))
        with pytest.raises(RequestError, match="taken back"):
            servos[0].action()
        assert places(sim, bus) == [2048] * 4


def test_whoever_knows_that_a_second_one_is_dropped_can_say_so() -> None:
    with four(reg_write_again="refuse") as (sim, bus, servos, wire):
        wire.lost = LAST
        with pytest.raises(OutcomeUnknown) as caught:
            bus.run(reg_write_all(orders(servos), replaces=False))
        assert "servo 1, 2, 3, 4 was handed may wait there still" in caught.value.__notes__[0]
        assert wire.said(REG_WRITE) == [1, 2, 3, 4]
        with pytest.raises(RequestError, match="a REG WRITE waits in node 1 already"):
            bus.run(reg_write_all(orders(servos), replaces=False))
        for node in IDS:
            sim[node].power_cycle()
        bus.link.advance(2.0)
        for servo in servos:
            servo.enable_torque()
        bus.run(reg_write_all(orders(servos), replaces=False))
        assert places(sim, bus) == [2500] * 4


@pytest.mark.parametrize("model", ["sts3215", "scs0009", "hls3925"])
def test_servos_that_acknowledge_nothing_say_that_it_waits(model: str) -> None:
    with (
        motorbus.simulate("feetech", ids="1-2", model=model, servo_baud=1_000_000) as sim,
        motorbus.open(sim.url, baud=1_000_000) as opened,
    ):
        bus: Any = opened
        servos = [Servo(bus, node) for node in (1, 2)]
        for servo in servos:
            servo.write(status_return_level=0)
            servo.enable_torque()
        here = servos[0].position()
        before = sim[2].raw_position
        bus.run(reg_write_all({servo: {"goal_position": here + 0.2} for servo in servos}))
        bus.link.advance(2.0)
        assert abs(sim[2].raw_position - before) > 10
        sim[2].unplug()
        there = sim[1].raw_position
        with pytest.raises(MotorbusError):
            bus.run(reg_write_all({servo: {"goal_position": here} for servo in servos}))
        bus.run(action_all())
        bus.link.advance(2.0)
        assert abs(sim[1].raw_position - there) <= 1
