"""The family as the rest of motorbus sees it."""

from __future__ import annotations

import subprocess
import sys

import pytest

import motorbus
from motorbus import families
from motorbus.core.family import Family
from motorbus.families import kst
from motorbus.families.kst import FAMILY, AsyncServo, KstDriver, Servo
from motorbus.families.kst.profiles import PROFILES, RATES
from tests.families.kst.bench import bench


def test_it_is_found_by_its_name_and_fulfils_the_contract() -> None:
    family: Family = FAMILY
    assert families.load("kst") is family
    assert motorbus.kst is kst
    assert (family.name, family.open().window, family.open().lane(1), family.open().lane(127)) == (
        "kst",
        16,
        1,
        127,
    )
    assert family.devices[:2] == (Servo, AsyncServo)
    assert list(family.registers) == ["kst", "kst-ext", "kingmax", "xqpower"]
    assert family.open().echo_test() is None


def test_it_asks_for_frames_at_the_rate_as_shipped() -> None:
    link = FAMILY.link
    assert (link.kind, link.rate, link.rates) == ("frames", 500_000, RATES)
    assert [option.name for option in link.settings] == ["profile", "id_format", "sized", "nmt"]
    assert all(option.help for option in (*link.settings, *FAMILY.simulator_options()))


def test_each_bus_has_a_family_of_its_own() -> None:
    one = FAMILY.open(profile="xqpower")
    other = FAMILY.open(profile="xqpower", id_format="ext")
    assert isinstance(one, KstDriver)
    assert isinstance(other, KstDriver)
    assert one.settings.state is not other.settings.state


@pytest.mark.parametrize("profile", PROFILES)
def test_capabilities_are_those_of_the_profile(profile: str) -> None:
    with bench(profile=profile) as there:
        model = there.servo().identify().model
    axis = FAMILY.open().axis(model)
    assert axis.names == FAMILY.open().axis(profile).names
    assert {"state", "position", "move", "stop", "limits", "stream"} <= axis.names
    assert {"cap_torque", "cap_current"}.isdisjoint(axis.names), "they have nothing to bound it with"
    assert ("current" in axis) is ("temperature" in axis) is (profile != "kst")
    assert "enable_torque" not in axis
    assert not FAMILY.open().axis("").names


def test_a_simulator_is_of_the_make_the_family_is_configured_for() -> None:
    simulator = FAMILY.simulator((4, 7), profile="kingmax")
    assert list(simulator.nodes) == [4, 7]
    assert simulator.nodes[4].status()["profile"] == "kingmax"
    assert FAMILY.simulator((4,), "xqpower").nodes[4].status()["profile"] == "xqpower"
    with pytest.raises(motorbus.RequestError, match="sts3215"):
        FAMILY.simulator((1,), "sts3215")


def test_from_a_bus_address() -> None:
    with motorbus.open("kst:sim,ids=0x25,profile=xqpower") as bus:
        servo = kst.Servo(bus, 0x25)
        assert servo.identify().table == "xqpower"
        servo.move(0.1)
        assert servo.position() == pytest.approx(0.1, abs=0.02)


def test_importing_the_family_does_not_import_its_simulator() -> None:
    program = (
        "import sys, motorbus.families.kst; "
        "print([m for m in sys.modules if 'kst.simulator' in m or 'kst.decode' in m or 'kst.eds' in m])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
