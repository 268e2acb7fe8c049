"""Every frame of the manual and of further sources, made by the encoders and taken apart by the decoders."""

from __future__ import annotations

from collections import Counter

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Noise, Notification, Reply
from motorbus.families.kst import notifications, sdo
from tests.protocol.kst.vectors import (
    ALL,
    INVALID,
    MANUAL,
    NOTICES,
    REPLIES,
    REQUESTS,
    STARTS,
    UNASKED,
    VALID,
    Vector,
    name_of,
)

# what an encoder does not make, and why
NOT_MADE = {
    "read-node-id-x": "the data of a read are 0",
    "sized-3": "no object has three bytes",
    "upload-unsized": "our server states the length",
    "reserved-bit": "reserved bits are 0",
    "reserved-data": "reserved bytes are 0",
}


def numbered(vector: Vector) -> tuple[int, int, int]:
    return (int(vector.expected["node"]), *vector.object)


def request_of(vector: Vector) -> CanFrame:
    if vector.kind == "upload":
        return sdo.encode_upload(*numbered(vector))
    if vector.kind == "segment":
        return sdo.encode_segment(vector.expected["node"], vector.expected["toggle"])
    if vector.kind == "abort":
        return sdo.encode_abort(*numbered(vector), int.from_bytes(vector.payload, "little"))
    sized = vector.id.startswith("sized")
    return sdo.encode_download(*numbered(vector), vector.payload, sized=sized)


def reply_of(vector: Vector) -> CanFrame:
    if vector.kind == "upload":
        return sdo.encode_upload_reply(*numbered(vector), vector.payload)
    if vector.kind == "upload-start":
        return sdo.encode_upload_start(*numbered(vector), vector.expected.get("size"))
    if vector.kind == "segment":
        node, last = vector.expected["node"], vector.expected["last"]
        return sdo.encode_segment_reply(node, vector.expected["toggle"], vector.payload, last)
    if vector.kind == "abort":
        return sdo.encode_abort_reply(*numbered(vector), int(vector.expected["code"], 16))
    return sdo.encode_download_reply(*numbered(vector))


def test_the_manual_is_complete() -> None:
    kinds = Counter((vector.direction, vector.kind, vector.expected["index"]) for vector in MANUAL)
    assert kinds == {
        ("instruction", "download", "3001"): 8,
        ("status", "download", "3001"): 1,
        ("instruction", "download", "3000"): 3,
        ("status", "download", "3000"): 1,
        ("instruction", "download", "1010"): 1,
        ("instruction", "upload", "3000"): 2,
        ("status", "upload", "3000"): 1,
        ("instruction", "download", "6003"): 7,
        ("status", "download", "6003"): 1,
        ("instruction", "upload", "6002"): 2,
        ("status", "upload", "6002"): 8,
        ("instruction", "upload", "100A"): 1,
        ("status", "upload", "100A"): 1,
        ("status", "abort", "6003"): 29,
    }


def test_every_vector_says_where_it_is_from_and_has_a_name_of_its_own() -> None:
    assert all(vector.source and vector.meaning for vector in ALL)
    assert len({vector.id for vector in ALL}) == len(ALL)


def test_what_comes_unasked_names_nodes_1_to_3() -> None:
    assert {vector.expected["node"] for vector in NOTICES} == {1, 2, 3}
    assert len(UNASKED) == len(NOTICES) + len(STARTS)


def test_each_erratum_has_its_vectors() -> None:
    assert {vector.errata for vector in ALL} - {""} == {
        "abort-code-byte-order",
        "abort-sub-index",
        "broadcast",
        "printed-0Xf8",
        "read-node-id-data",
        "refused-values",
        "reports-share-the-reply-id",
        "save-is-not-answered",
        "specifier-0x22",
        "start-forms",
        "status-is-position",
        "version-in-segments",
    }


@pytest.mark.parametrize("vector", REQUESTS, ids=name_of)
def test_a_request_is_taken_apart(vector: Vector) -> None:
    request = sdo.decode_request(vector.frame)
    assert request is not None
    assert (request.node, request.index, request.subindex) == numbered(vector)
    assert (request.kind, request.data, request.extended) == (vector.kind, vector.payload, False)
    assert request.sized is vector.id.startswith("sized")
    assert request.toggle == vector.expected.get("toggle", 0)


@pytest.mark.parametrize("vector", [v for v in REQUESTS if v.id not in NOT_MADE], ids=name_of)
def test_a_request_is_made(vector: Vector) -> None:
    assert request_of(vector) == vector.frame


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_a_reply_is_taken_apart(vector: Vector) -> None:
    reply = sdo.decode_reply(vector.frame.data)
    assert reply is not None
    assert (reply.kind, reply.index, reply.subindex) == (vector.kind, *vector.object)
    assert reply.data == vector.payload
    assert reply.code == int(vector.expected.get("code", "0"), 16)
    assert reply.toggle == vector.expected.get("toggle", 0)
    assert reply.last is vector.expected.get("last", False)


@pytest.mark.parametrize("vector", [v for v in REPLIES if v.id not in NOT_MADE], ids=name_of)
def test_a_reply_is_made(vector: Vector) -> None:
    assert reply_of(vector) == vector.frame


@pytest.mark.parametrize("vector", REPLIES, ids=name_of)
def test_a_reply_is_received_on_the_lane_of_its_node(vector: Vector) -> None:
    (event,) = notifications.FrameReceiver().feed(vector.frame)
    assert isinstance(event, Reply)
    assert (event.lane, event.data) == (vector.expected["node"], vector.frame.data)


@pytest.mark.parametrize("vector", NOTICES, ids=name_of)
def test_what_comes_unasked_is_a_notice(vector: Vector) -> None:
    expected = Notification(vector.expected["node"], vector.kind, vector.frame.data)
    assert notifications.FrameReceiver().feed(vector.frame) == [expected]
    if vector.kind == "report":
        assert notifications.decode_report(vector.frame.data) == vector.expected["raw"]


@pytest.mark.parametrize("vector", STARTS, ids=name_of)
def test_a_start_is_made_and_taken_apart(vector: Vector) -> None:
    node, on = vector.expected["node"], vector.expected["on"]
    start = notifications.Start(frozenset(vector.expected["forms"]), node, on)
    assert notifications.decode_start(vector.frame) == start
    for form in vector.expected["forms"]:
        assert notifications.encode_start(form, node, on) == vector.frame


@pytest.mark.parametrize("vector", [*REQUESTS, *STARTS], ids=name_of)
def test_what_another_client_says_is_foreign(vector: Vector) -> None:
    assert notifications.FrameReceiver().feed(vector.frame) == [Noise(vector.frame.data, "foreign")]


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_what_is_no_frame_is_noise_and_no_request(vector: Vector) -> None:
    (event,) = notifications.FrameReceiver(vector.frame.extended).feed(vector.frame)
    assert isinstance(event, Noise)
    assert event.data == vector.frame.data
    request = sdo.decode_request(vector.frame)
    assert request is None or request.kind == "unknown"
    assert notifications.decode_start(vector.frame) is None


@pytest.mark.parametrize("vector", [*REPLIES, *NOTICES], ids=name_of)
def test_cut_short_or_in_the_other_id_format_it_is_noise(vector: Vector) -> None:
    frame = vector.frame
    wrong = [frame._replace(data=frame.data[:count]) for count in range(len(frame.data))]
    for other in (*wrong, frame._replace(extended=True)):
        assert notifications.FrameReceiver().feed(other) == [Noise(other.data, "foreign")]


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_in_29_bits_a_frame_says_the_same(vector: Vector) -> None:
    other = vector.frame._replace(extended=True)
    short, long = notifications.FrameReceiver(False), notifications.FrameReceiver(True)
    assert long.feed(other) == short.feed(vector.frame)
    request, same = sdo.decode_request(vector.frame), sdo.decode_request(other)
    assert same == (request and request._replace(extended=True))
    assert notifications.decode_start(other) == notifications.decode_start(vector.frame)
