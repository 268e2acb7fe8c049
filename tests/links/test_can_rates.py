"""Bit rates that python-can or the kernel would change without a word are errors at open."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from motorbus.errors import LinkError
from motorbus.link.can import kernel_rate, read_address
from tests.links.can_peer import on_terminal, open_can

CAN0 = read_address("can://socketcan/can0")


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


@pytest.mark.usefixtures("long_timeouts")
def test_s7_means_two_rates_so_it_is_not_used() -> None:
    with on_terminal() as peer:
        with pytest.raises(LinkError, match="no bit rate of 750000"):
            open_can(peer, 750_000)
        assert (peer.received, peer.adapter.open) == ([], False)
        link = open_can(peer, 800_000)
        assert (link.rate, peer.adapter.bitrate) == (800_000, 800_000)
        link.close()


def test_the_kernels_rate_is_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ip(tmp_path, monkeypatch, kernel(250_000))
    assert kernel_rate(CAN0, 0, False) == 250_000
    assert kernel_rate(CAN0, 250_000, False) == 250_000
    ip(tmp_path, monkeypatch, "", code=1)
    assert kernel_rate(CAN0, 250_000, False) is None


def test_another_rate_than_the_kernels(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ip(tmp_path, monkeypatch, kernel(250_000))
    with pytest.raises(LinkError, match="at 250000 bit/s, not at 500000") as caught:
        open_can("can://socketcan/can0", 500_000)
    assert "sudo ip link set can0 up type can bitrate 500000" in caught.value.advice


def test_an_interface_that_is_off(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ip(tmp_path, monkeypatch, kernel(250_000, up=False))
    with pytest.raises(LinkError, match="can0 is switched off"):
        open_can("can://socketcan/can0")


def test_listening_is_the_kernels_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ip(tmp_path, monkeypatch, kernel())
    with pytest.raises(LinkError, match="takes full part.*") as caught:
        open_can("can://socketcan/can0", listen_only="yes")
    assert "listen-only on" in caught.value.advice
    ip(tmp_path, monkeypatch, kernel(modes=("LISTEN-ONLY",)))
    with pytest.raises(LinkError, match="only listens on can0"):
        open_can("can://socketcan/can0")
    assert kernel_rate(CAN0, 0, True) == 500_000
