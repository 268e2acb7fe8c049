"""A machine file as a person meets it: read, refused in one message, looked things up in, written afresh."""

from __future__ import annotations

import os
import re
from math import pi
from pathlib import Path

import pytest
from hypothesis import given

from motorbus.errors import RequestError
from motorbus.motion.machine import AxisSpec, BusSpec, Machine, source
from tests.motion.machine.files import GOOD, NO_TEXT, NoText, axis, machines

MACHINE = Machine.parse(GOOD)


def test_a_file_is_read_into_the_units_of_the_api() -> None:
    assert MACHINE.name == "bench"
    assert MACHINE.buses["gimbal"] == BusSpec(address="kst:can://slcan/dev/ttyACM1,bitrate=500000")
    shoulder = MACHINE.axes["shoulder"]
    assert (shoulder.bus, shoulder.node) == ("arm", 1)
    found = (shoulder.zero, shoulder.low, shoulder.high, shoulder.max_velocity, shoulder.max_step)
    assert found == pytest.approx((pi, -pi / 2, pi / 2, pi * 2 / 3, pi / 18))
    assert (shoulder.torque, shoulder.current, shoulder.exit) == (0.5, None, "hold")
    assert MACHINE.axes["elbow"].park == 0.0
    assert MACHINE.groups["left"].axes == ("shoulder", "elbow")
    assert MACHINE.poses["ready"]["slide"] == pytest.approx(0.03)


def test_the_order_of_the_file_is_kept() -> None:
    assert list(MACHINE.axes) == ["shoulder", "elbow", "slide"]
    assert list(MACHINE.poses["ready"]) == ["shoulder", "elbow", "slide"]


def test_a_machine_does_not_change() -> None:
    with pytest.raises(AttributeError):
        MACHINE.name = "other"  # type: ignore[misc]


def test_names_stand_for_axes() -> None:
    assert MACHINE.axes_of("elbow") == ("elbow",)
    assert MACHINE.axes_of("left") == ("shoulder", "elbow")
    assert MACHINE.axes_of("gimbal") == ("slide",)
    with pytest.raises(RequestError, match="no axis, group or bus 'elbw'") as caught:
        MACHINE.axes_of("elbw")
    assert caught.value.advice == "did you mean elbow?"


def test_a_pose_is_a_copy_of_positions() -> None:
    pose = MACHINE.pose("ready")
    pose["shoulder"] = 9.0
    assert MACHINE.pose("ready")["shoulder"] == pytest.approx(pi / 18)
    with pytest.raises(RequestError, match="no pose 'redy'") as caught:
        MACHINE.pose("redy")
    assert caught.value.advice == "did you mean ready?"


def test_it_is_loaded_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    file.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert Machine.load(file) == MACHINE
    assert (Machine.load(file).file, MACHINE.file) == (str(file), "")
    assert source(str(file)).count("\r\n") == GOOD.count("\n")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "it cannot be read: no such file or directory"),
        (b"x" * (1 << 21), "the file has more than 1048576 characters"),
        (b"format = 3", "format: 3 is not known"),
    ],
)
def test_what_cannot_be_loaded_names_the_file(content: bytes | None, says: str, tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(RequestError) as caught:
        Machine.load(file)
    assert caught.value.summary.startswith(f"{file}: {says}")
    assert str(caught.value).startswith(f"{file}: {says}")
    assert "nothing was opened" in caught.value.advice


@pytest.mark.parametrize("one", [pytest.param(one, id=name) for name, one in NO_TEXT.items()])
def test_what_is_no_text_is_to_be_saved_as_text(one: NoText, tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    file.write_bytes(one.content)
    with pytest.raises(RequestError) as caught:
        Machine.load(file)
    assert caught.value.summary == f"{file}: it is no text: {one.says}"
    assert caught.value.expected == "TOML in UTF-8"
    assert re.fullmatch(r"save it as UTF-8, .*; nothing was opened", caught.value.advice)


def test_a_pipe_that_nobody_writes_to_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RequestError, match="it cannot be read: it is a named pipe, and no file") as caught:
        Machine.load(tmp_path / "pipe")
    assert caught.value.advice == "see that the path is right; nothing was opened"
    with pytest.raises(RequestError, match="it is a device, and no file"):
        Machine.load("/dev/null")


def test_what_is_piped_in_is_read() -> None:
    end, other = os.pipe()
    with open(other, "wb") as pipe:
        pipe.write(GOOD.encode())
    try:
        assert Machine.load(f"/dev/fd/{end}").axes == MACHINE.axes
    finally:
        os.close(end)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="it cannot be read: "):
        Machine.load(tmp_path)


def test_whoever_opens_buses_may_judge_their_addresses() -> None:
    asked: list[str] = []

    def check(address: str) -> None:
        asked.append(address)
        if address.startswith("kst"):
            raise RequestError("there is no family 'kst'", expected="one of feetech", advice="install it")

    with pytest.raises(RequestError) as caught:
        Machine.parse(GOOD, check_address=check)
    assert asked == [bus.address for bus in MACHINE.buses.values()]
    assert caught.value.summary == "bus.gimbal.address: there is no family 'kst'"
    assert (caught.value.expected, caught.value.advice) == (
        "one of feetech",
        "install it; nothing was opened",
    )


def test_what_a_file_need_not_say_has_its_usual_value() -> None:
    text = 'format = 1\n[bus.a]\naddress = "x:y"\n[axis.b]\ndevice = "a#1"\n[axis.c]\ndevice = "a#2"\ntravel = "1 m"'
    turning, linear = Machine.parse(text).axes.values()
    assert turning == AxisSpec(device="a#1", unit="deg", max_velocity=pi / 2, max_acceleration=2 * pi)
    assert (linear.unit, linear.max_velocity, linear.max_acceleration) == ("mm", 0.05, 0.2)
    assert (linear.low, linear.high, linear.device_limits, linear.exit) == (None, None, None, "hold")


def test_a_machine_of_nothing_is_one() -> None:
    assert Machine.parse("format = 1") == Machine()


@given(machines())
def test_a_fresh_file_is_read_as_the_same_machine(machine: Machine) -> None:
    assert Machine.parse(machine.text()) == machine


def test_what_is_no_machine_is_not_written() -> None:
    with pytest.raises(RequestError, match="there is no bus arm"):
        Machine(axes={"a": axis()}).text()
