"""A port as text becomes a link, or one clear error."""

from __future__ import annotations

import pytest

from motorbus.errors import PortNotFound, RequestError
from motorbus.link.can import CanLink
from motorbus.link.url import open_link
from motorbus.link.usb_adapters import TERMINAL_LATENCY
from motorbus.simulation.pty import PtyMaster


def test_the_latency_option_wins(master: PtyMaster) -> None:
    for options, latency in (({"latency": 0.0}, 0.0), ({"latency": 0.0005}, 0.0005), ({}, TERMINAL_LATENCY)):
        link = open_link(master.slave_name, rate=500_000, options=options)
        assert link.latency == latency
        link.close()


@pytest.mark.parametrize("port", ["/dev/no-such-port", "COM77", "no such port"])
def test_a_device_that_does_not_exist(port: str) -> None:
    with pytest.raises(PortNotFound, match="there is no such port"):
        open_link(port, rate=1_000_000)


@pytest.mark.parametrize("port", ["tcp://host:4000", "http://host", "://", "x://y"])
def test_an_unknown_scheme_comes_with_those_that_exist(port: str) -> None:
    with pytest.raises(RequestError, match=r"unknown scheme[^\n]*\n.*socket://HOST:PORT"):
        open_link(port, rate=1_000_000)


def test_a_can_channel_is_opened_with_its_options() -> None:
    link = open_link(
        "CAN://virtual/a",
        default_rate=500_000,
        kind="frames",
        options={"receive_own_messages": "yes", "listen_only": "no"},
    )
    assert isinstance(link, CanLink)
    assert (link.name, link.rate) == ("CAN://virtual/a", 500_000)
    link.close()


@pytest.mark.parametrize(
    ("port", "kind", "words"),
    [
        ("can://socketcan/can0", "bytes", "speak on a serial line"),
        ("/dev/ttyACM0", "frames", r"speak CAN\n.*can://slcan/dev/ttyACM0"),
        ("socket://127.0.0.1:4000", "frames", "speak CAN"),
    ],
)
def test_a_port_of_the_other_kind(port: str, kind: str, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        open_link(port, rate=500_000, kind=kind)


@pytest.mark.parametrize("port", ["", "   ", "/dev/tty\0ACM0"])
def test_invalid_ports(port: str) -> None:
    with pytest.raises(RequestError, match="is not a port"):
        open_link(port, rate=1_000_000)
