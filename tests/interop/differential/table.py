"""All cases of a run, judged: how often each class came up with whom, and what has no class."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

from tests.interop.differential import encoders, judging, ours, outside, streams
from tests.interop.differential.cases import Case, Outcome
from tests.interop.differential.outside import RUST, Decoder

SHOWN: Final = 5


class Found(NamedTuple):
    """`counts` by class; `unexplained` in words, the first few; `cases` how many there were."""

    counts: Counter[str]
    unexplained: list[str]
    cases: int


def feetech(decoder: Decoder, cases: Sequence[Case]) -> Found:
    """These streams, through this decoder and through ours."""
    mine = [case for case in cases if case.request.kind in decoder.kinds]
    made = [ours.decoded(case) for case in mine]
    heard = outside.heard_patiently(decoder, mine, [one.taken for one in made])
    names = [_names(decoder, *each) for each in zip(mine, made, heard, strict=True)]
    for place, found in enumerate(names):
        if decoder is RUST and judging.UNEXPLAINED in found:  # its terminal and its time are real: once more
            (heard[place],) = outside.heard(decoder, [mine[place]], patience=outside.AT_EASE)
            names[place] = _names(decoder, mine[place], made[place], heard[place])
    return _found(mine, made, [one.outcome for one in heard], names)


def _names(decoder: Decoder, case: Case, made: Outcome, heard: outside.Heard) -> set[str]:
    return judging.classes(decoder, case, made, heard.outcome) | encoders.classes(decoder, case, heard.sent)


def requests(decoder: Decoder, seed: int, count: int) -> Found:
    """So many requests by lot: the bytes that they send and ours."""
    cases = [case for case in encoders.requests(seed, count) if case.request.kind in decoder.kinds]
    sent = [one.sent for one in outside.heard(decoder, cases)]
    return _sent(cases, [encoders.classes(decoder, *each) for each in zip(cases, sent, strict=True)])


def usual(seed: int, count: int) -> list[Case]:
    """What was recorded with the first map, at every place of it; then so many by lot, of all maps."""
    return [*streams.systematic(streams.recorded()[:10]), *streams.recorded(), *streams.drawn(seed, count)]


def _found(
    cases: Sequence[Case],
    made: Sequence[Outcome],
    heard: Sequence[Outcome],
    names: Sequence[set[str]],
) -> Found:
    counts: Counter[str] = Counter()
    unexplained: list[str] = []
    for case, one, theirs, found in zip(cases, made, heard, names, strict=True):
        counts.update(found)
        if judging.UNEXPLAINED in found and len(unexplained) < SHOWN:
            unexplained.append(f"{case.line()} ({case.change}): ours {one}, theirs {theirs}")
    return Found(counts, unexplained, len(cases))


def _sent(cases: Sequence[Case], names: Sequence[set[str]]) -> Found:
    nothing = [Outcome(None)] * len(cases)
    return _found(cases, nothing, nothing, names)
