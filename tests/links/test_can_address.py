"""Addresses, options and bit rates of CAN channels. A rate that the kernel does not have is an error at open."""

from __future__ import annotations

import json
from pathlib import Path

import can
import pytest

from motorbus.errors import LinkError, RequestError
from motorbus.link.can import kernel_queue, kernel_rate, read_address
from tests.links.can_peer import open_can

CAN0 = read_address("can://socketcan/can0")


@pytest.mark.parametrize(
    ("port", "interface", "channel", "lock", "no_wire"),
    [
        ("can://slcan/dev/ttyACM0", "slcan", "/dev/ttyACM0", "/dev/ttyACM0", False),
        ("can://SLCAN/COM7@1000000", "slcan", "COM7@1000000", "COM7", False),
        ("can://slcan/socket://host:4@9600", "slcan", "socket://host:4@9600", "socket://host:4", False),
        ("can://socketcan/can0", "socketcan", "can0", "can://socketcan/can0", False),
        ("can://socketcan/vcan0", "socketcan", "vcan0", "can://socketcan/vcan0", True),
        ("can://socketcand/box:4/can0", "socketcand", "can0", "can://socketcand/box:4/can0", False),
        ("can://socketcand/box/can0", "socketcand", "can0", "can://socketcand/box:29536/can0", False),
        ("can://virtual", "virtual", "", "", True),
        ("can://udp_multicast/239.74.163.2", "udp_multicast", "239.74.163.2", "", True),
    ],
)
def test_parts_of_an_address(port: str, interface: str, channel: str, lock: str, no_wire: bool) -> None:
    found = read_address(port)
    assert (found.interface, found.channel, found.lock_name) == (interface, channel, lock)
    assert found.no_wire is no_wire


def test_options_and_configuration_go_to_python_can(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "can.conf"
    file.write_text("[default]\nrx_queue_size = 1\n[arm]\nrx_queue_size = 2\n")
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    for options, size in (({}, 1), ({"config_context": "arm"}, 2), ({"rx_queue_size": "3"}, 3)):
        link = open_can("can://virtual/queue", 500_000, **options)
        assert link._bus.queue.maxsize == size  # type: ignore[union-attr]
        link.close()


@pytest.mark.parametrize(
    ("port", "options", "words"),
    [
        ("can://virtual/a", {"listen_only": "perhaps"}, "neither yes nor no"),
        ("can://slcan/dev/ttyACM0", {"tty_baud": "9600"}, "slcan has no option 'tty_baud'"),
    ],
)
def test_wrong_options_are_refused(port: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        open_can(port, 500_000, **options)


def ip(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str, code: int = 0) -> None:
    """A program `ip` that says this."""
    (folder / "output").write_text(text)
    program = folder / "ip"
    program.write_text(f"#!/bin/sh\ncat {folder}/output\nexit {code}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=":")


def kernel(rate: int = 500_000, *, up: bool = True, modes: tuple[str, ...] = ()) -> str:
    data = {"ctrlmode": modes, "state": "ERROR-ACTIVE", "bittiming": {"bitrate": rate}}
    flags = ["NOARP", "UP", "LOWER_UP"] if up else ["NOARP"]
    return json.dumps([{"flags": flags, "linkinfo": {"info_kind": "can", "info_data": data}}])


def test_the_kernels_rate_and_queue_are_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ip(tmp_path, monkeypatch, kernel(250_000))
    assert [kernel_rate(CAN0, rate, False) for rate in (0, 250_000)] == [250_000, 250_000]
    ip(tmp_path, monkeypatch, kernel(modes=("LISTEN-ONLY",)))
    assert kernel_rate(CAN0, 0, True) == 500_000
    ip(tmp_path, monkeypatch, "", code=1)
    assert kernel_rate(CAN0, 250_000, False) is None
    assert kernel_queue("can0", tmp_path) == 0
    (tmp_path / "class/net/can0").mkdir(parents=True)
    (tmp_path / "class/net/can0/tx_queue_len").write_text("10\n")
    assert kernel_queue("can0", tmp_path) == 10


@pytest.mark.parametrize(
    ("says", "rate", "listen_only", "words", "advice"),
    [
        (kernel(250_000), 500_000, False, "at 250000 bit/s, not at 500000", "type can bitrate 500000"),
        (kernel(250_000, up=False), 0, False, "can0 is switched off", "sudo ip link set can0 up"),
        (kernel(), 0, True, "takes full part", "listen-only on"),
        (kernel(modes=("LISTEN-ONLY",)), 0, False, "only listens on can0", "listen-only off"),
    ],
)
def test_an_interface_that_is_set_otherwise(
    says: str,
    rate: int,
    listen_only: bool,
    words: str,
    advice: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    ip(tmp_path, monkeypatch, says)
    with pytest.raises(LinkError, match=words) as caught:
        open_can("can://socketcan/can0", rate, listen_only=listen_only)
    assert advice in caught.value.advice
