"""A socketcand connection, element by element: the handshake, the modes, frames both ways, and garbage."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.simulation.adapter import Adapter
from motorbus.simulation.socketcand import LONGEST_ELEMENT, SETTLING, UNKNOWN, SocketcandAdapter

FRAME = CanFrame(0x625, bytes.fromhex("2203600084030000"))
OK = b"< ok >"


def told(adapter: SocketcandAdapter, text: bytes, at: float = 0.0) -> bytes:
    """What it answers to this; frames in it are dropped."""
    adapter.feed(text, at)
    return adapter.take()


def opened(mode: str = "rawmode") -> SocketcandAdapter:
    adapter = SocketcandAdapter()
    assert told(adapter, b"< open can0 >") == OK
    assert told(adapter, b"< %s >" % mode.encode()) == OK
    return adapter


def test_it_is_an_adapter() -> None:
    adapter: Adapter = SocketcandAdapter()
    assert (adapter.open, adapter.bitrate, adapter.listen_only, adapter.finished) == (
        False,
        None,
        False,
        False,
    )


# The handshake.


def test_the_handshake_word_by_word() -> None:
    adapter = SocketcandAdapter()
    assert adapter.greet() == b"< hi >"
    assert not adapter.open
    assert told(adapter, b"< open can0 >") == OK
    assert (adapter.open, adapter.mode) == (True, "bcmmode")
    assert told(adapter, b"< rawmode >") == OK
    assert adapter.mode == "rawmode"


@pytest.mark.parametrize("text", [b"< open >", b"< open a b >", b"< open abcdefghijklmnopq >"])
def test_a_bus_that_cannot_be(text: bytes) -> None:
    adapter = SocketcandAdapter()
    assert told(adapter, text) == b"< error could not open bus >"
    assert adapter.finished
    assert not adapter.open
    assert told(adapter, b"< open can0 >") == b""


@pytest.mark.parametrize("name", [b"c", b"vcan0", b"abcdefghijklmnop"])
def test_any_name_of_up_to_16_characters_is_this_bus(name: bytes) -> None:
    assert told(SocketcandAdapter(), b"< open " + name + b" >") == OK


@pytest.mark.parametrize("text", [b"< rawmode >", b"< send 1 0 >", b"< echo >", b"< >", b"<>", b"< hi >"])
def test_before_it_is_open_nothing_else_is_known(text: bytes) -> None:
    adapter = SocketcandAdapter()
    assert adapter.feed(text) == []
    assert adapter.take() == UNKNOWN


def test_frames_do_not_join_the_answer_to_rawmode() -> None:
    adapter = SocketcandAdapter()
    told(adapter, b"< open can0 >", 1.0)
    assert adapter.deliver(FRAME, 1.0) == b""
    assert told(adapter, b"< rawmode >", 2.0) == OK
    assert adapter.deliver(FRAME, 2.0 + 0.9 * SETTLING) == b""
    assert adapter.deliver(FRAME, 2.0 + SETTLING) != b""


def test_a_host_that_speaks_has_read_the_answer() -> None:
    adapter = SocketcandAdapter()
    told(adapter, b"< open can0 >", 1.0)
    told(adapter, b"< rawmode >", 2.0)
    assert adapter.feed(b"< send 123 0 >", 2.001) == [CanFrame(0x123, b"")]
    assert adapter.deliver(FRAME, 2.001) != b""


# Frames of the host.


@pytest.mark.parametrize(
    ("words", "frame"),
    [
        (b"send 625 8 22 3 60 0 84 3 0 0", FRAME),
        (b"send 625 8 22 03 60 00 84 03 00 00", FRAME),
        (b"send 123 0 ", CanFrame(0x123, b"")),
        (b"send 7f 1 aB", CanFrame(0x7F, b"\xab")),
        (b"send 00000625 1 1F", CanFrame(0x625, b"\x1f", True)),
        (b"send 1FFFFFFF 0", CanFrame(0x1FFFFFFF, b"", True)),
        (b"sendrtr 123 2", CanFrame(0x123 | REMOTE_FLAG, bytes(2))),
        (b"sendrtr 00000123 0", CanFrame(0x123 | REMOTE_FLAG, b"", True)),
    ],
)
@pytest.mark.parametrize("mode", ["rawmode", "bcmmode"])
def test_frames_in_both_modes(words: bytes, frame: CanFrame, mode: str) -> None:
    adapter = opened(mode)
    assert adapter.feed(b"< " + words + b" >") == [frame]
    assert adapter.feed(b"<" + words + b">") == [frame]
    assert adapter.take() == b""


@pytest.mark.parametrize(
    "words",
    [
        *(
            b"send",
            b"send 123",
            b"send 123 1",
            b"send 123 1 1 2",
            b"send 123 9 1 2 3 4 5 6 7 8 9",
            b"send 123 0x1 1",
        ),
        *(
            b"send 800 0",
            b"send 1234 0",
            b"send 20000000 0",
            b"send 123456789 0",
            b"send 12g 0",
            b"send -1 0",
        ),
        *(
            b"send 123 1 100",
            b"send 123 1 g",
            b"send 123 1 +1",
            b"send 123 +1 1",
            b"send 123 8",
            b"sendrtr 123",
        ),
        *(b"sendrtr 123 9", b"sendrtr 123 1 1", b"sendrtr 12345 1", b"send 123 \xb2 1 1"),
    ],
)
def test_what_is_malformed_is_ignored_without_a_word(words: bytes) -> None:
    adapter = opened()
    assert adapter.feed(b"< " + words + b" >") == []
    assert adapter.take() == b""
    assert adapter.feed(b"< send 123 0 >") == [CanFrame(0x123, b"")]


def test_elements_cut_anywhere_and_what_stands_between_them() -> None:
    adapter = opened()
    text = b"< send 123 1 1 >\n< send 124 0 >  < echo >> x <<< send 125 0 >"
    frames = [frame for place in range(len(text)) for frame in adapter.feed(text[place : place + 1])]
    assert [frame.id for frame in frames] == [0x123, 0x124, 0x125]
    assert adapter.take() == b"< echo >"


def test_an_element_without_end_is_bounded() -> None:
    adapter = opened()
    for _ in range(1000):
        adapter.feed(b"< send" + b" 1" * 500)
        assert len(adapter._text) < LONGEST_ELEMENT
    assert adapter.feed(b"< send 123 0 >") == [CanFrame(0x123, b"")]


# Frames of the bus.


@pytest.mark.parametrize(
    ("frame", "element"),
    [
        (FRAME, b"< frame 625 1.500000 2203600084030000 >"),
        (CanFrame(0x23, b""), b"< frame 023 1.500000  >"),
        (CanFrame(0x23, b"\xab", True), b"< frame 00000023 1.500000 AB >"),
        (CanFrame(ERROR_FLAG | 0x80, bytes(8)), b"< error 080 1.500000 >"),
        (CanFrame(0x23 | REMOTE_FLAG, bytes(4)), b"< rtr 023 1.500000 4 >"),
        (CanFrame(0x23 | REMOTE_FLAG, b"", True), b"< rtr 00000023 1.500000 0 >"),
    ],
)
def test_frames_in_raw_mode(frame: CanFrame, element: bytes) -> None:
    assert opened().deliver(frame, 1.5) == element


def test_moments_may_be_the_time_of_day() -> None:
    adapter = SocketcandAdapter(epoch=1436509052.0)
    told(adapter, b"< open can0 >< rawmode >")
    assert adapter.deliver(CanFrame(1, b"\1"), 0.25) == b"< frame 001 1436509052.250000 01 >"


# The other modes.


def test_a_subscription() -> None:
    adapter = opened("bcmmode")
    assert adapter.deliver(FRAME, 0.0) == b""
    assert told(adapter, b"< subscribe 0 100000 625 >") == b""
    assert adapter.deliver(FRAME, 1.0) == b"< frame 625 1.000000 22 03 60 00 84 03 00 00 >"
    assert adapter.deliver(FRAME, 1.05) == b""
    assert adapter.deliver(FRAME, 1.1) != b""
    assert adapter.deliver(CanFrame(0x625, b"", True), 2.0) == b""
    assert told(adapter, b"< unsubscribe 625 >") == b""
    assert adapter.deliver(FRAME, 3.0) == b""


def test_a_filter_lets_changes_through() -> None:
    adapter = opened("bcmmode")
    assert told(adapter, b"< filter 0 0 00000123 2 F0 00 >") == b""
    shown = [
        bool(adapter.deliver(CanFrame(0x123, bytes.fromhex(data), True), at))
        for at, data in enumerate(["1000", "1FFF", "2000", "2000", "20", "30"])
    ]
    assert shown == [True, False, True, False, True, True]


@pytest.mark.parametrize(
    "words",
    [b"subscribe 0 0", b"subscribe 0 x 123", b"subscribe 0 0 1234", b"filter 0 0 123", b"filter x 0 123 0"],
)
def test_an_impossible_subscription_is_ignored(words: bytes) -> None:
    adapter = opened("bcmmode")
    assert told(adapter, b"< " + words + b" >") == b""
    assert told(adapter, b"< unsubscribe >< unsubscribe x >") == b""
    assert adapter.deliver(CanFrame(0x123, b""), 0.0) == b""


@pytest.mark.parametrize("words", [b"add 1 0 123 1 11", b"update 123 1 11", b"delete 123"])
def test_cyclic_sending_is_refused_in_words(words: bytes) -> None:
    adapter = opened("bcmmode")
    assert adapter.feed(b"< " + words + b" >") == []
    assert adapter.take() == b"< error cyclic sending is not simulated >"


def test_statistics() -> None:
    adapter = opened()
    adapter.feed(b"< send 123 2 1 2 >")
    adapter.deliver(FRAME, 1.0)
    assert told(adapter, b"< controlmode >") == OK
    assert told(adapter, b"< statistics 1000 >") == b"< stat 8 1 2 1 >"
    assert adapter.deliver(FRAME, 2.0) == b"< stat 16 2 2 1 >"
    assert adapter.deliver(FRAME, 2.5) == b""
    assert told(adapter, b"< statistics 0 >") == b""
    assert adapter.deliver(FRAME, 9.0) == b""
    assert told(adapter, b"< statistics x >< send 1 0 >") == UNKNOWN


@pytest.mark.parametrize("mode", ["rawmode", "bcmmode", "controlmode"])
def test_an_echo_in_every_mode(mode: str) -> None:
    assert told(opened(mode), b"< echo >") == b"< echo >"


@pytest.mark.parametrize(
    "words", [b"isotpmode", b"open can0", b"nonsense", b"rawmode 1", b"muxfilter 0 0 1 2", b"subscribe 0 0 1"]
)
def test_what_is_not_known_in_raw_mode(words: bytes) -> None:
    assert told(opened(), b"< " + words + b" >") == UNKNOWN


def test_modes_may_be_switched_to_and_fro() -> None:
    adapter = opened("bcmmode")
    told(adapter, b"< subscribe 0 0 625 >")
    assert told(adapter, b"< rawmode >< bcmmode >") == OK + OK
    assert adapter.deliver(FRAME, 9.0) == b""


# Anything at all.


@given(st.lists(st.binary(max_size=64) | st.text("<> send0123fgopen\n", max_size=40), max_size=20))
def test_garbage_never_raises_and_is_never_kept(pieces: list[bytes | str]) -> None:
    for adapter in (SocketcandAdapter(), opened(), opened("bcmmode"), opened("controlmode")):
        for piece in pieces:
            for frame in adapter.feed(piece.encode() if isinstance(piece, str) else piece):
                assert len(frame.data) <= 8
            adapter.take()
            assert len(adapter._text) < LONGEST_ELEMENT


@given(st.integers(0, 0x1FFFFFFF), st.booleans(), st.binary(max_size=8))
def test_every_frame_can_be_sent(id: int, extended: bool, data: bytes) -> None:
    id = id if extended else id & 0x7FF
    words = f"< send {id:0{8 if extended else 3}X} {len(data)} {data.hex(' ')} >"
    assert opened().feed(words.encode()) == [CanFrame(id, data, extended)]
