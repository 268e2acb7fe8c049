"""socketcand servers that are there, are something else, say nothing, or hang up."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator

import pytest

from motorbus.core.operation import ERROR_FLAG, CanFrame
from motorbus.errors import LinkError, LinkLost
from motorbus.link import socketcand
from tests.links.can_peer import PING, PONG, open_can, serving, socketcand_server, some


@contextlib.contextmanager
def server(*words: bytes) -> Iterator[str]:
    """It sends the first word at once and each other one for a request, and hangs up after the last."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def accept() -> bool:
            with listener.accept()[0] as connection, contextlib.suppress(OSError):
                for number, word in enumerate(words):
                    if number:
                        connection.recv(256)
                    connection.sendall(word)
            return True

        with serving(listener, accept):
            yield f"can://socketcand/127.0.0.1:{listener.getsockname()[1]}/can0"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((b"",), "does not greet"),
        ((b"SSH-2.0 >",), "does not greet"),
        ((b"< hi >", b"< error could not open bus >"), "the server refuses `open can0`"),
        ((b"< hi >", b""), "the server refuses `open can0`"),
    ],
)
def test_a_server_of_another_kind(words: tuple[bytes, ...], complaint: str) -> None:
    with server(*words) as url, pytest.raises(LinkError, match=complaint):
        open_can(url)


def test_a_silent_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcand, "REPLY_TIME", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as mute, pytest.raises(LinkError, match="does not greet"):
        open_can(f"can://socketcand/127.0.0.1:{mute.getsockname()[1]}/can0")


@pytest.mark.parametrize("word", [b"x", b"x" * 4096])
def test_a_server_that_talks_without_end(monkeypatch: pytest.MonkeyPatch, word: bytes) -> None:
    monkeypatch.setattr(socketcand, "REPLY_TIME", 0.1)
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def accept() -> bool:
            with listener.accept()[0] as connection, contextlib.suppress(OSError):
                while not over.wait(0.001):
                    connection.sendall(word)
            return True

        with serving(listener, accept):
            url = f"can://socketcand/127.0.0.1:{listener.getsockname()[1]}/can0"
            with pytest.raises(LinkError, match="does not greet"):
                open_can(url)
            over.set()


@pytest.mark.parametrize("words", [(b"< hi >",), (b"< hi >", b"< ok >")])
def test_a_server_that_falls_silent(monkeypatch: pytest.MonkeyPatch, words: tuple[bytes, ...]) -> None:
    monkeypatch.setattr(socketcand, "REPLY_TIME", 0.1)
    with server(*words, b"") as url, pytest.raises(LinkError, match="the server refuses"):
        open_can(url)


def test_a_given_rate_cannot_be_checked() -> None:
    with socketcand_server() as peer:
        link = open_can(peer, 250_000)
        assert link.rate == 250_000
        assert link.warnings == (
            "the bit rate is set at the server; whether that is 250000 bit/s cannot be checked",
        )
        link.tune(250_000)
        with pytest.raises(LinkError, match="cannot be changed to 500000"):
            link.tune(500_000)
        with pytest.raises(LinkError, match="cannot only listen"):
            link.tune(250_000, listen_only=True)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


def test_it_cannot_only_listen() -> None:
    with socketcand_server() as peer, pytest.raises(LinkError, match="cannot only listen"):
        open_can(peer, listen_only="yes")


def test_a_server_that_hangs_up() -> None:
    with socketcand_server() as peer:
        link = open_can(peer)
    with pytest.raises(LinkLost, match="hung up"):
        link.read(link.now() + 30)
    link.close()


def test_errors_and_damage() -> None:
    with socketcand_server() as peer:
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
        peer.say(b"< error 004 1.0 >", b"< frame 123 1.0 >< frame 123 1.0 4 ><", PONG)
        assert some(link, 3) == [CanFrame(ERROR_FLAG | 4, bytes(8)), CanFrame(0x123, b""), PONG]
        assert link.counts.damaged == 2
        link.close()
