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


@pytest.mark.parametrize(
    ("port", "kind", "error", "words"),
    [
        ("/dev/no-such-port", "bytes", PortNotFound, "there is no such port"),
        ("COM77", "bytes", PortNotFound, "there is no such port"),
        ("tcp://host:4000", "bytes", RequestError, r"unknown scheme[^\n]*\n.*socket://HOST:PORT"),
        ("://", "bytes", RequestError, r"unknown scheme[^\n]*\n.*socket://HOST:PORT"),
        ("", "bytes", RequestError, "is not a port"),
        ("   ", "bytes", RequestError, "is not a port"),
        ("/dev/tty\0ACM0", "bytes", RequestError, "is not a port"),
        ("can://socketcan/can0", "bytes", RequestError, "speak on a serial line"),
        ("/dev/ttyACM0", "frames", RequestError, r"speak CAN\n.*can://slcan/dev/ttyACM0"),
        ("socket://127.0.0.1:4000", "frames", RequestError, "speak CAN"),
    ],
)
def test_what_is_no_port(port: str, kind: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        open_link(port, rate=500_000, kind=kind)


def test_a_can_channel_is_opened_with_its_options() -> None:
    options = {"receive_own_messages": "yes", "listen_only": "no"}
    link = open_link("CAN://virtual/a", default_rate=500_000, kind="frames", options=options)
    assert isinstance(link, CanLink)
    assert (link.name, link.rate) == ("CAN://virtual/a", 500_000)
    link.close()
