"""Who is there, what it is, and whether it is alone."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.family import Found, Identity
from motorbus.core.scan import Skipped
from motorbus.families.feetech import FAMILY, Node, ScanWarning, Servo, scan
from motorbus.families.feetech.protocol import Instruction
from motorbus.families.feetech.registers import TABLES
from tests.families.feetech.worlds import MODELS, later, traffic, world


@pytest.mark.parametrize("name", TABLES)
def test_a_servo_says_what_it_is_and_how_it_is_set(name: str) -> None:
    with world(name) as (bus, servo, _):
        with traffic(bus) as sent:
            found = servo.identify()
        assert sent == ["01 04 02 00 28"]
        assert found.model.lower() == MODELS[name]
        assert (found.table, found.details["register_map"], found.details["writable"]) == (name, name, True)
        assert found.details["mode"] == "position"
        assert bus.driver.facts.maps == {1: name}


def test_a_known_map_gives_an_axis_whatever_the_model_number() -> None:
    driver = FAMILY.open()
    axis = driver.axis(Identity(1, "unknown model 10.27", "3.43", "hls"))
    assert {"move", "stream", "stop", "cap_torque"} <= axis.names
    assert driver.axis(Identity(1, "STS3215", "9.99", "")).names == frozenset()
    assert "cap_torque" not in driver.axis(Identity(1, "SCS0009", "0.10", "scs")).names
    assert "current" not in driver.axis(Identity(1, "SCS0009", "0.10", "scs")).names


@pytest.mark.parametrize("mode", ["velocity", "pwm", "step"])
def test_a_servo_in_another_mode_has_an_axis_of_that_kind(mode: str) -> None:
    with world() as (bus, servo, _):
        servo.set_mode(mode)
        found = servo.identify()
        assert found.details["mode"] == mode
        axis = bus.driver.axis(found)
        assert not axis.names & {"move", "limits", "travel", "stream"}
        assert ("jog" in axis) == ("set_velocity" in axis) == (mode == "velocity")
        assert {"stop", "max_velocity"} <= axis.names


def test_the_axis_of_a_wheel_turns_it_and_stops_it() -> None:
    with world() as (bus, servo, _):
        servo.set_mode("velocity")
        axis = bus.driver.axis(servo.identify())
        bus.run(axis.enable_torque(servo))
        bus.run(axis.set_velocity(servo, 1.5))
        later(bus, 0.5)
        assert servo.velocity() == pytest.approx(1.5, abs=0.01)
        bus.run(axis.stop(servo))
        later(bus, 0.5)
        assert servo.velocity() == 0


@pytest.mark.parametrize(
    ("model", "velocity"), [("sts3215", 5.216), ("sts3250", 7.87), ("scs15", 5.76), ("hls3925", None)]
)
def test_the_highest_velocity_is_that_of_the_model_where_a_source_tells_it(
    model: str, velocity: float | None
) -> None:
    with world(model) as (bus, servo, _):
        axis = bus.driver.axis(servo.identify())
        assert bus.run(axis.max_velocity(servo)) == (velocity and pytest.approx(velocity, abs=0.01))


def test_the_arc_of_an_scs_is_its_models_or_that_of_the_bus() -> None:
    with world("scs15") as (bus, servo, _):
        found = servo.identify()
        assert found.details["arc"] == 200
        assert "manual" in str(found.details["arc_doubt"])
        lowest, highest = servo.read("limits").values()
        assert servo.position() == pytest.approx(512 / 1024 * 3.4907, abs=0.05)
        bus.driver.facts.arcs = {1: 180.0}
        other = Servo(bus, 1)
        assert other.identify().details["arc"] == 180
        assert "arc_doubt" not in other.identify().details
        assert other.read("limits")["max_position_limit"] == pytest.approx(highest * 0.9)
        assert lowest < highest


@pytest.mark.parametrize("text", ["3", "3:", "300:10", "3:0", "3:x", "3:10;4:10"])
def test_a_bad_arc_is_refused_when_the_bus_is_opened(text: str) -> None:
    with pytest.raises(ValueError, match="arc"):
        FAMILY.open(arc=text)


def test_ping_tells_silence_from_an_answer() -> None:
    with world() as (bus, servo, _):
        assert servo.ping() is True
        assert Servo(bus, 9).ping() is False
    for wrong in (-1, 254, 255, True, "1"):
        with pytest.raises(ValueError, match="not the id"):
            Node(wrong)  # type: ignore[arg-type]


def found_by(bus: Any, *arguments: Any) -> tuple[list[Found], list[Any]]:
    events: list[Any] = []
    return bus.run(scan(*arguments), report=events.append), events


def test_scan_asks_each_id_once_and_identifies_what_answers() -> None:
    with world(ids="1-3,200") as (bus, _, _simulation), traffic(bus) as sent:
        found, events = found_by(bus)
        assert [(one.node, one.rate) for one in found] == [(id, 1_000_000) for id in (1, 2, 3, 200)]
        assert all(one.identity and one.identity.model == "STS3215" for one in found)
        assert [one for one in events if isinstance(one, ScanWarning)] == []
    assert sent[:254] == [f"{id:02x} 04 02 05 01" for id in range(254)]
    assert not {one for one in sent[254:] if one[:2] not in ("01", "02", "03", "c8")}


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_scan_finds_servos_that_do_not_answer_a_broadcast(name: str) -> None:
    with world(name, ids="1,2") as (bus, _, _):
        assert [one.node for one in found_by(bus)[0]] == [1, 2]


def test_scan_finds_a_board_that_answers_read_and_not_ping() -> None:
    with world(
        ids="1,2",
    ) as (bus, _, simulation):
        simulation[2].lacks = {Instruction.PING, Instruction.SYNC_READ}
        found, _ = found_by(bus, (1, 2, 3))
        assert [one.node for one in found] == [1, 2]
        assert found[1].identity is not None


def test_scan_over_rates_restores_the_rate_and_skips_what_the_adapter_lacks() -> None:
    with world(ids="1,2") as (bus, servo, _):
        servo.set_baud(500_000)
        found, events = found_by(bus, (1, 2), (500_000, 1_000_000))
        assert [(one.node, one.rate) for one in found] == [(1, 500_000), (2, 1_000_000)]
        assert bus.rate == 1_000_000
        assert [one for one in events if isinstance(one, Skipped)] == []


def test_scan_warns_of_two_servos_with_one_id() -> None:
    with world(ids="1,2") as (bus, _, simulation):
        simulation.simulator.duplicate(2)
        found, events = found_by(bus, (1, 2))
        assert [one.node for one in found] == [1, 2]
        assert [one.node for one in events if isinstance(one, ScanWarning)] == [2]


def test_scan_writes_nothing() -> None:
    with world(ids="1-3") as (bus, _, _), traffic(bus) as sent:
        found_by(bus)
    assert {one.split(" ")[2] for one in sent} == {"02"}
