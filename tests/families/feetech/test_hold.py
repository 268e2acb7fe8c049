"""An emergency stop: torque off for all, except for those that it holds where they are."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.core.family import Stop
from motorbus.errors import RequestError
from motorbus.families.feetech import FAMILY, Servo
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import Mode
from tests.families.feetech.worlds import MODELS, MODES, RATES, later, put_mode, traffic, world


@pytest.mark.parametrize("name", TABLES)
def test_a_stop_lets_all_go(name: str) -> None:
    with world(name, ids="1-3") as (bus, _, simulation):
        for id in (1, 2, 3):
            Servo(bus, id).enable_torque()
        with traffic(bus) as sent:
            outcome = bus.estop()
        assert sent[0] == "fe 04 03 28 00"
        assert sorted(outcome.acknowledged) == [1, 2, 3]
        assert not any(simulation[id].memory["torque_enable"] for id in (1, 2, 3))


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_a_held_servo_stays_where_it_is_or_is_limp_where_no_order_holds_it(name: str, mode: Mode) -> None:
    options = {"ids": "1-2", "model": MODELS[name]}
    with (
        motorbus.simulate("feetech", **options) as simulation,
        motorbus.open(f"{simulation.url},estop_hold=1", baud=RATES.get(name, 1_000_000)) as bus,
    ):
        servo = Servo(bus, 1)
        put_mode(servo, mode)
        for id in (1, 2):
            Servo(bus, id).enable_torque()
        if mode is Mode.POSITION:
            servo.move(servo.position() + 1.0, velocity=1.0, wait=False)
            later(bus, 0.3)
        outcome = bus.estop()
        assert sorted(outcome.acknowledged) == [1, 2]
        holds = mode in (Mode.POSITION, Mode.VELOCITY)
        assert simulation[1].memory["torque_enable"] == (1 if holds else 0)
        assert simulation[2].memory["torque_enable"] == 0
        stood = simulation[1].motion.position(bus.link.now())
        later(bus, 1.0)
        assert simulation[1].motion.position(bus.link.now()) == pytest.approx(stood, abs=60)


def test_a_limp_servo_stays_limp() -> None:
    with (
        motorbus.simulate("feetech", ids="1") as simulation,
        motorbus.open(f"{simulation.url},estop_hold=1") as bus,
    ):
        Servo(bus, 1).ping()
        bus.estop()
        assert simulation[1].memory["torque_enable"] == 0


def test_unknown_ids_beside_the_held_ones_are_made_limp_too() -> None:
    driver = FAMILY.open(estop_hold="1-3+7")
    stop: Stop = driver.stop({})
    limp = b"".join(
        bytes(one.wire) for one in stop.requests if isinstance(one.wire, bytes) and one.wire[4] == 0x83
    )
    assert all(bytes((id, 0)) in limp for id in (0, 4, 8, 100, 253))
    reads = [one for one in stop.requests if one.expected and not one.effect]
    assert [one.expected[0].node for one in reads] == [1, 2, 3, 7]  # type: ignore[index]
    assert "held" in stop.promise


@pytest.mark.parametrize("text", ["x", "254", "1,2", "-1"])
def test_bad_ids_are_refused_when_the_bus_is_opened(text: str) -> None:
    with pytest.raises(RequestError):
        FAMILY.open(estop_hold=text)


def test_probes_differ_in_length_from_all_that_is_in_common_use() -> None:
    driver: Any = FAMILY.open()
    lengths = [driver.probe(1, attempt).expected[0].length - 6 for attempt in range(16)]
    assert len(set(lengths)) >= 16
    assert not {1, 2, 4, 5, 6, 7, 8, 11, 15, 40, 58} & set(lengths)
