"""Row D14: the text between an slcan adapter and the host has no checksum; each character of it, harmed each way.

A line that is no frame, or whose length disagrees, is dropped; what names another node or object is nobody's answer.
What is left is a digit of a value that becomes another digit, and a request that becomes another whole request. Both
are worked out beforehand from the form of a line, and found to be all there is.
"""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from motorbus.link.base import PerfectLine, Side
from motorbus.simulation.faults import Fault
from tests.conftest import Figures
from tests.faults.slcan_rig import VALUE, SlcanRig, another_frame, value_changed
from tests.support.catalogue.kst import KINDS
from tests.support.single_faults import EVERY, Overheard, Tally, every_fault, number_of, suffer

NAMES = ("ping", "read 2 bytes", "refused read", "write 1 byte that is kept", "save that is acknowledged")
ONE_EXCHANGE = (*NAMES, "read 1 byte", "read 4 bytes", "refused write", "write 1 byte", "save")
TELLING = tuple(b"8ft\r\x00")
ANSWER = 2
"""Characters of what an adapter answers to a frame that it is to send, z and CR, before the line of the reply."""


def lengths(name: str) -> dict[Side, int]:
    """How many characters an exchange has to each side."""
    rig = SlcanRig(KINDS[name].profile, **KINDS[name].options)
    rig.put(calm := Overheard(PerfectLine()))
    KINDS[name].act(rig)
    return {Side.HOST: len(calm.told), Side.DEVICE: len(calm.heard)}


def harmed(name: str, to: Side, faults: Iterable[Fault]) -> Tally:
    kind = KINDS[name]
    misleading = value_changed if to is Side.HOST else another_frame
    return suffer(
        SlcanRig(kind.profile, **kind.options), kind.act, faults, misleading=misleading, at_most=1.5
    )


@pytest.mark.parametrize("to", Side)
@pytest.mark.parametrize("name", NAMES)
def test_d14_a_harmed_character_is_seen_but_for_the_residual(name: str, to: Side) -> None:
    """Toward the host nothing false is told but another value; an acknowledgement has none."""
    length = lengths(name)[to]
    tally = harmed(name, to, every_fault(length, TELLING, to))
    assert tally.faults == number_of(length, len(TELLING))
    if to is Side.HOST and "read" not in name:
        assert tally.false == 0
    assert tally.succeeded > 0.95 * tally.faults, "and asked again it comes, for hardly any is believed"


def test_d14_a_digit_of_a_value_that_becomes_another_is_the_residual() -> None:
    """Of 255 other characters about 21 are digits of another value: all of them pass, and nothing else there."""
    places = [ANSWER + place for place in VALUE]
    changes = [
        Fault(1, place, "corrupt", Side.HOST, value=value) for place in places for value in EVERY[1:128]
    ]
    tally = harmed("read 2 bytes", Side.HOST, changes)
    assert tally.false == tally.misled
    assert 14 * len(places) <= tally.false <= 27 * len(places), (
        "which they are depends on the digit that was there"
    )


@pytest.mark.parametrize("place", [0, *range(ANSWER, ANSWER + VALUE.start), ANSWER + VALUE.stop + 4])
def test_d14_what_names_the_reply_cannot_change_unseen(place: int) -> None:
    """Letter, identifier, length, specifier, index and sub-index, and the end of the line."""
    changes = [Fault(1, place, "corrupt", Side.HOST, value=value) for value in EVERY[1::4]]
    tally = harmed("read 2 bytes", Side.HOST, changes)
    assert (tally.faults, tally.false) == (64, 0)


def test_d14_no_character_makes_an_acknowledgement_of_a_refusal() -> None:
    """Specifier 80 and 60 are one digit apart; but an acknowledgement has no code."""
    specifier = ANSWER + VALUE.start - 8
    changes = [Fault(1, specifier, "corrupt", Side.HOST, value=value) for value in EVERY[1:]]
    assert harmed("refused write", Side.HOST, changes).false == 0


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ONE_EXCHANGE)
def test_d14_every_harm_to_every_character(name: str, figures: Figures) -> None:
    """Of all that is said in one exchange; what needs several is made of such."""
    for to, length in lengths(name).items():
        if not length:
            continue
        tally = harmed(name, to, every_fault(length, EVERY, to))
        assert tally.faults == number_of(length)
        figures(f"D14 slcan text, {name}, toward the {to.value}", family="kst", **tally.told)
