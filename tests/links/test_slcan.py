"""slcan: text that is whole, damaged or cut, and adapters that refuse commands or never reply."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.link import slcan
from motorbus.link.slcan import SlcanCodec
from motorbus.simulation.slcan import SlcanAdapter
from tests.links.can_peer import LONG_PING, PING, PONG, Mute, Picky, on_terminal, open_can, some

pytestmark = pytest.mark.usefixtures("long_timeouts")
SOME = b"t62584002600000000000\r"

# -- text -------------------------------------------------------------------------------------------------------


FRAMES = st.builds(CanFrame, st.integers(0, 0x7FF), st.binary(max_size=8)) | st.builds(
    CanFrame, st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.just(True)
)


@pytest.mark.parametrize(
    ("frame", "line"),
    [
        (PING, SOME),
        (LONG_PING, b"T00000625101\r"),
        (CanFrame(0, b""), b"t0000\r"),
    ],
)
def test_lines_of_slcan(frame: CanFrame, line: bytes) -> None:
    assert SlcanCodec().encode(frame) == line
    assert SlcanCodec().feed(line) == [frame]


@given(frame=FRAMES, cut=st.integers(0, 40))
def test_what_an_slcan_adapter_writes_is_read(frame: CanFrame, cut: int) -> None:
    adapter, reader = SlcanAdapter(), SlcanCodec()
    adapter.receive(b"S6\rO\r")
    text = adapter.encode(frame, 1.0)
    assert reader.feed(text[:cut]) + reader.feed(text[cut:]) == [frame]
    assert adapter.receive(SlcanCodec().encode(frame)) == [frame]


@given(data=st.binary(max_size=80))
def test_no_data_makes_a_decoder_raise(data: bytes) -> None:
    reader = SlcanCodec()
    reader.feed(data)
    assert reader.feed(b"\r" + SOME)[-1:], "the next good frame is read"


@pytest.mark.parametrize(
    "line",
    [
        b"t6257400260000000",  # too short for seven
        b"t62574002600000000000",  # one byte too many
        b"t8258" + b"0" * 16,  # twelve bits
        b"t625840026000000000x0",
        b"\xff\xfe",
        b"t62584002600000000000t62584002600000000000",
    ],
)
def test_a_line_that_is_no_frame_is_counted(line: bytes) -> None:
    reader = SlcanCodec()
    assert reader.feed(line + b"\r" + SOME) == [PING]
    assert reader.damaged == 1


def test_replies_are_no_frames_and_the_first_counts() -> None:
    reader = SlcanCodec()
    assert reader.feed(b"\rz\rZ\rV1013\rNSIMU\rF00\rA\r") == []
    assert (reader.damaged, reader.reply) == (0, True)
    other = SlcanCodec()
    other.feed(b"\a\n\r")
    assert (other.refused, other.reply) == (1, False)
    other.forget()
    assert other.reply is None


def test_timestamps_and_frames_of_other_kinds_are_dropped() -> None:
    reader = SlcanCodec()
    assert reader.feed(SOME[:-1] + b"1F3A\r" + b"r0123\rR000000120\rd6253AB\r" + SOME) == [PING, PING]
    assert reader.damaged == 0


# -- adapters ---------------------------------------------------------------------------------------------------


def test_the_commands_at_open_and_close() -> None:
    adapter = Picky()
    adapter.is_open = True  # a killed program left the channel open on a busy bus
    with on_terminal(adapter) as peer:
        peer.say(PONG, PONG, PONG)
        link = open_can(peer, 250_000)
        assert adapter.commands == [b"C", b"S5", b"O"]
        assert (adapter.bitrate, adapter.is_open, link.trouble()) == (250_000, True, "")
        link.close()
    assert adapter.commands[-1] == b"C"


def test_an_adapter_that_never_replies_to_commands_can_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slcan, "FIRST_REPLY", 0.01)
    with on_terminal(Mute()) as peer:
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


@pytest.mark.parametrize(
    ("options", "command", "words"),
    [
        ({}, b"S6", r"refuses 500000 bit/s \(S6\)"),
        ({}, b"O", "refuses to open its channel"),
        ({"listen_only": "yes"}, b"L", "cannot only listen"),
    ],
)
def test_an_adapter_that_refuses(options: dict[str, Any], command: bytes, words: str) -> None:
    adapter = Picky(command)
    with on_terminal(adapter) as peer, pytest.raises(LinkError, match=words):
        open_can(peer, 500_000, **options)
    assert not adapter.is_open


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


def test_s7_means_two_rates_so_it_is_not_used() -> None:
    with on_terminal() as peer:
        with pytest.raises(LinkError, match="no bit rate of 750000"):
            open_can(peer, 750_000)
        assert not peer.adapter.is_open
        link = open_can(peer, 800_000)
        assert (link.rate, peer.adapter.bitrate) == (800_000, 800_000)
        link.close()


@pytest.mark.parametrize("baud", ["@abc", "@0"])
def test_a_rate_that_is_no_number_is_refused_in_words(baud: str) -> None:
    with on_terminal() as peer, pytest.raises(RequestError, match="is not a rate"):
        open_can(f"{peer.url}{baud}")
