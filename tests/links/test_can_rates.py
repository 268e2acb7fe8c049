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


@pytest.mark.parametrize("rate", [750_000, 800_000])
def test_s7_means_two_things_so_neither_is_used(rate: int) -> None:
    with on_terminal() as peer, pytest.raises(LinkError, match="no bit rate of") as caught:
        open_can(peer, rate)
    assert "S7 means 800 or 750 kbit/s" in caught.value.advice
    assert "bitrate=800000,btr=0016" in caught.value.advice
    assert (peer.received, peer.adapter.open) == ([], False)


@pytest.mark.usefixtures("long_timeouts")
def test_what_the_advice_says_works() -> None:
    with on_terminal() as peer:
        link = open_can(peer, 800_000, btr="0016")
        assert (link.rate, peer.adapter.bitrate) == (800_000, 800_000)
        link.close()
        with pytest.raises(LinkError, match="btr=0016 makes 800000 bit/s, not 500000"):
            open_can(peer, 500_000, btr="0016")


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
