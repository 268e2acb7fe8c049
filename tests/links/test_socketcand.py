"""socketcand servers that refuse, hang up, or are another service."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator

import pytest

from motorbus.errors import LinkError, LinkLost
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


def test_a_server_that_hangs_up() -> None:
    with socketcand_server() as peer:
        link = open_can(peer)
    with pytest.raises(LinkLost, match="hung up"):
        link.read(link.now() + 30)
    link.close()
