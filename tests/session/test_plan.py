"""What a machine needs is checked before any port is touched."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from motorbus import LinkError, PortNotFound, RequestError
from motorbus.families.feetech import FAMILY
from motorbus.motion.machine import Machine
from motorbus.session.plan import Plan, estop_options, loaded
from tests.motion.machine.files import GOOD, UNOPENABLE, Broken
from tests.support.machines import described, machine


def made_of(arm: str, can: str) -> Machine:
    return Machine.parse(described({"arm": arm, "can": can}, "1", "0x25", False, {}, {}))


def test_all_axes_or_those_that_are_wanted_and_the_buses_they_need() -> None:
    with machine(arm="1-3", can="0x25", lift=True) as (made, _):
        assert Plan.of(made)[1:] == (("a1", "a2", "a3", "c1", "lift"), ("arm", "can", "stage"))
        assert Plan.of(made, "c1")[1:] == (("c1",), ("can",))
        assert Plan.of(made, ["lift", "arm", "a1"])[1:] == (("lift", "a1", "a2", "a3"), ("stage", "arm"))
        assert Plan.of(made, "led").buses == ("arm", "can")


def test_a_machine_without_an_axis_is_refused_and_so_is_a_bus(tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    file.write_text('format = 1\n[bus.arm]\naddress = "feetech:sim"\n', encoding="utf-8")
    for names, says in ((None, "the machine has no axis"), ("arm", "arm: no axis is on it")):
        with pytest.raises(RequestError, match=f"^{file}: {says}\n") as caught:
            Plan.of(loaded(file), names)
        assert caught.value.advice.startswith("add a table [axis.NAME]")


def test_a_name_that_is_none_is_refused_with_those_there_are() -> None:
    with (
        machine(arm="1") as (made, _),
        pytest.raises(RequestError, match="there is no axis, group or bus 'elbow'"),
    ):
        Plan.of(made, "elbow")


def test_an_address_that_cannot_be_is_refused_naming_its_bus() -> None:
    with pytest.raises(RequestError, match="^bus.can: .*unknown option 'colour'"):
        Plan.of(made_of("feetech:sim,ids=1", "kst:sim,colour=red"))


def test_simulated_devices_that_cannot_be_are_refused_before_any_port_is_touched() -> None:
    found = made_of("feetech:/dev/ttyNOTHING", "kst:sim,ids=200")
    with pytest.raises(RequestError, match="^bus.can: node id 200 is not possible"):
        Plan.of(found)
    assert Plan.of(found, "a1").buses == ("arm",)


def test_two_buses_on_one_port_are_refused(tmp_path: Path) -> None:
    one, other = "feetech:/dev/ttyACM0", "feetech:/dev/ttyACM0,baud=500000"
    text = f'format = 1\n[bus.a]\naddress = "{one}"\n[bus.b]\naddress = "{other}"\n'
    axes = '[axis.x]\ndevice = "a#1"\n[axis.y]\ndevice = "b#2"\n'
    found = Machine.parse(text + axes)
    with pytest.raises(RequestError, match="bus.b.address: /dev/ttyACM0 is the port of bus.a too"):
        Plan.of(found)
    assert Plan.of(found, "x").buses == ("a",)
    file = tmp_path / "motorbus.toml"
    file.write_text(text + axes, encoding="utf-8")
    with pytest.raises(
        RequestError, match=r"motorbus.toml: bus.b.address: /dev/ttyACM0 is the port of bus.a"
    ):
        loaded(file)


def test_a_port_that_cannot_be_opened_is_told_with_its_bus() -> None:
    plan = Plan.of(made_of("feetech:/dev/ttyNOTHING", "kst:sim:nobody"))
    for opening in (plan.open, plan.open_async):
        with pytest.raises(PortNotFound, match=r"^bus\.arm: .*ttyNOTHING"):
            opening("arm", None)
        with pytest.raises(PortNotFound, match=r"^bus\.can: "):
            opening("can", None)


def test_a_good_file_is_loaded_with_ports_that_are_not_there(tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    file.write_text(GOOD, encoding="utf-8")
    assert list(loaded(file).axes) == ["shoulder", "elbow", "slide"]


@pytest.mark.parametrize("broken", [pytest.param(one, id=one.says[:60]) for one in UNOPENABLE])
def test_what_cannot_be_opened_is_refused_with_place_and_fix(broken: Broken, tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    file.write_text(broken.text, encoding="utf-8")
    with pytest.raises(RequestError) as caught:
        loaded(file)
    error = caught.value
    assert error.summary.startswith(f"{file}: {broken.says}")
    assert broken.fix in f"{error.summary} / {error.expected} / {error.advice}"
    assert error.advice.endswith("; nothing was opened")


def test_a_file_is_loaded_without_what_only_another_bus_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    file = tmp_path / "motorbus.toml"
    file.write_text(GOOD, encoding="utf-8")
    assert Plan.of(loaded(file), "left").buses == ("arm",)
    with pytest.raises(LinkError, match="bus.gimbal: .* needs python-can"):
        Plan.of(loaded(file))


def test_whom_an_emergency_stop_is_to_hold_is_told_to_the_family() -> None:
    with machine(arm="1-4", can="0x25", axes={"a2": {"estop": "hold"}, "a4": {"estop": "hold"}}) as (made, _):
        assert estop_options(made, "arm") == {"estop_hold": "2+4"}
        assert estop_options(made, "can") == {}
        with Plan.of(made, "a1").open("arm", None) as bus:  # also for those that are not wanted
            sent = [one.wire for one in bus.driver.stop({}).requests]
            assert sent == [one.wire for one in FAMILY.open(estop_hold="2+4").stop({}).requests]


def test_whom_the_address_names_is_held_too() -> None:
    text = described(
        {"arm": "feetech:sim,ids=1-3,estop_hold=3"}, "1", "", False, {"a1": {"estop": "hold"}}, {}
    )
    assert estop_options(Machine.parse(text), "arm") == {"estop_hold": "3+1"}


@pytest.mark.parametrize(
    ("axis", "estop", "says"),
    [
        ("c1", "torque_off", 'axis.c1.estop: an emergency stop of can#0x25 .kst. cannot be "torque_off"'),
        ("lift", "hold", 'axis.lift.estop: an emergency stop of stage#1 .stepper. cannot be "hold"'),
        ("lift", "torque_off", "axis.lift.estop"),
    ],
)
def test_an_emergency_stop_that_a_device_does_not_have_is_refused(axis: str, estop: str, says: str) -> None:
    with (
        machine(arm="1", can="0x25", lift=True, axes={axis: {"estop": estop}}) as (made, _),
        pytest.raises(RequestError, match=says),
    ):
        Plan.of(made)
