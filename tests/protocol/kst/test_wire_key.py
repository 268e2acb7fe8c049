"""Which reply answers which request: kind, index and sub-index, and an abort as far as it says."""

from __future__ import annotations

import pickle
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.operation import CanFrame, Due, Reply
from motorbus.families.kst import wire
from motorbus.families.kst.wire import Key

OBJECTS = st.tuples(
    st.sampled_from([0, 0x1010, 0x6002, 0x6003, 0x0260, 0xFFFF]), st.sampled_from([0, 1, 2, 255])
)
KEYS = st.one_of(
    st.builds(lambda kind, of: Key(kind, *of), st.sampled_from(["upload", "download", "abort"]), OBJECTS),
    st.builds(lambda toggle: Key("segment", toggle=toggle), st.sampled_from([0, 1])),
)


def of_reply(frame: CanFrame) -> Key:
    (event,) = wire.FrameReceiver().feed(frame)
    assert isinstance(event, Reply)
    assert isinstance(event.key, Key)
    return event.key


def refused(index: int, subindex: int) -> Key:
    return of_reply(wire.encode_abort_reply(1, index, subindex, 0x0800_0000))


def test_what_is_due_is_eight_bytes_of_that_node() -> None:
    assert wire.upload_due(5, 0x6002) == Due(5, Key("upload", 0x6002), 8)
    assert wire.download_due(5, 0x1010, 1) == Due(5, Key("download", 0x1010, 1), 8)
    assert wire.segment_due(5, 1) == Due(5, Key("segment", toggle=1), 8)


def test_each_request_is_answered_by_its_own_kind_of_reply() -> None:
    assert of_reply(wire.encode_upload_reply(1, 0x6002, 0, b"\0\0")) == wire.upload_due(1, 0x6002).key
    assert of_reply(wire.encode_upload_start(1, 0x100A, 0, 9)) == wire.upload_due(1, 0x100A).key
    assert of_reply(wire.encode_download_reply(1, 0x1010, 1)) == wire.download_due(1, 0x1010, 1).key
    for toggle in (0, 1):
        assert of_reply(wire.encode_segment_reply(1, toggle, b"x", True)) == wire.segment_due(1, toggle).key


def test_no_two_requests_share_a_key() -> None:
    objects = [*product((0, 0x6002, 0x6003, 0x0260), (0, 1))]
    keys = [Key(kind, *of) for kind, of in product(("upload", "download"), objects)]
    keys += [Key("segment", toggle=toggle) for toggle in (0, 1)]
    for (here, one), (there, other) in product(enumerate(keys), enumerate(keys)):
        assert (one == other) is (here == there)


@pytest.mark.parametrize("kind", ["upload", "download"])
def test_an_abort_answers_as_far_as_it_says(kind: str) -> None:
    assert refused(0x1010, 1) == Key(kind, 0x1010, 1)
    assert refused(0x1010, 1) != Key(kind, 0x1010, 2)
    assert refused(0x1010, 1) != Key(kind, 0x1011, 1)
    assert refused(0x1010, 0) == Key(kind, 0x1010, 1)
    assert refused(0x1010, 0) != Key(kind, 0x1011, 0)
    assert refused(0, 0) == Key(kind, 0x1010, 1)
    assert refused(0, 1) != Key(kind, 0x1010, 1)


@pytest.mark.parametrize("subindex", [0, 1])
@pytest.mark.parametrize("index", [0, 0x100A])
def test_every_abort_answers_a_segment(index: int, subindex: int) -> None:
    for toggle in (0, 1):
        assert refused(index, subindex) == Key("segment", toggle=toggle)


@given(KEYS, KEYS)
def test_equality_is_symmetric_and_agrees_with_the_hash(one: Key, other: Key) -> None:
    assert (one == other) is (other == one)
    assert (one != other) is not (one == other)
    assert one != other or hash(one) == hash(other)


@given(KEYS, KEYS)
def test_only_an_abort_equals_what_it_is_not(one: Key, other: Key) -> None:
    if one == other and "abort" not in (one.kind, other.kind):
        assert (one.kind, one.multiplexer, one.toggle) == (other.kind, other.multiplexer, other.toggle)


def test_a_dictionary_of_what_is_outstanding_finds_what_an_abort_refuses() -> None:
    due = wire.upload_due(1, 0x6002)
    outstanding = {(1, due.key, due.length): "asked"}
    assert outstanding.pop((1, refused(0x6002, 0), 8), None) == "asked"
    assert outstanding == {}


def test_a_key_is_plain_data() -> None:
    for key in (Key("upload", 0x6002), Key("segment", toggle=1)):
        assert pickle.loads(pickle.dumps(key)) == key
    assert repr(Key("download", 0x1010, 1)) == "<Key download 0x1010:1>"
    assert repr(Key("segment", toggle=1)) == "<Key segment 1>"
    assert Key("upload", 0x6002).multiplexer == wire.Multiplexer(0x6002, 0)
    assert Key("upload", 0x6002) != ("upload", 0x6002, 0)
