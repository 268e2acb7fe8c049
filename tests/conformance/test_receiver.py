"""What a receiver makes of good frames, bad frames and garbage; what `explain` says of them.

How much a receiver holds is measured from outside: every byte that goes in must come out in exactly one event, so
what is missing is what it holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Explanation, Family, Receiver
from motorbus.core.request import Data, Event, Noise, Notification, Reply
from tests.support.subjects import FAMILIES, Vector, line_of, payload, possible, vectors

MOST_HELD = 4096
HEAD = 6
"""Bytes that a reply without a checksum has at least: they tell how long it will be."""
JUNK = (b"\0", b"\xff", b"\xff\xff", b"\x55\xaa" * 5, bytes(range(32)), b"\xee" * 3)


def answers(events: Iterable[Event]) -> list[bytes]:
    return [event.data for event in events if isinstance(event, Reply | Notification)]


def fed(receiver: Receiver, pieces: Iterable[Data]) -> list[Event]:
    return [event for piece in pieces for event in receiver.feed(piece)] + receiver.flush()


def ways(data: Data) -> Iterator[Sequence[Data]]:
    """Whole, byte by byte, and cut once at every place; a CAN frame cannot be cut."""
    yield [data]
    if isinstance(data, bytes):
        yield [data[i : i + 1] for i in range(len(data))]
        yield from ([data[:i], data[i:]] for i in range(1, len(data)))


def noises(data: Data) -> Iterator[Data]:
    """What may precede a good frame: junk, and its own beginning."""
    if isinstance(data, CanFrame):
        yield CanFrame(0x7FF, b"", False)
        yield data._replace(extended=not data.extended)
        yield from (data._replace(data=data.data[:length]) for length in range(len(data.data)))
    else:
        yield from JUNK
        yield from (data[:length] for length in range(1, len(data)))


def test_vectors_of_both_directions_and_both_verdicts_exist(family: Family) -> None:
    found = vectors(family.name)
    assert {(v.direction, v.valid) for v in found} >= {("status", True), ("instruction", True)}
    assert False in {vector.valid for vector in found}
    assert [vector.id for vector in found if not vector.source] == []


def test_a_reply_is_told_apart_however_it_is_cut(family: Family, reply: Vector) -> None:
    for pieces in ways(reply.data):
        assert answers(fed(family.open().receiver(), pieces)) == [payload(reply.data)]


def test_a_bad_frame_is_no_reply_however_it_is_cut(family: Family, bad: Vector) -> None:
    for pieces in ways(bad.data):
        assert answers(fed(family.open().receiver(), pieces)) == []


def test_a_reply_is_found_behind_noise_and_before_it(family: Family, reply: Vector) -> None:
    for noise in noises(reply.data):
        for pieces in ([noise, reply.data], [reply.data, noise]):
            receiver = family.open().receiver()
            before = [] if line_of(family).checksum else apart(receiver, pieces, reply.data)
            assert answers([*before, *fed(receiver, pieces)]) == [payload(reply.data)]


def apart(receiver: Receiver, pieces: list[Data], whole: Data) -> list[Event]:
    """Where only its length tells a reply, one that was cut off is told from the next by the pause between them.

    So what has a whole head, in front of the reply that it is the beginning of, is fed and flushed before.
    """
    first = pieces[0]
    cut = isinstance(first, bytes) and isinstance(whole, bytes) and whole[: len(first)] == first != whole
    return fed(receiver, [pieces.pop(0)]) if cut and len(first) >= HEAD else []


def test_a_vector_is_explained_and_a_bad_one_is_faulted(family: Family, vector: Vector) -> None:
    explained = family.open().decode(flat(vector.data))
    assert all_of(explained) == flat(vector.data)
    assert bool([one.fault for one in explained if one.fault]) is not vector.valid
    for one in explained:
        assert b"".join(part.data for part in sorted(one.parts, key=lambda part: part.start)) == one.data
        assert all(one.data[part.start : part.start + len(part.data)] == part.data for part in one.parts)
        assert one.title
        assert all(part.name for part in one.parts)


def flat(data: Data) -> bytes:
    return data if isinstance(data, bytes) else data.flat()


def all_of(explained: Iterable[Explanation]) -> bytes:
    return b"".join(one.data for one in explained)


def heard(family: Family, *pieces: tuple[Data, float]) -> list[tuple[float, Data]]:
    """What simulated devices say within a second after they were told this."""
    simulator = family.simulator(possible(family, tuple(range(1, 11))))
    simulator.tune(family.link.rate)
    for piece, at in pieces:
        simulator.receive(piece, at)
    return simulator.advance(3.0)


def test_the_simulator_hears_a_request_however_it_is_cut(family: Family, request_: Vector) -> None:
    whole = heard(family, (request_.data, 2.0))
    for pieces in ways(request_.data):
        assert heard(family, *((piece, 2.0) for piece in pieces)) == whole
    for noise in noises(request_.data):  # whatever it made of that is over a second later
        assert [one for one in heard(family, (noise, 1.0), (request_.data, 2.0)) if one[0] >= 2.0] == whole
    assert request_.valid or whole == []


def test_the_simulator_answers_in_frames_that_the_receiver_takes(family: Family) -> None:
    answered = 0
    for vector in vectors(family.name):
        said = heard(family, (vector.data, 1.0))
        events = fed(family.open().receiver(), [data for _, data in said])
        assert [event for event in events if isinstance(event, Noise)] == []
        answered += bool(events)
    assert answered


def wrong_frames(data: Data) -> Iterator[Data]:
    """Every frame that differs in one byte. In CAN the controller checks the data; but the length may be wrong."""
    if isinstance(data, CanFrame):
        yield from (data._replace(data=data.data[:length]) for length in range(len(data.data)))
        yield data._replace(extended=not data.extended)
    else:
        for place, old in enumerate(data):
            yield from (data[:place] + bytes((b,)) + data[place + 1 :] for b in range(256) if b != old)


def test_a_wrong_frame_is_never_taken_for_a_good_one(family: Family, checked_reply: Vector) -> None:
    for wrong in wrong_frames(checked_reply.data):
        got = answers(fed(family.open().receiver(), [wrong]))
        assert [data for data in got if len(data) == len(payload(checked_reply.data))] == []


# --- garbage ------------------------------------------------------------------------------------------------

frames = st.builds(
    CanFrame,
    st.one_of(st.integers(0, 0x7FF), st.integers(0, 0x1FFF_FFFF)),
    st.binary(max_size=8),
    st.booleans(),
)
deliveries: dict[str, st.SearchStrategy[Data]] = {"bytes": st.binary(max_size=700), "frames": frames}


def judged(receiver: Receiver, pieces: Iterable[Data]) -> None:
    """Feed it all; nothing may raise, too much may not be held, and no byte may vanish or be invented."""
    taken = told = 0
    for piece in pieces:
        taken += len(payload(piece))
        told += sum(len(event.data) for event in receiver.feed(piece))
        assert 0 <= taken - told <= MOST_HELD
    told += sum(len(event.data) for event in receiver.flush())
    assert taken == told
    assert receiver.flush() == []


@given(data=st.data())
def test_frames_among_garbage_are_never_hoarded(family: Family, data: st.DataObject) -> None:
    known = st.sampled_from([vector.data for vector in vectors(family.name)])
    judged(
        family.open().receiver(),
        data.draw(st.lists(st.one_of(deliveries[family.link.kind], known), max_size=30)),
    )


@pytest.mark.parametrize("run", [b"\0", b"\xff", b"\xff\xaa", b"\x55", "frames", "noise"], ids=repr)
def test_long_runs_of_garbage_are_never_hoarded(family: Family, run: bytes | str) -> None:
    random = Random(1)
    known = [vector.data for vector in vectors(family.name)]
    for size in (1, 7, 4096):
        pieces: list[Data] = []
        for _ in range(65536 // size if size > 1 else 8192):
            if run == "frames":
                piece = random.choice(known)
                pieces.append(piece[:-1] if isinstance(piece, bytes) else piece)
            else:
                piece = random.randbytes(size) if isinstance(run, str) else (run * size)[:size]
                pieces.append(piece if family.link.kind == "bytes" else CanFrame(0x281, piece[:8]))
        judged(family.open().receiver(), pieces)


@given(data=st.binary(max_size=300))
def test_what_is_of_the_wrong_kind_is_noise(family: Family, data: bytes) -> None:
    wrong: Data = data if family.link.kind == "frames" else CanFrame(0x123, data[:8])
    events = fed(family.open().receiver(), [wrong])
    assert answers(events) == []
    assert b"".join(event.data for event in events) == payload(wrong)


@given(data=st.binary(max_size=300))
def test_garbage_is_explained_to_the_last_byte(family: Family, data: bytes) -> None:
    assert all_of(family.open().decode(data)) == data


@given(data=st.data())
def test_a_simulator_survives_garbage(family: Family, data: st.DataObject) -> None:
    simulator = family.simulator(possible(family, (1, 2, 3)))
    simulator.tune(family.link.rate)
    at = 0.0
    for piece in data.draw(st.lists(deliveries[family.link.kind], max_size=10)):
        simulator.receive(piece, at)
        at += 0.01
        moments = [when for when, _ in simulator.advance(at)]
        assert moments == sorted(moments)
        assert all(moment <= at for moment in moments)


def test_there_is_more_than_one_family() -> None:
    assert {family.link.kind for family in FAMILIES.values()} == {"bytes", "frames"}
