"""The same streams through other people's codecs and through ours: every difference has a name and a reason."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.interop.differential import judging, ours, streams, table
from tests.interop.differential.cases import Case, Outcome, Request
from tests.interop.differential.notes import REQUESTS, STREAMS
from tests.interop.differential.outside import FEETECH, NEW, OLD, RUST, Decoder

SEED = 20
READ = Request("read", 1, 56, 2)
GROUP = Request("sync_read", 254, 56, 2, nodes=(1, 2, 3))
BY = {OLD: "old", NEW: "new", RUST: "rust"}


def drawn(rounds: Callable[[int], int], full: int) -> int:
    """The full count in the soak, else a tenth of the usual one."""
    return full if rounds(full) == full else 1_000


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("decoder", FEETECH, ids=BY.__getitem__)
def test_no_difference_of_a_stream_is_without_a_name(decoder: Decoder, rounds: Callable[[int], int]) -> None:
    """rustypot waits for real time, so it gets a fifth of the others' streams."""
    found = table.feetech(decoder, table.usual(SEED, drawn(rounds, 20_000 if decoder is RUST else 100_000)))
    assert found.unexplained == []
    assert set(found.counts) == {name for name, those in STREAMS.items() if decoder in those}


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("decoder", FEETECH, ids=BY.__getitem__)
def test_the_same_request_is_the_same_bytes(decoder: Decoder, rounds: Callable[[int], int]) -> None:
    found = table.requests(decoder, SEED, drawn(rounds, 20_000))
    assert found.cases > 500
    assert found.unexplained == []
    assert set(found.counts) == {name for name, those in REQUESTS.items() if decoder in those}


@pytest.mark.timeout(1800)
def test_what_we_take_is_a_whole_packet_of_the_length_that_is_due(rounds: Callable[[int], int]) -> None:
    """By another way of finding packets than the one that is tested."""
    taken = 0
    for case in table.usual(SEED + 1, drawn(rounds, 100_000)):
        outcome, due = ours.decoded(case), case.request.due()
        if not outcome.taken:
            continue
        taken += 1
        there = {(one.node, one.end - one.at): one for one in judging.packets(case.stream)}
        values = (
            outcome.value if case.request.kind == "sync_read" else {str(case.request.node): outcome.value}
        )
        assert {(node, length) for node, length in due if str(node) in values} <= there.keys()
        assert len(values) == len([node for node, _ in due if str(node) in values])
    assert taken > 300


def test_a_difference_that_nobody_has_explained_is_found() -> None:
    """A decoder that takes what no packet says, one that loses a lone answer, and one that turns a value over."""
    good = next(case for case in streams.recorded() if case.request.kind == "read")
    value = ours.decoded(good)
    for wrong in (Outcome(None, "lost"), Outcome([[1, 2], 0])):
        for decoder in FEETECH:
            assert judging.classes(decoder, good, value, wrong) == {judging.UNEXPLAINED}
    assert judging.classes(OLD, Case(READ, b"", ""), Outcome(None, "silence"), value) == {judging.UNEXPLAINED}
    assert judging.classes(OLD, Case(GROUP, b"", ""), Outcome(None, "silence"), Outcome({"1": [0, 8]})) == {
        judging.UNEXPLAINED
    }
    assert judging.classes(NEW, good, value, value) == set()


def test_streams_are_of_all_six_maps_and_the_same_for_the_same_seed() -> None:
    assert len(streams.recorded()) == 56
    assert {case.request.kind for case in streams.recorded()} == {
        "ping",
        "read",
        "write",
        "reg_write",
        "sync_read",
    }
    assert list(streams.drawn(1, 50)) == list(streams.drawn(1, 50)) != list(streams.drawn(2, 50))
    assert Request("ping").packet() == bytes.fromhex("FFFF010201FB")
