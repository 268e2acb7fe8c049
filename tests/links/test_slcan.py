"""The dialogue with an slcan adapter: strict ones, mute ones, late ones, and those that say no."""

from __future__ import annotations

from typing import Any

import can
import pytest

from motorbus.errors import LinkError, LinkLost
from motorbus.link import slcan, usb_adapters
from motorbus.link.can_options import read_options
from motorbus.link.slcan import SlcanChannel, rate_command
from motorbus.simulation.slcan import SlcanAdapter
from tests.links.can_peer import PING, PONG, Mute, NarrowLink, Picky, on_terminal, open_can, some

pytestmark = pytest.mark.usefixtures("long_timeouts")


@pytest.mark.parametrize("strict", [False, True])
def test_the_commands_at_open(strict: bool) -> None:
    adapter = Picky(strict=strict)
    with on_terminal(adapter) as peer:
        link = open_can(peer, 250_000)
        assert adapter.commands == [b"C", b"S5", b"O"]
        assert (adapter.bitrate, adapter.open, link.counts.refused) == (250_000, True, 0)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()
    assert adapter.commands[-1] == b"C"


def test_a_silent_adapter_costs_little_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slcan, "FIRST_REPLY", 0.01)
    with on_terminal(Mute()) as peer:
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


@pytest.mark.parametrize("strict", [False, True])
def test_a_rate_that_the_adapter_refuses(strict: bool) -> None:
    adapter = Picky(b"S6", strict=strict)
    with on_terminal(adapter) as peer:
        with pytest.raises(LinkError, match=r"refuses 500000 bit/s \(S6\)"):
            open_can(peer, 500_000)
        assert adapter.commands == [b"C", b"S6"]
        assert not adapter.open
        open_can(peer, 250_000).close()


def test_a_refusal_that_comes_late_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The adapter was taken for mute, and then answered everything at once."""
    monkeypatch.setattr(slcan, "FIRST_REPLY", 0.0)
    monkeypatch.setattr(slcan, "SILENT_PAUSE", 10.0)
    adapter = Picky(b"S6")
    with on_terminal(adapter) as peer, pytest.raises(LinkError, match="refuses 500000"):
        open_can(peer, 500_000)
    assert not adapter.open


def test_a_refusal_that_comes_after_it_was_opened_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over Bluetooth the first replies may come after the open. Then nothing is sent at the wrong rate."""
    monkeypatch.setattr(slcan, "FIRST_REPLY", 0.0)
    monkeypatch.setattr(slcan, "SILENT_PAUSE", 0.0)
    adapter = Mute()
    with on_terminal(adapter) as peer:
        link = open_can(peer, 500_000)
        peer.say(b"\r\a\r")
        with pytest.raises(LinkError, match=r"refuses 500000 bit/s \(S6\)"):
            link.read(link.now() + 30)
        with pytest.raises(LinkError, match="channel of the adapter is closed"):
            link.write(PING)
        link.close()
    assert peer.received == []


def test_answers_to_a_program_that_was_killed_are_not_ours() -> None:
    """Two of its frames are still to be answered when we come; the refusal of our rate is the one after ours."""
    adapter = Picky(b"S6")
    with on_terminal(adapter) as peer:
        adapter._answer += b"z\rz\r"
        with pytest.raises(LinkError, match=r"refuses 500000 bit/s \(S6\)"):
            open_can(peer, 500_000)
    assert adapter.commands == [b"C", b"S6"]


def test_a_fork_that_closes_leaves_the_channel_to_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter = SlcanAdapter()
    adapter.feed(b"S6\rO\r")
    channel = SlcanChannel("it", NarrowLink(1000, adapter))  # type: ignore[arg-type]
    channel._is_open = True
    monkeypatch.setattr("os.getpid", lambda: 1)
    channel.close()
    assert adapter.open


@pytest.mark.parametrize("sent", range(1, 22))
def test_a_line_cut_off_by_closing_is_no_frame(sent: int) -> None:
    """C, which closes the channel, is a hexadecimal digit as well."""
    adapter = SlcanAdapter()
    adapter.feed(b"S6\rO\r")
    narrow = NarrowLink(sent, adapter)
    channel = SlcanChannel("it", narrow)  # type: ignore[arg-type]
    channel._is_open = True
    with pytest.raises(LinkError, match="no more bytes"):
        channel.write(PING)
    narrow.room = 1000
    channel.close()
    assert not adapter.open
    assert narrow.frames == []


@pytest.mark.parametrize(("options", "command"), [({}, b"O"), ({"listen_only": "yes"}, b"L")])
def test_an_adapter_that_does_not_open(options: dict[str, Any], command: bytes) -> None:
    with on_terminal(Picky(command)) as peer:
        words = "cannot only listen" if options else "refuses to open its channel"
        with pytest.raises(LinkError, match=words):
            open_can(peer, **options)


def test_a_rate_that_is_refused_later_leaves_it_as_it_was() -> None:
    adapter = Picky(b"S8")
    with on_terminal(adapter) as peer:
        link = open_can(peer, 500_000)
        with pytest.raises(LinkError, match="refuses 1000000"):
            link.tune(1_000_000)
        with pytest.raises(LinkError, match="no bit rate of 800000"):
            link.tune(800_000)
        assert (link.rate, adapter.bitrate) == (500_000, 500_000)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


def test_frames_of_another_rate_are_dropped() -> None:
    with on_terminal() as peer:
        link = open_can(peer)
        peer.echoes = False
        peer.say(PING)
        link.tune(125_000)
        peer.say(PONG)
        assert some(link) == [PONG]
        link.close()


def test_frames_that_come_while_it_is_opened_are_no_answers() -> None:
    """A killed program left the channel open, on a busy bus."""
    adapter = Picky()
    adapter.open = True
    with on_terminal(adapter) as peer:
        peer.say(PONG, PONG, PONG)
        link = open_can(peer)
        assert adapter.open
        link.close()


def test_damage_is_counted_and_survived() -> None:
    with on_terminal() as peer:
        link = open_can(peer)
        peer.say(b"t62\xff\r", b"t6254\r", b"t625x\r", b"garbage", b"\r", PONG)
        assert some(link) == [PONG]
        assert link.counts.damaged == 4
        peer.say(b"\a\a", PONG)
        assert some(link) == [PONG]
        assert link.counts.refused == 2
        assert "refused 2 frames" in link.trouble()
        assert link.trouble() == "", "reported once"
        peer.say(b"t6254\r", PONG)
        assert some(link) == [PONG]
        assert "1 lines of the adapter were damaged" in link.trouble()
        link.close()


def test_an_adapter_that_is_unplugged() -> None:
    with on_terminal() as peer:
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
    with pytest.raises(LinkLost, match="unplugged"):
        link.read(link.now() + 30)
    with pytest.raises(LinkLost):
        link.write(PING)
    link.close()


@pytest.mark.parametrize(
    ("options", "lines"), [({}, 440 / 115_200), ({"tty_baudrate": "1000000"}, 440 / 1_000_000)]
)
def test_a_serial_line_adds_the_time_of_two_lines(
    options: dict[str, Any], lines: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(usb_adapters, "PSEUDO_TERMINALS", ("no such prefix",))
    with on_terminal() as peer:
        link = open_can(peer, **options)
        assert link.latency == pytest.approx(usb_adapters.DEVICE_LATENCY + lines)
        link.close()


def test_the_command_for_a_rate() -> None:
    plain = read_options(can, "can://slcan/dev/x", 0, {})
    assert rate_command(plain, 20_000) == "S1"
    bits = {"f_clock": 8000000, "brp": 1, "tseg1": 7, "tseg2": 2, "sjw": 1, "nof_samples": 1}
    assert rate_command(read_options(can, "can://slcan/dev/x", 0, bits), 800_000) == "s0016"
