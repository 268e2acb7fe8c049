"""SDO frames: vectors and properties of the encoders and decoders, keys of replies, abort codes."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Reply
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from tests.protocol.kst.vectors import ALL, INVALID, MANUAL, REPLIES, REQUESTS

NOT_ENCODED = {"read-node-id-x", "sized-3", "upload-unsized", "reserved-bit", "reserved-data"}
"""Vectors that the decoders accept and no encoder makes: data in reserved places, lengths that no object has."""
ADDRESSEES = st.sampled_from([sdo.BROADCAST, *sdo.NODES])
INDEX, SUBINDEX, VALUE = st.integers(0, 0xFFFF), st.integers(0, 0xFF), st.binary(min_size=1, max_size=4)


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


def test_vectors_are_decoded_and_encoded() -> None:
    for vector in (*REQUESTS, *REPLIES):
        node, kind, place = vector.expected["node"], vector.kind, vector.object
        is_request = vector in REQUESTS
        one = (sdo.decode_request if is_request else sdo.decode_reply)(vector.frame.data)
        assert one is not None, vector.id
        assert (one.kind, one.index, one.subindex) == (kind.replace("upload-start", "segments"), *place)
        assert vector.payload in (one.data, b""), vector.id
        assert kind != "abort" or is_request or one.code == int(vector.expected["code"], 16)
        if vector.id not in NOT_ENCODED and kind != "upload-start" and (kind != "abort" or not is_request):
            assert encode(node, one, is_request) == vector.frame._replace(extended=False), vector.id


def encode(node: int, one: sdo.Sdo, is_request: bool) -> CanFrame:
    """The frame with these fields."""
    place = one.index, one.subindex
    match one.kind, is_request:
        case "upload", True:
            return sdo.encode_upload(node, *place)
        case "download", True:
            return sdo.encode_download(node, *place, one.data, sized=one.size is not None)
        case "upload", _:
            return sdo.encode_upload_reply(node, *place, one.data)
        case "download", _:
            return sdo.encode_download_reply(node, *place)
    return sdo.encode_abort_reply(node, *place, one.code)


def test_other_frames_are_no_requests() -> None:
    for vector in INVALID:
        if vector.direction == "instruction" and vector.frame.id >> 7 == sdo.REQUEST >> 7:
            assert sdo.decode_request(vector.frame.data) is None, vector.id
    assert sdo.decode_request(b"") is sdo.decode_reply(bytes(7)) is None


@given(ADDRESSEES, INDEX, SUBINDEX, VALUE, st.integers(0, 0xFFFF_FFFF), st.booleans())
def test_frame_is_decoded_as_encoded(
    node: int, index: int, subindex: int, data: bytes, code: int, sized: bool
) -> None:
    place, size = (index, subindex), len(data) if sized else None
    requests = [
        sdo.Sdo("upload", *place, bytes(4)),
        sdo.Sdo("download", *place, data if sized else data.ljust(4, b"\0"), size),
    ]
    replies = [
        sdo.Sdo("upload", *place, data, len(data)),
        sdo.Sdo("download", *place, bytes(4)),
        sdo.Sdo("abort", *place, code.to_bytes(4, "little")),
    ]
    for one in (*requests, *replies):
        is_request = one in requests
        frame = encode(node, one, is_request)
        assert (frame.id, len(frame.data)) == ((0x600 if is_request else 0x580) + node, 8)
        assert (sdo.decode_request if is_request else sdo.decode_reply)(frame.data) == one


def test_specifier_gives_the_kind_of_a_request_and_of_a_reply() -> None:
    """By the bits as CiA 301 prints them; segments and block transfer are not read."""
    for specifier in range(256):
        data, bits = bytes((specifier, 3, 0x60, 0, 1, 2, 3, 4)), f"{specifier:08b}"
        request, reply = sdo.decode_request(data), sdo.decode_reply(data)
        kinds = {"001": "download" if bits[6] == "1" else "", "010": "upload"}
        kind = "abort" if specifier == 0x80 else kinds.get(bits[:3], "")
        assert (request.kind if request else "") == kind
        if request and kind == "download":
            count = 4 - int(bits[4:6], 2) if bits[7] == "1" else 4
            assert (request.size is not None, request.data) == (bits[7] == "1", bytes((1, 2, 3, 4))[:count])
        whole = {0x60: "download", 0x80: "abort"}.get(specifier, "")
        parts = {"010": "upload" if bits[6] == "1" else "segments"}
        assert (reply.kind if reply else "") == parts.get(bits[:3], whole)


@pytest.mark.parametrize("node", [-1, 128])
def test_request_to_an_impossible_node_is_refused(node: int) -> None:
    with pytest.raises(RequestError, match="is not a node id"):
        sdo.encode_upload(node, 0x6002)


EXPECTED = {
    "6002": sdo.expected(5, "upload", 0x6002),
    "1010:1": sdo.expected(5, "upload", 0x1010, 1),
    "write 6003": sdo.expected(5, "download", 0x6003),
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
    found = {name for name, one in EXPECTED.items() if one.accepts(reply.key, len(reply.data))}
    assert found == requests
    assert not any(one.accepts(reply.key, 4) for one in EXPECTED.values())


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
