"""SDO frames: vectors and properties of the encoders and decoders, keys of replies, abort codes."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Reply
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from tests.protocol.kst.vectors import ALL, INVALID, MANUAL, NODES, REPLIES, REQUESTS

NOT_ENCODED = {"read-node-id-x", "sized-3", "upload-unsized", "reserved-bit", "reserved-data"}
"""Vectors that the decoders accept and no encoder makes: data in reserved places, lengths that no object has."""
ADDRESSEES = st.sampled_from([sdo.BROADCAST, *sdo.NODES])
INDEX, SUBINDEX, VALUE = st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.binary(min_size=1, max_size=4)
CODE, YES_OR_NO = st.integers(0, 0xFFFF_FFFF), st.booleans()


def encode_request(request: sdo.SdoRequest) -> CanFrame:
    """The frame of a request with these fields."""
    node, kind, index, subindex, data, sized, extended = request
    frame = CanFrame(0x600 + node, bytes((0x80, index & 0xFF, index >> 8, subindex)) + data)
    if kind == "upload":
        frame = sdo.encode_upload(node, index, subindex)
    elif kind == "download":
        frame = sdo.encode_download(node, index, subindex, data, sized=sized)
    return frame._replace(extended=extended)


def encode_reply(node: int, reply: sdo.SdoReply) -> CanFrame:
    """The frame of a reply with these fields."""
    kind, index, subindex, data, code, size = reply
    if kind == "upload":
        return sdo.encode_upload_reply(node, index, subindex, data)
    if kind == "upload-start":
        return sdo.encode_upload_start(node, index, subindex, size)
    if kind == "abort":
        return sdo.encode_abort_reply(node, index, subindex, code)
    return sdo.encode_download_reply(node, index, subindex)


def test_vectors_are_complete_and_have_a_source() -> None:
    kinds = Counter((vector.direction, vector.kind) for vector in MANUAL)
    assert kinds == {
        ("instruction", "download"): 19,
        ("instruction", "upload"): 5,
        ("status", "download"): 3,
        ("status", "upload"): 10,
        ("status", "abort"): 29,
    }
    assert all(vector.source for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)
    assert len({vector.errata for vector in ALL} - {""}) == 12


@pytest.mark.parametrize("extended", [False, True])
def test_request_vectors_are_decoded_and_encoded(extended: bool) -> None:
    for vector in REQUESTS:
        frame = vector.frame._replace(extended=extended)
        expected = sdo.SdoRequest(
            vector.expected["node"],
            vector.kind,
            *vector.object,
            vector.payload,
            vector.id.startswith("sized"),
            extended,
        )
        assert sdo.decode_request(frame) == expected, vector.id
        assert vector.id in NOT_ENCODED or encode_request(expected) == frame, vector.id


def test_reply_vectors_are_decoded_and_encoded() -> None:
    for vector in REPLIES:
        reply = sdo.decode_reply(vector.frame.data)
        assert reply is not None, vector.id
        assert (reply.kind, reply.index, reply.subindex) == (vector.kind, *vector.object), vector.id
        assert (reply.data, reply.code) == (vector.payload, int(vector.expected.get("code", "0"), 16))
        node = vector.expected["node"]
        assert vector.id in NOT_ENCODED or encode_reply(node, reply) == vector.frame, vector.id


def test_other_frames_are_no_requests() -> None:
    for vector in INVALID:
        request = sdo.decode_request(vector.frame)
        assert request is None or request.kind == "unknown", vector.id
    for vector in REQUESTS:
        for flag in (REMOTE_FLAG, ERROR_FLAG):
            assert sdo.decode_request(vector.frame._replace(id=vector.frame.id | flag)) is None
    data = REQUESTS[0].frame.data
    decoded = [number for number in range(0x800) if sdo.decode_request(CanFrame(number, data)) is not None]
    assert decoded == list(range(0x600, 0x680))


@given(ADDRESSEES, INDEX, SUBINDEX, VALUE, YES_OR_NO, YES_OR_NO)
def test_request_is_decoded_as_encoded(
    node: int, index: int, subindex: int, data: bytes, sized: bool, extended: bool
) -> None:
    whole = data.ljust(4, b"\0")
    requests = [
        sdo.SdoRequest(node, "upload", index, subindex, b"", False, extended),
        sdo.SdoRequest(node, "download", index, subindex, data if sized else whole, sized, extended),
    ]
    if node != sdo.BROADCAST:
        requests.append(sdo.SdoRequest(node, "abort", index, subindex, whole, False, extended))
    for fields in requests:
        frame = encode_request(fields)
        assert (len(frame.data), frame.id) == (8, 0x600 + node)
        assert sdo.decode_request(frame) == fields


@given(NODES, INDEX, SUBINDEX, VALUE, CODE, YES_OR_NO)
def test_reply_is_decoded_as_encoded(
    node: int, index: int, subindex: int, data: bytes, number: int, sized: bool
) -> None:
    replies = [
        sdo.SdoReply("upload", index, subindex, data, size=len(data)),
        sdo.SdoReply("upload-start", index, subindex, size=number if sized else None),
        sdo.SdoReply("download", index, subindex),
        sdo.SdoReply("abort", index, subindex, code=number),
    ]
    for fields in replies:
        frame = encode_reply(node, fields)
        assert (len(frame.data), frame.id) == (8, 0x580 + node)
        assert sdo.decode_reply(frame.data) == fields


def test_specifier_gives_the_kind_of_a_request_and_of_a_reply() -> None:
    """By the bits as CiA 301 prints them; segments and block transfer are not read."""
    for specifier in range(256):
        data, bits = bytes((specifier, 3, 0x60, 0, 1, 2, 3, 4)), f"{specifier:08b}"
        request, reply = sdo.decode_request(CanFrame(0x601, data)), sdo.decode_reply(data)
        assert request is not None
        kinds = {"001": "download" if bits[6] == "1" else "unknown", "010": "upload"}
        assert request.kind == ("abort" if specifier == 0x80 else kinds.get(bits[:3], "unknown"))
        if request.kind == "download":
            count = 4 - int(bits[4:6], 2) if bits[7] == "1" else 4
            assert (request.sized, request.data) == (bits[7] == "1", bytes((1, 2, 3, 4))[:count])
        whole = {0x60: "download", 0x80: "abort"}.get(specifier, "")
        parts = {"010": "upload" if bits[6] == "1" else "upload-start"}
        assert (reply.kind if reply else "") == parts.get(bits[:3], whole)


@pytest.mark.parametrize("node", [-1, 128])
def test_request_to_an_impossible_node_is_refused(node: int) -> None:
    with pytest.raises(RequestError, match="is not a node id"):
        sdo.encode_upload(node, 0x6002)


EXPECTED = {
    "6002": sdo.upload_due(5, 0x6002),
    "1010:1": sdo.upload_due(5, 0x1010, 1),
    "write 6003": sdo.download_due(5, 0x6003),
}


@pytest.mark.parametrize(
    ("data", "requests"),
    [
        ("4B02600000000000", {"6002"}),
        ("4102600009000000", {"6002"}),
        ("4B03600000000000", set()),
        ("4302600100000000", set()),
        ("6003600000000000", {"write 6003"}),
        ("6002600000000000", set()),
        ("8002600000000206", {"6002"}),
        ("8002600100000206", set()),
        ("8010100100000206", {"1010:1"}),
        ("8010100000000206", {"1010:1"}),
        ("8000000000000206", set(EXPECTED)),
        ("80FF5F0000000206", set()),
    ],
)
def test_key_matches_replies_to_its_request(data: str, requests: set[str]) -> None:
    """An abort repeats the sub-index, or 0 in its place, or 0:0."""
    (reply,) = notifications.FrameReceiver().feed(CanFrame(0x585, bytes.fromhex(data)))
    assert isinstance(reply, Reply)
    found = {name for name, one in EXPECTED.items() if one.key == reply.key and reply.key == one.key}
    assert found == requests
    assert {(one.node, one.length) for one in EXPECTED.values()} == {(5, 8)}
    assert len({hash(one.key) for one in EXPECTED.values()}) == 1


def test_abort_codes_have_the_words_of_the_manual() -> None:
    printed = [vector for vector in MANUAL if vector.kind == "abort"]
    words = {int(vector.expected["code"], 16): vector.expected["text"] for vector in printed}
    assert len(words) == 29
    assert words.items() <= sdo.ABORTS.items()
    for code, text in sdo.ABORTS.items():
        swapped = int.from_bytes(code.to_bytes(4, "little"), "big")
        assert (sdo.meant_code(code), sdo.meant_code(swapped)) == (code, code)
        assert sdo.abort_text(code) == text
    assert sdo.abort_text(0x0F00_0009) == "unknown abort code 0x0F000009"
