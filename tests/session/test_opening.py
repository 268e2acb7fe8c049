"""What an address means before a port is touched, and the one name under which a port is locked."""

from __future__ import annotations

import pytest

from motorbus import RequestError
from motorbus.families.kst import KstDriver
from motorbus.session.opening import lock_name, prepare, simulated


def test_options_of_the_address_and_of_the_call_are_one() -> None:
    found = prepare("feetech:/dev/ttyACM0,baud=500000", {})
    assert (found.family.name, found.port, found.rate, found.options) == (
        "feetech",
        "/dev/ttyACM0",
        500_000,
        {},
    )
    assert prepare("feetech:/dev/ttyACM0,baud=500000", {"baud": "1M"}).rate == 1_000_000
    assert prepare("feetech:/dev/ttyACM0", {}).rate == 0, "nobody said"


def test_what_a_family_takes_goes_to_the_family_and_the_rest_to_the_link() -> None:
    found = prepare("kst:can://slcan/dev/ttyACM0,profile=xqpower,ttyBaudrate=115200", {})
    assert isinstance(found.driver, KstDriver)
    assert found.driver.settings.profile.name == "xqpower"
    assert found.options == {"ttyBaudrate": "115200"}
    simulated = prepare("feetech:sim,ids=1-3,model=sts3215", {})
    assert simulated.options == {"ids": "1-3", "model": "sts3215"}


@pytest.mark.parametrize(("said", "seconds"), [("0", 0.0), ("500us", 0.0005), ("1ms", 0.001), (0.002, 0.002)])
def test_the_latency_of_a_serial_port_goes_to_its_link_in_seconds(said: object, seconds: float) -> None:
    assert prepare("feetech:/dev/ttyAMA0", {"latency": said}).options == {"latency": seconds}
    assert prepare("stepper:socket://10.0.0.7:4000", {"latency": said}).options == {"latency": seconds}


@pytest.mark.parametrize("bus", ["feetech:sim", "feetech:sim:arm", "stepper:sim"])
def test_a_simulator_in_this_process_has_no_latency(bus: str) -> None:
    with pytest.raises(RequestError, match="unknown option 'latency'"):
        prepare(f"{bus},latency=0", {})


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("feetech:/dev/ttyACM0,speed=3", "unknown option 'speed'"),
        ("feetech:/dev/ttyACM0,baud=fast", "not a rate in bit/s"),
        ("feetech:/dev/ttyACM0,latency=-1", "no adapter holds bytes back for that long"),
        ("feetech:/dev/ttyACM0,latency=2s", "no adapter holds bytes back for that long"),
        ("feetech:/dev/ttyACM0,latency=fast", "is not a number"),
        ("feetech:/dev/ttyACM0,sleep=yes", "unknown option 'sleep'"),
        ("kst:sim,bitrate=-1", "not a rate in bit/s"),
        ("nobody:/dev/ttyACM0", "no family 'nobody'"),
    ],
)
def test_what_cannot_be_is_refused_without_touching_the_port(address: str, why: str) -> None:
    with pytest.raises(RequestError, match=why):
        prepare(address, {})


@pytest.mark.parametrize(
    ("bus", "name"),
    [
        ("feetech:/dev/ttyACM0,baud=500000", "/dev/ttyACM0"),
        ("feetech:socket://10.0.0.7:4000", "socket://10.0.0.7:4000"),
        ("kst:can://slcan/dev/ttyACM0", "/dev/ttyACM0"),
        ("kst:can://slcan/dev/ttyACM0@1000000", "/dev/ttyACM0"),
        ("kst:can://serial/dev/ttyACM0", "/dev/ttyACM0"),
        ("kst:can://socketcan/can0", "can://socketcan/can0"),
        ("kst:can://socketcand/localhost/can0", "can://socketcand/localhost:29536/can0"),
        ("kst:can://virtual/anything", ""),
    ],
)
def test_a_port_is_locked_under_one_name(bus: str, name: str) -> None:
    assert lock_name(bus, {}) == name


@pytest.mark.parametrize(
    "address",
    [
        "feetech:/dev/nothing",
        "feetech:socket://127.0.0.1:1",
        "kst:can://virtual/x",
        "stepper:COM7",
        "feetech:sim:arm",
    ],
)
def test_faults_are_for_simulated_devices_only(address: str) -> None:
    with pytest.raises(RequestError, match=r"(?s)faults cannot be put in front of.*nothing was opened"):
        prepare(address, {"faults": "exchange 1: drop"})
    with pytest.raises(RequestError, match="faults cannot be put in front of"):
        prepare(f"{address},faults=x", {})
    assert (
        prepare("feetech:sim,ids=1", {"faults": "exchange 1: drop"}).options["faults"] == "exchange 1: drop"
    )


@pytest.mark.parametrize(
    ("address", "options", "looked_for"),
    [
        ("feetech:/dev/ttyACM0", {}, True),
        ("feetech:/dev/ttyACM0,reconnect=no", {}, False),
        ("kst:can://slcan/dev/ttyACM0,reconnect=yes", {}, True),
        ("kst:can://socketcan/can0", {"reconnect": False}, False),
        ("feetech:sim,reconnect=no", {}, False),
    ],
)
def test_a_port_that_is_lost_is_looked_for_unless_told_otherwise(
    address: str, options: dict[str, object], looked_for: bool
) -> None:
    opening = prepare(address, options)
    assert (opening.reconnect, opening.options) == (looked_for, {})


def test_simulated_devices_are_made_as_often_as_they_are_wanted() -> None:
    found = prepare("feetech:sim,ids=2-3,model=scs15,faults=exchange 1: drop,baud=500000", {})
    one, other = simulated(found), simulated(found)
    assert (one.rate, list(one.simulator.nodes)) == (500_000, [2, 3])
    assert str(one.line) == "exchange 1: drop"
    assert one.simulator is not other.simulator
    assert found.options == {"ids": "2-3", "model": "scs15", "faults": "exchange 1: drop"}
