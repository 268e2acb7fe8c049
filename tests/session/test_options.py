"""Options of an address: which a bus takes, what each may be, and the default interlock of a bus."""

from __future__ import annotations

import time
from typing import Any

import pytest

import motorbus
from motorbus.errors import Interrupted, LimitExceeded, RequestError
from motorbus.families.kst import KstDriver
from motorbus.session import lock_name, open, prepare, simulate
from motorbus.session.opening import simulated_link


@pytest.mark.parametrize(
    ("address", "options", "rate", "rest", "reconnect"),
    [
        ("feetech:/dev/ttyACM0", {}, 0, {}, True),
        ("feetech:/dev/ttyACM0,baud=500k", {}, 500_000, {}, True),
        ("feetech:/dev/ttyACM0,baud=500k", {"baud": 115200}, 115_200, {}, True),
        ("feetech:/dev/ttyAMA0", {"latency": "500us"}, 0, {"latency": 0.0005}, True),
        ("stepper:socket://10.0.0.7:4000,latency=0", {}, 0, {"latency": 0.0}, True),
        ("kst:can://slcan/dev/ttyACM0,ttyBaudrate=115200", {}, 0, {"ttyBaudrate": "115200"}, True),
        ("kst:can://socketcan/can0,bitrate=1M", {"reconnect": False}, 1_000_000, {}, False),
        ("feetech:sim,ids=1-3,model=sts3215", {}, 0, {"ids": "1-3", "model": "sts3215"}, True),
        (
            "feetech:sim,faults=1%: drop,clock=virtual",
            {},
            0,
            {"faults": "1%: drop", "clock": "virtual"},
            True,
        ),
        ("feetech:sim,reconnect=no", {}, 0, {}, False),
    ],
)
def test_options_go_to_the_link_or_the_simulator(
    address: str, options: dict[str, Any], rate: int, rest: dict[str, Any], reconnect: bool
) -> None:
    found = prepare(address, options)
    assert (found.rate, found.options, found.reconnect) == (rate, rest, reconnect)


def test_settings_of_a_family_go_to_its_driver() -> None:
    found = prepare("kst:can://slcan/dev/ttyACM0,profile=xqpower", {})
    assert isinstance(found.driver, KstDriver)
    assert (found.driver.settings.profile.name, found.options) == ("xqpower", {})


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nothing:/dev/ttyACM0", "no family 'nothing'"),
        ("feetech:/dev/ttyACM0,speed=3", "unknown option 'speed'"),
        ("feetech:/dev/ttyACM0,latncy=3", "did you mean latency"),
        ("feetech:/dev/ttyACM0,baud=fast", "not a rate in bit/s"),
        ("feetech:/dev/ttyACM0,latency=-1", "no adapter holds bytes back"),
        ("feetech:/dev/ttyACM0,latency=2s", "no adapter holds bytes back"),
        ("feetech:/dev/ttyACM0,latency=fast", "is not a number"),
        ("feetech:/dev/ttyACM0,reconnect=maybe", "neither yes nor no"),
        ("feetech:/dev/ttyACM0,clock=virtual", "unknown option 'clock'"),
        ("feetech:/dev/ttyACM0,faults=1%: drop", "cannot be put in front of a port"),
        ("kst:can://virtual/x,faults=1%: drop", "cannot be put in front of a port"),
        ("feetech:sim:arm,faults=1%: drop", "cannot be put in front of this bus"),
        ("feetech:sim:arm,latency=0", "unknown option 'latency'"),
        ("feetech:sim,latency=0", "unknown option 'latency'"),
        ("kst:sim,bitrate=-1", "not a rate in bit/s"),
        ("feetech:sim,colour=red", "unknown option 'colour'"),
    ],
)
def test_what_cannot_be_is_refused(address: str, message: str) -> None:
    with pytest.raises(RequestError) as caught:
        prepare(address, {})
    assert message in str(caught.value)


@pytest.mark.parametrize("option", ["clock=wall", "faults=1%: dorp", "ids=0-999", "model=mx28"])
def test_a_simulator_refuses_its_options_when_it_is_made(option: str) -> None:
    with pytest.raises(RequestError):
        simulated_link(prepare(f"feetech:sim,{option}", {}))


@pytest.mark.parametrize(
    ("bus", "name"),
    [
        ("feetech:/dev/ttyACM0,baud=500000", "/dev/ttyACM0"),
        ("feetech:socket://10.0.0.7:4000", "socket://10.0.0.7:4000"),
        ("kst:can://slcan/dev/ttyACM0@1000000", "/dev/ttyACM0"),
        ("kst:can://socketcan/can0", "can://socketcan/can0"),
        ("kst:can://virtual/anything", ""),
    ],
)
def test_a_port_is_locked_under_one_name(bus: str, name: str) -> None:
    assert lock_name(bus, {}) == name


def test_simulated_devices_are_made_for_each_opening() -> None:
    found = prepare("feetech:sim,ids=2-3,model=scs15,baud=500000", {})
    one, other = simulated_link(found), simulated_link(found)
    assert (one.rate, list(one.simulator.nodes), one.virtual) == (500_000, [2, 3], False)
    assert one.simulator is not other.simulator


@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_a_bus_without_a_robot_holds_the_limits_of_its_devices(family: str) -> None:
    with simulate(family, ids="1") as sim, open(sim.url) as bus:
        servo = getattr(motorbus, family).Servo(bus, 1)
        start = servo.position()
        for bad in (float("nan"), float("inf"), 100.0, -100.0):
            with pytest.raises((LimitExceeded, RequestError)):
                servo.move(bad)
        assert servo.position() == start
        servo.move(start + 0.2)
        assert servo.position() == pytest.approx(start + 0.2, abs=0.02)
        assert bus.estop().acknowledged == (1,)
        with pytest.raises(Interrupted):
            servo.move(start)
        bus.reset()
        servo.move(start)


def test_a_one_shot_command_needs_no_real_time() -> None:
    with open("feetech:sim,clock=virtual") as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        start = time.monotonic()
        servo.move(1.0, velocity=0.1)  # 21 s of the servo
        assert bus.link.now() > 20
        assert time.monotonic() - start < 10
