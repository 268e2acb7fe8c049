"""Open, tune and close an slcan adapter on a pseudo-terminal, one that refuses commands, and one that never replies."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.link import slcan
from tests.links.can_peer import PING, PONG, Mute, Picky, on_terminal, open_can, some

pytestmark = pytest.mark.usefixtures("long_timeouts")


def test_the_commands_at_open_and_close() -> None:
    adapter = Picky()
    with on_terminal(adapter) as peer:
        link = open_can(peer, 250_000)
        assert adapter.commands == [b"C", b"S5", b"O"]
        assert (adapter.bitrate, adapter.open, link.trouble()) == (250_000, True, "")
        link.write(PING)
        assert some(link) == [PONG]
        link.close()
    assert adapter.commands[-1] == b"C"


def test_an_adapter_that_never_replies_to_commands_can_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slcan, "FIRST_REPLY", 0.01)
    with on_terminal(Mute()) as peer:
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


def test_a_refused_rate_leaves_the_channel_closed() -> None:
    adapter = Picky(b"S6")
    with on_terminal(adapter) as peer:
        with pytest.raises(LinkError, match=r"refuses 500000 bit/s \(S6\)"):
            open_can(peer, 500_000)
        assert adapter.commands[:2] == [b"C", b"S6"]
        assert not adapter.open
        open_can(peer, 250_000).close()


@pytest.mark.parametrize(
    ("options", "command", "words"),
    [
        ({}, b"O", "refuses to open its channel"),
        ({"listen_only": "yes"}, b"L", "cannot only listen"),
    ],
)
def test_an_adapter_that_refuses_to_open(options: dict[str, Any], command: bytes, words: str) -> None:
    with on_terminal(Picky(command)) as peer, pytest.raises(LinkError, match=words):
        open_can(peer, **options)


def test_a_rate_that_is_refused_later_changes_nothing() -> None:
    adapter = Picky(b"S8")
    with on_terminal(adapter) as peer:
        link = open_can(peer, 500_000)
        with pytest.raises(LinkError, match="refuses 1000000"):
            link.tune(1_000_000)
        assert (link.rate, adapter.bitrate) == (500_000, 500_000)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


def test_frames_that_arrive_during_open_are_no_replies() -> None:
    """A killed program left the channel open on a busy bus."""
    adapter = Picky()
    adapter.open = True
    with on_terminal(adapter) as peer:
        peer.say(PONG, PONG, PONG)
        link = open_can(peer)
        assert adapter.open
        link.close()


def test_damaged_lines_are_counted_and_reported_once() -> None:
    with on_terminal() as peer:
        link = open_can(peer)
        peer.say(b"t62\xff\r", b"t6254\r", b"t625x\r", b"garbage", b"\r", PONG)
        assert some(link) == [PONG]
        assert "4 lines of the adapter were damaged" in link.trouble()
        peer.say(b"\a\a", PONG)
        assert some(link) == [PONG]
        assert "refused 2 frames" in link.trouble()
        assert link.trouble() == ""
        link.close()


def test_an_unplugged_adapter_is_a_lost_link() -> None:
    with on_terminal() as peer:
        link = open_can(peer)
    with pytest.raises(LinkLost, match="unplugged"):
        link.read(link.now() + 30)
    with pytest.raises(LinkLost):
        link.write(PING)
    link.close()


def test_s7_means_two_rates_so_it_is_not_used() -> None:
    with on_terminal() as peer:
        with pytest.raises(LinkError, match="no bit rate of 750000"):
            open_can(peer, 750_000)
        assert not peer.adapter.open
        link = open_can(peer, 800_000)
        assert (link.rate, peer.adapter.bitrate) == (800_000, 800_000)
        link.close()


@pytest.mark.parametrize("baud", ["@abc", "@0"])
def test_a_rate_that_is_no_number_is_refused_in_words(baud: str) -> None:
    with on_terminal() as peer, pytest.raises(RequestError, match="not a rate of the serial line"):
        open_can(f"{peer.url}{baud}")
