"""The family as the rest of motorbus sees it."""

from __future__ import annotations

import subprocess
import sys

import pytest

import motorbus
from motorbus import families
from motorbus.core.family import AxisDriver, Family, Identity
from motorbus.core.request import Expected, Reply, TimeoutClass
from motorbus.families import feetech
from motorbus.families.feetech import FAMILY, AsyncServo, Servo
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import packet, play, reads


def test_it_is_found_by_its_name_and_fulfils_the_contract() -> None:
    family: Family = FAMILY
    assert families.load("feetech") is family
    assert motorbus.feetech is feetech
    assert (family.name, family.open().window) == ("feetech", 1)
    assert family.devices[:2] == (Servo, AsyncServo)
    assert list(family.registers) == ["sts", "smbl", "smcl", "scs", "scs2", "hls"]


def test_it_asks_for_bytes_at_a_megabaud_and_knows_twelve_rates() -> None:
    link = FAMILY.link
    assert (link.kind, link.rate, len(link.rates)) == ("bytes", 1_000_000, 12)
    assert {76_800, 128_000, 4_800} < set(link.rates)
    assert all(option.help for option in FAMILY.simulator_options())


def test_times_come_from_the_line() -> None:
    probe = FAMILY.open().probe(3, 0)
    assert FAMILY.open().air_time(probe, 1_000_000) == pytest.approx((8 + 9) * 1e-5)
    assert FAMILY.open().turnaround(probe) == pytest.approx(0.001508)
    assert FAMILY.open().quiet_time(1_000_000) == pytest.approx(0.040, abs=0.0002)


def test_the_echo_test_asks_for_one_byte_of_node_1() -> None:
    test = FAMILY.open().echo_test()
    assert test is not None
    assert test.wire == packet(1, 2, 5, 1)
    assert test.reply_within is TimeoutClass.SCAN


def test_each_receiver_is_a_new_one() -> None:
    one, other = FAMILY.open().receiver(), FAMILY.open().receiver()
    assert one.feed(packet(3, 0)[:4]) == []
    assert other.feed(packet(4, 0)) == [Reply(0, 4, packet(4, 0))]
    assert one.feed(packet(3, 0)[4:]) == [Reply(0, 3, packet(3, 0))]


def test_stop_lets_go_of_every_node_it_is_given() -> None:
    stop = FAMILY.open().stop({3: None, 1: None})
    assert [frame.expected for frame in stop.requests] == [(), (Expected(1, 1, 6),), (Expected(3, 3, 6),)]
    assert "limp" in stop.promise


def test_identify_and_scan_need_no_servo_object() -> None:
    head = reads(3, 0, 3, 10, 0, 9, 3)
    assert play(FAMILY.open().identify(3), head).model == "STS3215"
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        found = bus.run(FAMILY.open().scan((3,)))
    assert [(one.node, one.rate) for one in found] == [(3, 1_000_000)]


def test_what_explains_a_frame_is_the_family_s() -> None:
    (explanation,) = FAMILY.open().decode(packet(3, 2, 56, 2))
    assert explanation.fault == ""


def axis(table: str, model: str = "unknown model 10.27") -> AxisDriver:
    return FAMILY.open().axis(Identity(1, model, "3.10", table))


@pytest.mark.parametrize("table", sorted(TABLES))
def test_a1_every_servo_with_a_known_map_is_an_axis(table: str) -> None:
    everyone = {"position", "move", "stop", "state", "enable_torque", "disable_torque", "limits", "stream"}
    assert everyone <= axis(table).names


def test_a_map_that_tells_no_current_lacks_that() -> None:
    assert "current" in axis("sts")
    assert "current" in axis("scs2")
    assert "current" not in axis("scs")


@pytest.mark.parametrize("table", sorted(TABLES))
def test_caps_are_there_where_the_map_has_a_register_in_ram(table: str) -> None:
    assert ("cap_torque" in axis(table)) == (table in {"sts", "smbl", "hls"})
    assert ("cap_current" in axis(table)) == (table == "hls")


@pytest.mark.parametrize("model", ["unknown model 9.99", "STS9999", ""])
def test_without_map_and_model_there_is_no_axis(model: str) -> None:
    assert not axis("", model).names


def test_the_simulator_is_a_bus_of_the_usual_model() -> None:
    assert list(FAMILY.simulator((4, 7)).nodes) == [4, 7]
    with pytest.raises(motorbus.RequestError, match="sts9999"):
        FAMILY.simulator((1,), "sts9999")


def test_importing_the_family_does_not_import_its_simulator() -> None:
    program = (
        "import sys, motorbus.families.feetech; "
        "print([m for m in sys.modules if 'feetech.simulator' in m or 'feetech.explain' in m])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
