"""A family that says nothing of its recordings has them taken apart as its receiver hears them."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import Packet
from motorbus.core.request import Data
from motorbus.families.stepper import wire
from motorbus.recorder import Decoder, decode
from motorbus.recorder.heard import ByReceiver, captures_of
from tests.support.subjects import FAMILIES

TEMPLATE = FAMILIES["template"]


def test_every_built_in_family_says_how() -> None:
    for name in ("feetech", "kst", "stepper"):
        captures = captures_of(FAMILIES[name])
        assert captures is FAMILIES[name].link.captures
        assert captures.code


def test_the_template_does_not() -> None:
    assert TEMPLATE.link.captures is None
    report = CanFrame(0x281, bytes((1, 0, 0, 1, 0)))
    answer = CanFrame(0x282, bytes((0x81, 4, 0, 0, 0, 0, 0, 9)))
    other = CanFrame(0x7FF, b"")
    told = [
        Packet(0, report.flat(), "notice", 1, -1, "", None),
        Packet(1, answer.flat(), "reply", 2, -1, "", None),
        Packet(2, other.flat(), "noise", -1, -1, "foreign", None),
    ]
    decoder = Decoder(TEMPLATE)
    assert [packet for frame in (report, answer, other) for packet in decoder.feed(frame)] == told
    assert list(decode(TEMPLATE, [report, answer, other])) == told


@pytest.mark.parametrize("cuts", [1, 4, 100])
def test_a_line_of_bytes_is_heard_as_by_a_host(cuts: int) -> None:
    line = bytes.fromhex("ff aa 5e 00 00 00 11 ee dd ff aa 03 0a")
    cutter = ByReceiver(FAMILIES["stepper"])
    found: list[tuple[bytes, int, int]] = []
    noise: list[tuple[bytes, str]] = []
    pieces: list[Data] = [line[at : at + cuts] for at in range(0, len(line), cuts)]
    for runs in (*map(cutter.feed, pieces), cutter.flush()):
        for run in runs:
            if isinstance(run, list):
                kinds, nodes, _ = cutter.tell(run)()
                found += zip(run, kinds, nodes, strict=True)
            else:
                noise.append((run.data, run.fault))
    assert found == [(line[:6], 2, -1), (wire.NOTICE, 4, 1)]
    assert noise == [(b"\x11", "framing"), (line[9:], "framing")]
