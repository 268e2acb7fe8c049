"""Accepted differences: with whom each comes up, and why motorbus decides otherwise."""

from __future__ import annotations

from typing import Final

from tests.interop.differential.outside import FEETECH, NEW, OLD, RUST, Decoder

STREAMS: Final[dict[str, tuple[Decoder, ...]]] = {
    "more-than-the-answer": FEETECH,  # bytes behind an answer: one of two is not to this question
    "other-length": FEETECH,  # the length belongs to the answer
    "echo": FEETECH,  # the echo of a request is a valid packet
    "error-above-0x7f": (OLD, NEW),  # bit 7 is undefined; the data count
    "false-beginning": (OLD, NEW),  # a good packet inside a damaged one is found
    "something-in-front": (RUST,),  # noise in front is passed over
    "first-silent": (OLD,),  # replies are collected by id
    "out-of-order": (OLD,),  # replies are collected by id
    "all-or-none": (RUST,),  # each silent servo is reported, the others have values
    "counted-bytes": (NEW,),  # a packet is found by its contents, not its place
}
REQUESTS: Final[dict[str, tuple[Decoder, ...]]] = {
    "frame-of-250": (OLD, NEW),  # the length byte allows 259 bytes
}
