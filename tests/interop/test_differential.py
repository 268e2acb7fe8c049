"""The same streams through other people's codecs and through ours: every difference has a name and a reason."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from scripts import differential
from tests.conftest import Figures
from tests.interop.differential import judging, ours, outside, sdo_judging, streams, table
from tests.interop.differential.cases import Case, Outcome, Request
from tests.interop.differential.notes import GROUP, NOTES, READ, REQUEST_NOTES, SDO_NOTES
from tests.interop.differential.outside import CANOPEN, FEETECH, NEW, OLD, RUST, Decoder

SEED = 20
EXPLAINED = NOTES.keys() | SDO_NOTES.keys()
BY = {OLD: "old", NEW: "new", RUST: "rust", CANOPEN: "canopen"}


def drawn(rounds: Callable[[int], int], full: int) -> int:
    """The full count in the soak, else a tenth of the usual one."""
    return full if rounds(full) == full else 1_000


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("decoder", FEETECH, ids=BY.__getitem__)
def test_no_difference_of_a_stream_is_without_a_name(
    decoder: Decoder, rounds: Callable[[int], int], figures: Figures
) -> None:
    """rustypot waits for real time, so it gets a fifth of the others' streams."""
    found = table.feetech(decoder, table.usual(SEED, drawn(rounds, 20_000 if decoder is RUST else 100_000)))
    told(figures, decoder, found)
    assert found.unexplained == []
    assert set(found.counts) == {name for name, note in NOTES.items() if decoder in note.decoders}


@pytest.mark.timeout(1800)
def test_no_difference_of_an_sdo_stream_is_without_a_name(
    rounds: Callable[[int], int], figures: Figures
) -> None:
    found = table.sdo(table.usual_sdo(SEED, drawn(rounds, 100_000)))
    told(figures, CANOPEN, found)
    assert found.unexplained == []
    assert set(found.counts) == set(SDO_NOTES)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("decoder", table.DECODERS, ids=BY.__getitem__)
def test_the_same_request_is_the_same_bytes(decoder: Decoder, rounds: Callable[[int], int]) -> None:
    found = table.requests(decoder, SEED, drawn(rounds, 20_000))
    assert found.cases > 500
    assert found.unexplained == []
    assert set(found.counts) == {name for name, note in REQUEST_NOTES.items() if decoder in note.decoders}


def told(figures: Figures, decoder: Decoder, found: table.Found) -> None:
    figures(
        f"same streams through {decoder.name}",
        family="kst" if decoder is CANOPEN else "feetech",
        seed=SEED,
        streams=found.cases,
        differences=sum(found.counts.values()),
        unexplained=found.counts[judging.UNEXPLAINED],
        **{
            name.replace("-", " "): count for name, count in sorted(found.counts.items()) if name in EXPLAINED
        },
    )


def test_the_page_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["differential", "--check"])
    assert differential.main() == 0, "python -m scripts.differential makes it"


def test_what_is_not_current_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(differential, "page", lambda: "")
    monkeypatch.setattr("sys.argv", ["differential", "--check"])
    assert differential.main() == 1


@pytest.mark.parametrize("name", NOTES)
def test_an_example_shows_its_class_with_each_who_is_named(name: str) -> None:
    note = NOTES[name]
    made = ours.decoded(note.example)
    for decoder in FEETECH:
        (heard,) = outside.heard(decoder, [note.example], patience=outside.AT_EASE)
        found = judging.classes(decoder, note.example, made, heard.outcome)
        assert (name in found) == (decoder in note.decoders), decoder.name


@pytest.mark.parametrize("name", SDO_NOTES)
def test_an_example_of_sdo_shows_its_class(name: str) -> None:
    example = SDO_NOTES[name].example
    (heard,) = outside.heard(CANOPEN, [example])
    assert sdo_judging.classes(example, ours.sdo_decoded(example), heard.outcome) == {name}


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
