"""Where python-canopen and motorbus differ on an SDO stream, and why: each difference has a class with a name, or none.

A refusal by the servo is an answer too, so an abort that only one of them takes is a difference.
"""

from __future__ import annotations

from motorbus.families.kst import sdo
from tests.interop.differential.cases import Frame, Outcome, SdoCase
from tests.interop.differential.judging import UNEXPLAINED


def classes(case: SdoCase, ours: Outcome, theirs: Outcome) -> set[str]:
    """The name of the difference between the two; empty where they agree."""
    mine, others = _answer(ours), _answer(theirs)
    if mine == others:
        return set()
    return {_class(case, mine, others)}


def _answer(outcome: Outcome) -> str | None:
    """Data, or a refusal; None where there was no answer that counts."""
    if outcome.taken:
        return f"data {outcome.value}"
    return outcome.why if outcome.why.startswith("abort") else None


def _class(case: SdoCase, mine: str | None, others: str | None) -> str:
    frames = [frame for step in case.steps for frame in step]
    several = any(len(step) > 1 for step in case.steps)
    if others is not None and any(_is_short(case, frame) for frame in frames):
        return "short-frame"
    if several and mine is not None:
        return "first-frame-counts"
    if several and others is not None:
        return "more-than-the-frame"
    if mine is None and others is not None:
        return _taken(case, frames, others)
    return UNEXPLAINED


def _is_short(case: SdoCase, frame: Frame) -> bool:
    identifier, data = frame
    return identifier == sdo.REPLY + case.request.node and len(data) < sdo.LENGTH


def _taken(case: SdoCase, frames: list[Frame], others: str) -> str:
    """They take the only frame that came, or a whole row of segments."""
    request, data = case.request, frames[0][1]
    about = (data[1] | data[2] << 8, data[3])
    if others.startswith("abort"):
        aborts = [one for _, one in frames if one[0] == 0x80]
        names = {(one[1] | one[2] << 8, one[3]) for one in aborts}
        return "abort-of-another" if names - {(request.index, request.subindex), (0, 0)} else UNEXPLAINED
    if request.kind == "download":
        other = about != (request.index, request.subindex) or (data[0] & 0xE0 == 0x60 and data[0] != 0x60)
        return "acknowledgement-of-another" if other else UNEXPLAINED
    first = sdo.decode_reply(data)
    segments = [sdo.decode_reply(one) for _, one in frames[1:]]
    ends = [place for place, one in enumerate(segments) if one is not None and one.last]
    segments = segments[: ends[0] + 1] if ends else segments
    sizes = [len(one.data) for one in segments if one is not None]
    if first is None or first.kind != "upload-start":
        return UNEXPLAINED
    empty = any(one is not None and not one.data and not one.last for one in segments)
    return "announced-size" if empty or first.size != sum(sizes) else UNEXPLAINED
