"""What can be sent, what must not be, and round trips of every field through the encoders and decoders."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo

NODES = st.sampled_from(sdo.NODES)
ADDRESSEES = st.sampled_from([sdo.BROADCAST, *sdo.NODES])
INDEXES = st.integers(0, 0xFFFF)
SUBINDEXES = st.integers(0, 0xFF)
DATA = st.binary(min_size=1, max_size=4)
TOGGLES = st.sampled_from([0, 1])
FRAMES = st.builds(
    CanFrame,
    st.one_of(st.integers(0, 0x7FF), st.integers(0, 0xFFFF_FFFF)),
    st.binary(max_size=9),
    st.booleans(),
)


# --- round trips --------------------------------------------------------------------------------------------


@given(ADDRESSEES, INDEXES, SUBINDEXES, st.booleans())
def test_an_upload_comes_out_as_it_went_in(node: int, index: int, subindex: int, extended: bool) -> None:
    frame = sdo.encode_upload(node, index, subindex, extended=extended)
    assert len(frame.data) == sdo.LENGTH
    expected = sdo.SdoRequest(node, "upload", index, subindex, b"", False, 0, extended)
    assert sdo.decode_request(frame) == expected


@given(ADDRESSEES, INDEXES, SUBINDEXES, DATA, st.booleans(), st.booleans())
def test_a_download_comes_out_as_it_went_in(
    node: int, index: int, subindex: int, data: bytes, sized: bool, extended: bool
) -> None:
    frame = sdo.encode_download(node, index, subindex, data, sized=sized, extended=extended)
    whole = data if sized else data.ljust(4, b"\0")
    expected = sdo.SdoRequest(node, "download", index, subindex, whole, sized, 0, extended)
    assert sdo.decode_request(frame) == expected


@given(NODES, TOGGLES, st.booleans())
def test_a_wish_for_a_segment_comes_out_as_it_went_in(node: int, toggle: int, extended: bool) -> None:
    frame = sdo.encode_segment(node, toggle, extended=extended)
    assert sdo.decode_request(frame) == sdo.SdoRequest(node, "segment", 0, 0, b"", False, toggle, extended)


@given(NODES, INDEXES, SUBINDEXES, st.integers(0, 0xFFFF_FFFF))
def test_an_abort_comes_out_as_it_went_in(node: int, index: int, subindex: int, code: int) -> None:
    ours = sdo.decode_request(sdo.encode_abort(node, index, subindex, code))
    wired = code.to_bytes(4, "little")
    assert ours == sdo.SdoRequest(node, "abort", index, subindex, wired, False, 0, False)
    theirs = sdo.encode_abort_reply(node, index, subindex, code)
    assert sdo.decode_reply(theirs.data) == sdo.SdoReply("abort", index, subindex, code=code)


@given(NODES, INDEXES, SUBINDEXES, DATA, st.booleans())
def test_a_value_comes_out_as_it_went_in(
    node: int, index: int, subindex: int, data: bytes, extended: bool
) -> None:
    frame = sdo.encode_upload_reply(node, index, subindex, data, extended=extended)
    assert (frame.id, frame.extended) == (sdo.REPLY + node, extended)
    assert sdo.decode_reply(frame.data) == sdo.SdoReply("upload", index, subindex, data, size=len(data))


@given(INDEXES, SUBINDEXES, DATA)
def test_a_value_usually_begins_with_its_length_and_its_object(
    index: int, subindex: int, data: bytes
) -> None:
    head = sdo.upload_head(index, subindex, len(data))
    assert (head + data).ljust(sdo.LENGTH, b"\0") == sdo.encode_upload_reply(1, index, subindex, data).data
    said = sdo.decode_reply(head + data.ljust(4, b"\xff"))
    assert said == sdo.SdoReply("upload", index, subindex, data, size=len(data))


def test_a_value_that_no_reply_carries_begins_with_nothing() -> None:
    assert [sdo.upload_head(0x6002, 0, size).hex() for size in range(6)] == [
        *("", "4f026000", "4b026000", "47026000", "43026000", "")
    ]


@given(NODES, INDEXES, SUBINDEXES, st.one_of(st.none(), st.integers(0, 0xFFFF_FFFF)))
def test_an_announcement_comes_out_as_it_went_in(
    node: int, index: int, subindex: int, size: int | None
) -> None:
    frame = sdo.encode_upload_start(node, index, subindex, size)
    assert sdo.decode_reply(frame.data) == sdo.SdoReply("upload-start", index, subindex, size=size)


@given(NODES, TOGGLES, st.binary(max_size=7), st.booleans())
def test_a_segment_comes_out_as_it_went_in(node: int, toggle: int, data: bytes, last: bool) -> None:
    frame = sdo.encode_segment_reply(node, toggle, data, last)
    expected = sdo.SdoReply("segment", 0, 0, data, size=len(data), toggle=toggle, last=last)
    assert sdo.decode_reply(frame.data) == expected


@given(NODES, INDEXES, SUBINDEXES)
def test_an_acknowledgement_comes_out_as_it_went_in(node: int, index: int, subindex: int) -> None:
    frame = sdo.encode_download_reply(node, index, subindex)
    assert sdo.decode_reply(frame.data) == sdo.SdoReply("download", index, subindex)


# --- nothing raises on what came ----------------------------------------------------------------------------


@given(FRAMES)
def test_decoders_never_raise(frame: CanFrame) -> None:
    request = sdo.decode_request(frame)
    reply = sdo.decode_reply(frame.data)
    notifications.decode_start(frame)
    notifications.decode_notification(frame)
    notifications.decode_report(frame.data)
    if len(frame.data) != sdo.LENGTH:
        assert (request, reply) == (None, None)


@pytest.mark.parametrize("flag", [REMOTE_FLAG, ERROR_FLAG])
def test_what_is_no_data_frame_is_no_request(flag: int) -> None:
    frame = sdo.encode_upload(1, 0x6002)
    assert sdo.decode_request(frame._replace(id=frame.id | flag)) is None
    start = notifications.encode_start("vendor", 1, on=True)
    assert notifications.decode_start(start._replace(id=start.id | flag)) is None


def request_kind(specifier: int) -> str:
    """By the bits, as CiA 301 prints them; segmented and block downloads are not part of this protocol."""
    bits = f"{specifier:08b}"
    if bits == "10000000":
        return "abort"
    return {"001": "download" if bits[6] == "1" else "unknown", "010": "upload", "011": "segment"}.get(
        bits[:3], "unknown"
    )


def test_every_first_byte_of_a_request() -> None:
    for specifier in range(256):
        request = sdo.decode_request(CanFrame(0x601, bytes((specifier, 3, 0x60, 0, 1, 2, 3, 4))))
        assert request is not None
        assert request.kind == request_kind(specifier)
        if request.kind == "download":
            count = 4 - (specifier >> 2 & 3) if specifier & 1 else 4
            assert (request.sized, request.data) == (bool(specifier & 1), bytes((1, 2, 3, 4))[:count])


def test_every_number_of_a_node() -> None:
    for identifier in range(0x800):
        request = sdo.decode_request(CanFrame(identifier, bytes((0x40, 2, 0x60, 0, 0, 0, 0, 0))))
        assert (request is not None) == (0x600 <= identifier <= 0x67F)


# --- what is never sent -------------------------------------------------------------------------------------

IMPOSSIBLE: dict[str, Callable[[], object]] = {
    "read of 128": lambda: sdo.encode_upload(128, 0x6002),
    "read of -1": lambda: sdo.encode_upload(-1, 0x6002),
    "write to 128": lambda: sdo.encode_download(128, 0x6003, 0, b"\0\0"),
    "index beyond 16 bits": lambda: sdo.encode_upload(1, 0x1_0000),
    "negative index": lambda: sdo.encode_upload(1, -1),
    "sub-index beyond a byte": lambda: sdo.encode_upload(1, 0x6002, 256),
    "no data": lambda: sdo.encode_download(1, 0x6003, 0, b""),
    "five bytes": lambda: sdo.encode_download(1, 0x6003, 0, bytes(5)),
    "five bytes, sized": lambda: sdo.encode_download(1, 0x6003, 0, bytes(5), sized=True),
    "segment from everyone": lambda: sdo.encode_segment(0, 0),
    "toggle 2": lambda: sdo.encode_segment(1, 2),
    "abort to everyone": lambda: sdo.encode_abort(0, 0x6003, 0, 0x0800_0000),
    "code beyond 32 bits": lambda: sdo.encode_abort(1, 0x6003, 0, 1 << 32),
    "negative code": lambda: sdo.encode_abort_reply(1, 0x6003, 0, -1),
    "reply of 0": lambda: sdo.encode_download_reply(0, 0x6003, 0),
    "reply of 128": lambda: sdo.encode_upload_reply(128, 0x6002, 0, b"\0\0"),
    "reply without data": lambda: sdo.encode_upload_reply(1, 0x6002, 0, b""),
    "value of an impossible object": lambda: sdo.upload_head(0x10000, 0, 2),
    "reply of five bytes": lambda: sdo.encode_upload_reply(1, 0x6002, 0, bytes(5)),
    "size beyond 32 bits": lambda: sdo.encode_upload_start(1, 0x100A, 0, 1 << 32),
    "segment of eight bytes": lambda: sdo.encode_segment_reply(1, 0, bytes(8), True),
}


@pytest.mark.parametrize("make", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_what_no_frame_can_carry_is_refused(make: Callable[[], object]) -> None:
    with pytest.raises(RequestError) as raised:
        make()
    assert raised.value.expected


def test_a_refused_node_is_named() -> None:
    with pytest.raises(RequestError, match="128 is not a node id") as raised:
        sdo.encode_upload(128, 0x6002)
    assert raised.value.node == 128
