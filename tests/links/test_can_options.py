"""Options of a CAN channel: the address wins over the environment, the environment over files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import can
import pytest

from motorbus.errors import LinkError, RequestError
from motorbus.link.can_options import CanOptions, check_rate, parse_port, read_options

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
        ("can://SLCAN/COM7", "slcan", {"channel": "COM7"}),
        ("can://slcan/socket://127.0.0.1:4000", "slcan", {"channel": "socket://127.0.0.1:4000"}),
        ("can://socketcan/can0", "socketcan", {"channel": "can0"}),
        ("can://socketcand/box:4/can0", "socketcand", {"channel": "can0", "host": "box", "port": "4"}),
        ("can://socketcand/box/can0", "socketcand", {"channel": "can0", "host": "box", "port": 29536}),
        ("can://virtual", "virtual", {}),
        ("can://", "", {}),
    ],
)
def test_an_address_and_its_parts(port: str, interface: str, said: dict[str, object]) -> None:
    assert parse_port(port) == (interface, said)


def test_the_user_wins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "socketcan")
    monkeypatch.setenv("CAN_CHANNEL", "can7")
    monkeypatch.setenv("CAN_BITRATE", "250000")
    assert config("can://").rate == 250_000
    assert config("can://")[1:3] == ("socketcan", "can7")
    assert config("can://virtual/mine", 125_000)[1:4] == ("virtual", "mine", 125_000)


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


def test_an_slcan_adapter_behind_a_url_is_locked_without_its_baud_rate() -> None:
    found = config("can://slcan/socket://127.0.0.1:4000@115200")
    assert found.lock_name == "socket://127.0.0.1:4000"


@pytest.mark.parametrize("rate", [12_345, 1_500_000])
def test_a_rate_that_python_can_would_round_is_refused(rate: int) -> None:
    with pytest.raises(LinkError, match="usb2can has no bit rate"):
        check_rate(config("can://usb2can/ED000001"), rate)


def test_a_bit_timing_sets_the_rate() -> None:
    found = config("can://slcan/dev/ttyACM0", **BITS)
    assert found.rate == 800_000
    assert set(found.settings) == {"timing"}


@pytest.mark.parametrize(
    ("port", "free"),
    [
        ("can://virtual/bench", True),
        ("can://udp_multicast/239.74.163.2", True),
        ("can://socketcan/vcan0", True),
        ("can://socketcan/can0", False),
        ("can://slcan/dev/ttyACM0", False),
    ],
)
def test_what_is_made_of_programs_alone(port: str, free: bool) -> None:
    assert config(port).no_wire is free
