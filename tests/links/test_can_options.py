"""Address, options, environment and configuration files: who wins, what is dropped, and what is an error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import can
import pytest

from motorbus.errors import RequestError
from motorbus.link.can_options import CanOptions, parameters, parse_port, read_options

BITS: dict[str, Any] = {
    "f_clock": "8000000",
    "brp": "1",
    "tseg1": "7",
    "tseg2": "2",
    "sjw": "1",
    "nof_samples": "1",
}


def config(port: str, rate: int = 0, **options: object) -> CanOptions:
    return read_options(can, port, rate, options)


@pytest.mark.parametrize(
    ("port", "interface", "said"),
    [
        ("can://slcan/dev/ttyACM0", "slcan", {"channel": "/dev/ttyACM0"}),
        ("can://slcan//dev/ttyACM0@1000000", "slcan", {"channel": "/dev/ttyACM0@1000000"}),
        ("can://serial/dev/ttyACM0", "serial", {"channel": "/dev/ttyACM0"}),
        ("can://robotell/dev/ttyACM0", "robotell", {"channel": "/dev/ttyACM0"}),
        ("can://seeedstudio/dev/ttyACM0", "seeedstudio", {"channel": "/dev/ttyACM0"}),
        ("can://SLCAN/COM7", "slcan", {"channel": "COM7"}),
        ("can://slcan/socket://127.0.0.1:4000", "slcan", {"channel": "socket://127.0.0.1:4000"}),
        ("can://socketcan/can0", "socketcan", {"channel": "can0"}),
        ("can://socketcand/box:4/can0", "socketcand", {"channel": "can0", "host": "box", "port": 4}),
        ("can://socketcand/box/can0", "socketcand", {"channel": "can0", "host": "box", "port": 29536}),
        ("can://pcan/PCAN_USBBUS1", "pcan", {"channel": "PCAN_USBBUS1"}),
        ("can://virtual/a/b", "virtual", {"channel": "a/b"}),
        ("can://virtual", "virtual", {}),
        ("can://", "", {}),
        ("can:///", "", {}),
    ],
)
def test_an_address_and_its_parts(port: str, interface: str, said: dict[str, object]) -> None:
    assert parse_port(port) == (interface, said)


@pytest.mark.parametrize("port", ["can:///can0", "can://socketcand/box", "can://socketcand/:4/can0"])
def test_an_address_with_a_gap(port: str) -> None:
    with pytest.raises(RequestError, match="can://"):
        parse_port(port)


def test_the_user_wins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "socketcan")
    monkeypatch.setenv("CAN_CHANNEL", "can7")
    monkeypatch.setenv("CAN_BITRATE", "250000")
    assert config("can://").rate == 250_000
    assert config("can://")[1:3] == ("socketcan", "can7")
    assert config("can://virtual/mine", 125_000)[1:4] == ("virtual", "mine", 125_000)


@pytest.mark.parametrize(
    "text",
    [
        "bitrate = 5\n",
        "[default]\nbitrate = 1\nbitrate = 2\n",
        "[default]\nbitrate = %(x)s\n",
        "[default]\nfoo\n",
    ],
)
def test_a_file_that_is_no_configuration(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str) -> None:
    file = tmp_path / "can.conf"
    file.write_text(text)
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    with pytest.raises(RequestError, match="cannot use this configuration"):
        config("can://virtual/a")


def test_a_part_of_a_bit_timing_in_a_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_CONFIG", '{"f_clock": 8000000, "brp": 1}')
    found = config("can://slcan/dev/x", 500_000)
    assert (found.rate, found.timing_rate) == (500_000, 0)
    assert found.warnings == (
        "python-can's configuration says f_clock=8000000, brp=1, which is no whole bit timing: ignored",
    )


@pytest.mark.parametrize("text", ["{not", "[1, 2]", "5", '"fd"', "null"])
def test_a_variable_that_is_no_configuration(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("CAN_CONFIG", text)
    with pytest.raises(RequestError, match="cannot use this configuration"):
        config("can://virtual/a")


def test_the_environment_wins_over_files(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "can.conf"
    file.write_text(
        "[default]\ninterface = virtual\nchannel = a\nbitrate = 20000\n[arm]\nchannel = b\nlisten_only = yes\n"
    )
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    assert config("can://")[1:4] == ("virtual", "a", 20_000)
    arm = config("can://", config_context="arm")
    assert (arm.channel, arm.rate, arm.listen_only) == ("b", 20_000, True)
    monkeypatch.setenv("CAN_CONFIG", '{"channel": "c", "bitrate": 50000, "rx_queue_size": 9}')
    both = config("can:///")
    assert (both.channel, both.rate, both.settings) == ("c", 50_000, {"rx_queue_size": 9})


def test_an_unsuitable_configuration_is_dropped_with_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_CONFIG", '{"interface": "virtual", "channel": "c", "tty_baudrate": 9600}')
    found = config("can://")
    assert found.settings == {}
    assert found.warnings == (
        "python-can's configuration says tty_baudrate=9600, which virtual does not have: ignored",
    )


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("CAN_CONFIG", "{not json"),
        ("CAN_BITRATE", "500k"),
        ("CAN_BITRATE", "-5"),
        ("CAN_CONFIG", '{"listen_only": "perhaps"}'),
    ],
)
def test_a_bad_configuration(monkeypatch: pytest.MonkeyPatch, variable: str, value: str) -> None:
    monkeypatch.setenv(variable, value)
    with pytest.raises(RequestError):
        config("can://virtual/a")


def test_an_unknown_option_comes_with_those_that_exist() -> None:
    with pytest.raises(RequestError, match=r"has no option 'tty_baud'[^~]*did you mean tty_baudrate"):
        config("can://slcan/dev/ttyACM0", tty_baud="9600")
    with pytest.raises(RequestError, match="expected: one of .*receive_own_messages"):
        config("can://virtual/a", sleep_after_open="1")


@pytest.mark.parametrize("name", ["timeout", "channel", "kwargs", "poll_interval", "can_filters"])
def test_settings_of_the_link_are_no_options(name: str) -> None:
    with pytest.raises(RequestError, match="has no option"):
        config("can://slcan/dev/ttyACM0", **dict[str, Any]({name: "1"}))


def test_an_unknown_interface_comes_with_those_that_exist() -> None:
    with pytest.raises(RequestError, match=r"expected: one of .*pcan.*slcan.*virtual") as caught:
        config("can://peak/1")
    assert "no interface 'peak'" in caught.value.summary


@pytest.mark.parametrize(("word", "value"), [("yes", True), ("No", False), ("true", True), ("0", False)])
def test_yes_and_no(word: str, value: bool) -> None:
    assert config("can://virtual/a", listen_only=word).listen_only is value
    assert config("can://virtual/a", receive_own_messages=word).settings == {"receive_own_messages": value}


def test_neither_yes_nor_no() -> None:
    with pytest.raises(RequestError, match="neither yes nor no"):
        config("can://virtual/a", listen_only="maybe")


def test_a_bit_timing_sets_the_rate() -> None:
    found = config("can://slcan/dev/ttyACM0", **BITS)
    assert found.timing_rate == 800_000
    assert set(found.settings) == {"timing"}


@pytest.mark.parametrize("lacking", sorted(BITS))
def test_a_bit_timing_must_be_complete(lacking: str) -> None:
    with pytest.raises(RequestError, match="not complete"):
        config("can://slcan/dev/ttyACM0", **{name: BITS[name] for name in BITS if name != lacking})


def test_a_back_end_that_only_documents_its_parameters() -> None:
    assert {"bitrate", "driver_mode", "tseg1"} <= parameters(can.interface._get_class_for_interface("kvaser"))
    assert config("can://kvaser/0", driver_mode="no").settings == {"driver_mode": False}


def test_options_of_a_back_end_that_cannot_be_looked_at_are_passed_on() -> None:
    assert config("can://gs_usb/0", index="1").settings == {"index": 1}


def test_numbers_are_numbers() -> None:
    assert config("can://kvaser/0").channel == 0
    assert os.sep not in str(config("can://virtual/7").channel)


@pytest.mark.parametrize(
    ("port", "free"),
    [
        ("can://virtual/bench", True),
        ("can://udp_multicast/239.74.163.2", True),
        ("can://socketcan/vcan0", True),
        ("can://SocketCAN/vxcan1", True),
        ("can://socketcan/can0", False),
        ("can://socketcan/slcan0", False),
        ("can://socketcan/can0vcan", False),
        ("can://slcan/dev/ttyACM0", False),
        ("can://slcan/vcan0", False),
        ("can://socketcand/localhost/vcan0", False),
        ("can://pcan/PCAN_USBBUS1", False),
    ],
)
def test_what_is_made_of_programs_alone(port: str, free: bool) -> None:
    assert config(port).no_wire is free


def test_a_wire_that_only_the_environment_names_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "socketcan")
    monkeypatch.setenv("CAN_CHANNEL", "can0")
    assert not config("can://").no_wire
