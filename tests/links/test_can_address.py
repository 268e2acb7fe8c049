"""Addresses and options of CAN channels."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from motorbus.errors import RequestError
from motorbus.link.can import read_address
from tests.links.can_peer import open_can


@pytest.mark.parametrize(
    ("port", "interface", "channel", "lock", "no_wire"),
    [
        ("can://slcan/dev/ttyACM0", "slcan", "/dev/ttyACM0", "/dev/ttyACM0", False),
        ("can://SLCAN/COM7@1000000", "slcan", "COM7@1000000", "COM7", False),
        (
            "can://slcan/socket://127.0.0.1:4@9600",
            "slcan",
            "socket://127.0.0.1:4@9600",
            "socket://127.0.0.1:4",
            False,
        ),
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
    assert (found.interface, found.channel, found.lock_name, found.no_wire) == (
        interface,
        channel,
        lock,
        no_wire,
    )


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
        ("can://slcan", {}, "does not name an interface and its channel"),
    ],
)
def test_wrong_options_are_refused(port: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        open_can(port, 500_000, **options)
