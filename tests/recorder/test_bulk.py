"""A recording taken apart at once is what a `Decoder` makes of it, whatever it holds and however it was cut.

Streams are made of what is known of each family, whole, damaged and cut off, and of bytes that mean nothing.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from copy import deepcopy
from itertools import pairwise
from math import inf, nan
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus.core.capture import PIECE, WAYS, Packet
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import MotorbusError, RequestError
from motorbus.recorder import Decoder, decode
from motorbus.recorder.bulk import can_decode
from motorbus.recorder.heard import captures_of
from tests.conformance.subjects import FAMILIES, vectors

BYTES = sorted(name for name, family in FAMILIES.items() if family.link.kind == "bytes")
FRAMES = sorted(name for name, family in FAMILIES.items() if family.link.kind == "frames")

HEADS = (b"\xff", b"\xff\xff", b"\xff\xff\xff\xff", b"\xff\xaa", b"\xee", b"\xee\xdd", b"\xfd")


def known(name: str) -> list[Data]:
    return [vector.data for vector in vectors(name)]


def damaged(data: bytes, at: int, to: int) -> bytes:
    return data[: at % len(data)] + bytes((to,)) + data[at % len(data) + 1 :]


def short(data: bytes, end: int) -> bytes:
    return data[: end % len(data)]


@st.composite
def lines(draw: st.DrawFn, name: str) -> bytes:
    """What may stand in a recording of a serial line of this family."""
    whole = st.sampled_from([data for data in known(name) if isinstance(data, bytes)])
    place = st.integers(0, 300)
    bad = st.one_of(st.builds(damaged, whole, place, st.integers(0, 255)), st.builds(short, whole, place))
    heads = st.sampled_from(HEADS)
    some = st.one_of(whole, whole, bad, heads, st.binary(max_size=12))
    return b"".join(draw(st.lists(some, max_size=12)))


def fed(name: str, way: str, pieces: Sequence[Data]) -> list[Packet]:
    decoder = Decoder(FAMILIES[name], way)
    return [*(packet for piece in pieces for packet in decoder.feed(piece)), *decoder.flush()]


def cut(data: bytes, places: list[int]) -> list[bytes]:
    ends = [0, *sorted(place % (len(data) + 1) for place in places), len(data)]
    return [data[start:end] for start, end in pairwise(ends)]


@pytest.mark.parametrize("name", BYTES)
@given(way=st.sampled_from(WAYS), data=st.data())
def test_all_at_once_is_as_piece_by_piece(name: str, way: str, data: st.DataObject) -> None:
    line = data.draw(lines(name))
    at_once = list(decode(FAMILIES[name], line, way))
    assert b"".join(packet.data for packet in at_once) == line
    assert fed(name, way, [line]) == at_once
    assert fed(name, way, cut(line, data.draw(st.lists(st.integers(0, 1000), max_size=9)))) == at_once
    assert fed(name, way, [line[at : at + 1] for at in range(len(line))]) == at_once


@st.composite
def buses(draw: st.DrawFn, name: str) -> list[CanFrame]:
    """What may stand in a recording of a CAN bus of this family."""
    whole = [data for data in known(name) if isinstance(data, CanFrame)]
    identifiers = st.one_of(
        st.sampled_from([frame.id for frame in whole]),
        st.integers(0, 0x7FF),
        st.integers(0, 0x7FFF_FFFF),
    )
    datas = st.one_of(st.sampled_from([frame.data for frame in whole]), st.binary(max_size=8))
    other = st.builds(CanFrame, identifiers, datas, st.booleans())
    return draw(st.lists(st.one_of(st.sampled_from(whole), other), max_size=20))


@pytest.mark.parametrize("name", FRAMES)
@given(data=st.data())
def test_all_frames_at_once_are_as_one_by_one(name: str, data: st.DataObject) -> None:
    bus = data.draw(buses(name))
    assert list(decode(FAMILIES[name], bus)) == fed(name, "", bus)
    assert [packet.start for packet in fed(name, "", bus)] == list(range(len(bus)))
    assert [packet.data for packet in fed(name, "", bus)] == [frame.flat() for frame in bus]


@pytest.mark.parametrize("name", BYTES)
def test_much_at_once(name: str, rounds: Callable[[int], int]) -> None:
    """Enough to be taken in tiles, with long runs of noise; cut where it hurts and where it does not."""
    chance = Random(20260115)
    choice = [data for data in known(name) if isinstance(data, bytes)]
    for _ in range(rounds(100_000) // 1000):
        parts = chance.choices(
            [*choice, b"\xff", b"\xff\xff", b"\x00" * PIECE, b"\xee"], k=chance.randrange(120)
        )
        line = b"".join(parts) + chance.randbytes(chance.randrange(40))
        for way in WAYS:
            at_once = list(decode(FAMILIES[name], line, way))
            for size in (300, 1777, len(line) + 1):
                assert fed(name, way, [line[at : at + size] for at in range(0, len(line), size)]) == at_once
            assert max((len(packet.data) for packet in at_once if packet.fault), default=0) <= PIECE


def test_columns_are_arrays_and_a_packet_is_one_row() -> None:
    line = bytes.fromhex("ff ff 01 04 00 18 05 dd 00 ff ff 02 02 20 db")
    found = decode("feetech", line, "rx")
    assert found.start.tolist() == [0, 8, 9]
    assert found.size.tolist() == [8, 1, 6]
    assert found.node.tolist() == [1, -1, 2]
    assert found.code.tolist() == [0, -1, 0x20]
    assert found.kind.tolist() == [2, 0, 2]
    assert found.fault.tolist() == [0, 2, 0]
    assert found.data == [line[:8], line[8:9], line[9:]]
    assert found.at is None
    assert found[-1] == Packet(9, line[9:], "reply", 2, 0x20, "", None)
    assert found[1:] == [found[1], found[2]]
    assert repr(found) == "<Packets: 3, of which 1 are noise>"
    with pytest.raises(IndexError):
        _ = found[3]


@pytest.mark.parametrize("name", [*BYTES, *FRAMES])
def test_numbers_have_room(name: str) -> None:
    """What is reckoned with them does not wrap, whether there is noise or not."""
    frame = next(vector.data for vector in vectors(name) if vector.valid)
    for stray in (False, True):
        line = (
            frame + b"\x00" * stray
            if isinstance(frame, bytes)
            else [frame, CanFrame(0x7FF, b"")][: 1 + stray]
        )
        found = decode(FAMILIES[name], line)
        columns = (found.start, found.size, found.kind, found.node, found.code, found.fault)
        assert {str(column.dtype) for column in columns} == {"int64"}


def test_frames_may_have_times() -> None:
    bus = [CanFrame(0x625, bytes.fromhex("4003600000000000")), CanFrame(0x123, b"")]
    found = decode("kst", bus, at=[1.5, 2.25])
    assert [packet.at for packet in found] == [1.5, 2.25]
    assert found.at.tolist() == [1.5, 2.25]
    assert found[0][2:6] == ("request", 0x25, 0x40_6003_00, "")
    assert found[1][2:6] == ("noise", -1, -1, "foreign")


@pytest.mark.parametrize("name", [*BYTES, *FRAMES])
def test_nothing_holds_nothing(name: str) -> None:
    found = decode(FAMILIES[name], b"" if name in BYTES else [])
    assert (len(found), list(found), found.node.tolist()) == (0, [], [])
    bulk = captures_of(FAMILIES[name]).bulk
    if bulk is not None and name in BYTES:
        assert [len(column) for column in bulk(np, b"", "")] == [0] * 6


@pytest.mark.parametrize(
    ("name", "recording", "way"),
    [
        ("nobody", b"", ""),
        ("feetech", b"", "up"),
        ("feetech", [CanFrame(1, b"")], ""),
        ("kst", b"\xff", ""),
        ("kst", [b"\xff"], ""),
        ("kst", None, ""),
        ("kst", 5, ""),
        ("kst", "", ""),
        ("kst", b"", ""),
        ("kst", CanFrame(1, b""), ""),
        ("kst", (CanFrame(1, b"") for _ in range(3)), ""),
        ("feetech", None, ""),
        (None, b"", ""),
        (5, b"", ""),
        ([], b"", ""),
        (motorbus.feetech, b"", ""),
    ],
)
def test_what_is_no_recording_is_refused(name: Any, recording: Any, way: str) -> None:
    with pytest.raises(RequestError):
        decode(name, recording, way)


def test_bytes_may_be_any_buffer() -> None:
    line = bytes.fromhex("ff ff 01 02 00 fc")
    assert list(decode("feetech", memoryview(line))) == list(decode("feetech", bytearray(line)))  # type: ignore[arg-type]


def test_numpy_is_named_when_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert can_decode()
    monkeypatch.setitem(sys.modules, "numpy", None)
    with pytest.raises(MotorbusError, match=r"numpy is not installed.*\n.*motorbus\[numpy\]"):
        decode("feetech", b"\xff")
    assert not can_decode()


def test_numpy_is_loaded_when_it_is_needed() -> None:
    code = (
        "import sys; from motorbus.recorder import Decoder, decode; Decoder('feetech').feed(b'x' * 9999); "
        "assert 'numpy' not in sys.modules; decode('feetech', b'x'); assert 'numpy' in sys.modules"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, timeout=60)


@pytest.mark.parametrize("name", BYTES)
@given(data=st.data())
def test_each_byte_may_have_its_time(name: str, data: st.DataObject) -> None:
    """A packet has that of its first, as when each byte is fed by itself."""
    line = data.draw(lines(name))
    times = [0.5 + place / 4 for place in range(len(line))]
    decoder = Decoder(FAMILIES[name])
    one_by_one = [
        packet for place, at in enumerate(times) for packet in decoder.feed(line[place : place + 1], at)
    ]
    one_by_one += decoder.flush()
    found = decode(FAMILIES[name], line, at=times)
    assert list(found) == one_by_one
    assert [packet.at for packet in found] == [times[packet.start] for packet in found]


@pytest.mark.parametrize("name", FRAMES)
@given(data=st.data())
def test_each_frame_may_have_its_time(name: str, data: st.DataObject) -> None:
    bus = data.draw(buses(name))
    times = [place / 4 for place in range(len(bus))]
    decoder = Decoder(FAMILIES[name])
    one_by_one = [packet for frame, at in zip(bus, times, strict=True) for packet in decoder.feed(frame, at)]
    assert list(decode(FAMILIES[name], deque(bus), at=times)) == [*one_by_one, *decoder.flush()]


PING = bytes.fromhex("ff ff 01 02 01 fb")


@pytest.mark.parametrize("at", [[], [1.0], [1.0, 2.0], [1.0] * 4, np.ones(5)], ids=len)
def test_times_are_as_many_as_what_they_belong_to(at: Any) -> None:
    bus = [CanFrame(0x601, b"")] * 3
    with pytest.raises(RequestError, match=f"{len(at)} times for 3 frames"):
        decode("kst", bus, at=at)
    with pytest.raises(RequestError, match=f"{len(at)} times for 12 bytes"):
        decode("feetech", PING * 2, at=at)


@pytest.mark.parametrize("wrong", ["x", "1.5", None, nan, inf, -inf, True, 1j, 10**400, [1.0], b"1"])
def test_a_time_is_a_finite_number_all_at_once_and_piece_by_piece(wrong: Any) -> None:
    frame = CanFrame(0x601, b"")
    for at in ([wrong], [1.0, wrong], (wrong, wrong)):
        with pytest.raises(RequestError, match="at: .* is no "):
            decode("kst", [frame] * len(at), at=at)
    decoder = Decoder("kst")
    if wrong is not None:  # for a piece it says that nothing was noted
        with pytest.raises(RequestError, match="at: .* is no time"):
            decoder.feed(frame, wrong)
        assert decoder.rest() == []


@pytest.mark.parametrize("at", ["x", 1.0, {0: 1.0}, iter([1.0]), [[1.0], [2.0]], [[1.0], 2.0]])
def test_what_is_no_row_of_times_is_refused(at: Any) -> None:
    with pytest.raises(RequestError, match="is no row of times"):
        decode("kst", [CanFrame(0x601, b"")], at=at)


@pytest.mark.parametrize("kind", [np.int64, np.float32, float, int])
def test_times_may_be_numbers_of_any_kind(kind: Any) -> None:
    bus, times = [CanFrame(0x601, b"")] * 2, np.array([1, 2], kind)
    decoder = Decoder("kst")
    fed = [packet for frame, at in zip(bus, times, strict=True) for packet in decoder.feed(frame, at)]
    assert [packet.at for packet in fed] == [packet.at for packet in decode("kst", bus, at=times)] == [1, 2]  # type: ignore[arg-type]
    assert [packet.at for packet in decode("kst", bus, at=list(times))] == [1, 2]


@pytest.mark.parametrize("copied", [lambda one: pickle.loads(pickle.dumps(one)), deepcopy])
@pytest.mark.parametrize("looked_at", [False, True])
def test_what_is_decoded_can_be_sent_to_another_process(
    copied: Callable[[Any], Any], looked_at: bool
) -> None:
    recording = bytes.fromhex("FF FF 01 02 01 FB 55 FF FF 01 02 00 FC") * 100
    packets = decode(FAMILIES["feetech"], recording, at=[float(n) for n in range(len(recording))])
    if looked_at:
        assert len(packets.data) == len(packets)
    again = copied(packets)
    for name in ("start", "size", "kind", "node", "code", "fault", "at"):
        assert (getattr(again, name) == getattr(packets, name)).all(), name
    assert again.data == packets.data
    assert list(again) == list(packets)
