"""Another id: on every map, whoever acknowledges; and everything it is refused for, with nothing written."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.core.request import Data
from motorbus.core.steps import JournalEntry, Progress
from motorbus.errors import DeviceError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.feetech.driver import Node, set_id
from motorbus.families.feetech.simulator.memory import Written
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.simulation.named import Simulation
from tests.support.noisy_line import NoisyLine

MODELS = ("sts3215", "scs0009", "scs215-2", "sm60-360m", "sm85blhv", "hls3925")
NEAR = range(10)
ID = 5


def renamed(simulation: Simulation, new: int = 7, old: int = 3, **more: Any) -> Any:
    with motorbus.open(simulation.url) as bus:
        return motorbus.feetech.Servo(bus, old).set_id(new, **{"among": NEAR, **more})


def wear(simulation: Simulation) -> int:
    return sum(servo.memory.wear.total() for servo in simulation.simulator.servos)  # type: ignore[attr-defined]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("id_ack", ["old", "new"])
@pytest.mark.parametrize("level", [0, 1])
def test_it_is_there_under_its_new_id_for_good(model: str, id_ack: str, level: int) -> None:
    with motorbus.simulate("feetech", ids="3+4", model=model, id_ack=id_ack) as simulation:
        servo = simulation[3]
        servo.memory["status_return_level"] = level
        servo.memory["torque_enable"] = 1
        found = renamed(simulation)
        assert (found.node, found.identity.table) == (7, servo.model.table.name)
        assert (servo.id, servo.locked, servo.memory["torque_enable"]) == (7, True, 0)
        assert servo.memory.wear == ({5: 1, 7: 1} if model.startswith("hls") else {5: 1})
        servo.power_cycle()
        assert (servo.id, simulation[4].id) == (7, 4)


class Mute(PerfectLine):
    """Takes away every acknowledgement of the new id, whichever id it comes from; `fired` counts them."""

    def __init__(self) -> None:
        self.order = False
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.order = isinstance(data, bytes) and data[4:6] == b"\x03\x05"
        elif self.order:
            self.fired += 1
            return []
        return super().carry(sender, data, at)


@pytest.mark.parametrize("id_ack", ["old", "new"])
@pytest.mark.parametrize("lost", [False, True])
def test_d7_the_acknowledgement_of_a_new_id_may_come_from_either_or_not_at_all(
    id_ack: str, lost: bool
) -> None:
    with motorbus.simulate("feetech", ids="3+4", id_ack=id_ack) as simulation:
        servo, line = simulation[3], Mute()
        if lost:
            simulation.line = line
        assert renamed(simulation).node == 7
        assert line.fired == int(lost)
        assert (servo.id, servo.locked, simulation[4].id) == (7, True, 4)
        assert servo.memory.wear[5] == 1, "written once"
        servo.power_cycle()
        assert servo.id == 7


def test_the_journal_is_closed_and_tells_each_step() -> None:
    events: list[Any] = []
    with (
        motorbus.simulate("feetech", ids="3") as simulation,
        motorbus.open(simulation.url, report=events.append) as bus,
    ):
        bus.run(set_id(Node(3), 7))
        assert session.unfinished(bus) is None
    told = [event for event in events if isinstance(event, JournalEntry)]
    assert [event.state for event in told] == [
        "asked",
        "asked",
        "intent",
        "writing 7",
        "written 7",
        "outcome",
    ]
    assert told[2].facts["node"] == 3
    assert told[2].facts["new"] == 7
    assert told[-1].facts == {"outcome": "new", "node": 3, "new": 7, "new_rate": 1_000_000}
    assert [event.total for event in events if isinstance(event, Progress)][-1] == 254


def test_an_async_servo_does_the_same() -> None:
    async def work(url: str) -> int:
        async with motorbus.open_async(url) as bus:
            found = await motorbus.feetech.AsyncServo(bus, 3).set_id(7, among=NEAR)
            return found.node

    with motorbus.simulate("feetech", ids="3") as simulation:
        assert asyncio.run(work(simulation.url)) == 7
        assert simulation[7].locked


def test_what_it_has_already_is_not_written_again_but_locked() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        simulation[3].memory["lock"] = 0
        assert renamed(simulation, 3).node == 3
        assert (wear(simulation), simulation[3].locked) == (0, True)


@pytest.mark.parametrize("new", [-1, 254, 255, 256, True, 2.5])
def test_an_impossible_id_is_refused_before_anything_is_sent(new: Any) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        with pytest.raises(RequestError, match="not the id of a servo"):
            renamed(simulation, new)
        assert wear(simulation) == 0


def test_an_id_that_somebody_has_is_refused() -> None:
    with motorbus.simulate("feetech", ids="3+7+7") as simulation:
        with pytest.raises(RequestError, match="the id 7 is taken"):
            renamed(simulation)
        assert wear(simulation) == 0


def test_an_id_that_two_have_is_taken_too() -> None:
    with motorbus.simulate("feetech", ids=(3, 7, 7)) as simulation:
        simulation.simulator.servos[2].memory["max_temperature"] = 60  # type: ignore[attr-defined]
        with pytest.raises(RequestError, match="the id 7 is taken.*no answer"):
            renamed(simulation)


@pytest.mark.parametrize("model", MODELS)
def test_d1_two_with_the_old_id_are_refused(model: str) -> None:
    with motorbus.simulate("feetech", ids=(3, 3), model=model) as simulation:
        simulation.simulator.servos[-1].raw_position = 700  # type: ignore[attr-defined]
        with pytest.raises(RequestError, match="two servos seem to have the id 3") as caught:
            renamed(simulation)
        assert "one servo at a time" in caught.value.advice
        assert wear(simulation) == 0


@pytest.mark.parametrize("seed", range(20))
def test_two_that_garble_the_very_first_answer_are_said_to_be_two(seed: int) -> None:
    """Not that a line is bad, which is what the answer alone looks like."""
    with motorbus.simulate("feetech", ids=(3, 3), reply_jitter=0.0003, seed=seed) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        with motorbus.open(simulation.url) as bus:
            servo = motorbus.feetech.Servo(bus, 3)
            for verb, new in (("set_id", 7), ("set_baud", 500_000)):
                with pytest.raises(RequestError, match="two servos seem to have the id 3"):
                    getattr(servo, verb)(new, among=NEAR)
        assert wear(simulation) == 0


@pytest.mark.parametrize("second", [3, 7])
def test_an_hls_servo_that_would_obey_by_its_second_id_is_found_first(second: int) -> None:
    with motorbus.simulate("feetech", ids="3+4", model="sts3215+hls3925") as simulation:
        simulation[4].memory["second_id"] = second
        before = wear(simulation)
        with pytest.raises(RequestError, match=f"servo 4 has {second} as its second id"):
            renamed(simulation)
        assert wear(simulation) == before
        assert simulation[4].id == 4


def test_the_second_id_of_an_hls_servo_is_not_touched() -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        simulation[3].memory["second_id"] = 20
        renamed(simulation)
        assert simulation[7].memory["second_id"] == 20


def test_a_servo_whose_map_is_not_known_is_refused() -> None:
    with motorbus.simulate("feetech", ids="3", firmware="9.9") as simulation:
        with pytest.raises(DeviceError):
            renamed(simulation)
        assert wear(simulation) == 0


def not_told_its_id(servo: Any) -> None:
    """It acknowledges an order to change its id, and does nothing."""
    write = servo.memory.write

    def deaf(address: int, data: bytes, **how: bool) -> Written:
        return Written(frozenset(), False) if address == ID else write(address, data, **how)

    servo.memory.write = deaf


def test_nobody_is_no_reply() -> None:
    with motorbus.simulate("feetech", ids="4") as simulation, pytest.raises(NoReply):
        renamed(simulation)


def test_one_of_two_that_missed_the_order_is_found_out() -> None:
    """They looked like one, and one of them has not heard: said plainly, and nothing is left open."""
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        first, second = simulation.simulator.servos  # type: ignore[attr-defined]
        not_told_its_id(second)
        with pytest.raises(VerificationFailed, match="a servo answers as 3 after node 3 became 7") as caught:
            renamed(simulation)
        assert "the change is unfinished" in caught.value.__notes__[0]
        assert (first.id, second.id, first.locked, second.locked) == (7, 3, True, True)
        with motorbus.open(simulation.url) as bus:
            assert session.unfinished(bus) is not None


def test_an_order_that_is_not_heard_leaves_the_old_id_and_a_closed_journal() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        not_told_its_id(simulation[3])
        with pytest.raises(OutcomeUnknown, match="was told to become 7") as caught:
            renamed(simulation)
        assert caught.value.__notes__ == ["the servo is 3, and locked"]
        assert simulation[3].locked
        with motorbus.open(simulation.url) as bus:
            assert session.unfinished(bus) is None


@pytest.mark.parametrize("seed", range(12))
def test_on_a_noisy_line_it_ends_under_one_of_both_ids(seed: int) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        bus.link.line = NoisyLine(seed, corrupt=0.02, loss=0.02, toward=None)  # type: ignore[attr-defined]
        servo = motorbus.feetech.Servo(bus, 3)
        try:
            servo.set_id(7, among=[3])
        except motorbus.MotorbusError:
            bus.link.line = NoisyLine(seed)  # type: ignore[attr-defined]
            change = session.unfinished(bus)
            if change is not None:
                servo.recover(change.verb, change.facts)
        assert session.unfinished(bus) is None
        (one,) = simulation.simulator.nodes.values()
        assert one.locked  # type: ignore[attr-defined]
        assert set(simulation.simulator.nodes) <= {3, 7}


def test_echo_and_a_slow_start_do_no_harm() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        simulation.line = NoisyLine(1, echo=True, toward=Side.HOST)
        assert renamed(simulation).node == 7
