"""Rows L1 and L2 on CAN, where a byte of a frame cannot change: one frame lost, doubled, late or out of order.

Every exchange that there is with KST servos, each frame of it, in both directions.
"""

from __future__ import annotations

from contextlib import suppress

import pytest

from motorbus.errors import MotorbusError
from motorbus.link.base import Side
from tests.conftest import Figures, Rounds
from tests.faults.frames import LATE, FrameFault, FrameLine, every_fault
from tests.support.catalogue.kst import KINDS, NODE, Kind, KstRig, read_segments
from tests.support.single_faults import suffer
from tests.support.world import EQUAL_RUN

LEFT_ALONE = 0.002
"""s after which a servo that was asked twice has said all that it has to say."""
AT_MOST = 1.5


def frames_of(kind: Kind) -> dict[Side, int]:
    """How many frames it has to each side when nothing goes wrong."""
    rig = KstRig(kind.profile, **kind.options)
    rig.put(line := FrameLine())
    kind.act(rig)
    return line.counts


def _disordered(kind: Kind, fault: FrameFault) -> bool:
    """Would a request come behind one of a later call, to everyone, or amid the segments of another transfer?

    Frames of one identifier never do so on CAN; where that would only make an exchange fail, it is tried all the same.
    """
    if fault.kind != "swapped" or fault.to is Side.HOST:
        return False
    return kind.act is read_segments or not kind.alone


@pytest.mark.parametrize("name", KINDS)
def test_l1_l2_each_fault_of_each_frame_tells_nothing_false(
    name: str, rounds: Rounds, figures: Figures
) -> None:
    kind = KINDS[name]
    counts = frames_of(kind)

    def settle(rig: KstRig, fault: FrameFault) -> None:
        """The line goes on holding up what follows the frame, for a queue has an order."""
        if fault.seconds and kind.alone:
            with suppress(MotorbusError):
                kind.act(rig)
        rig.link.advance(fault.seconds or LEFT_ALONE)

    faults = [fault for fault in every_fault(counts) if not _disordered(kind, fault)]
    faults = faults[: rounds(len(faults))]

    tally = suffer(
        KstRig(kind.profile, **kind.options),
        kind.act,
        faults,
        line_of=FrameLine,
        settle=settle,
        at_most=AT_MOST,
    )
    assert tally.faults >= sum(counts.values()) * (2 + len(LATE)) > 0
    late = sum(fault.seconds == max(LATE) for fault in faults)
    if kind.sure:
        assert tally.succeeded >= tally.faults - late, (
            "what may be said again gets over any but the longest wait"
        )
    figures(f"L1 L2 single frame faults, {name}", family="kst", **tally.told)


@pytest.mark.parametrize("thinks", [0.0001, 0.001])
def test_a_request_that_can_doubles_is_the_known_limit(
    thinks: float, rounds: Rounds, figures: Figures
) -> None:
    """A servo that gets a question twice answers twice, and nothing tells the second answer from that to the next one.

    See docs/explanation/taint.md. It is over as soon as the servo is left alone for as long as an answer takes, or
    after 128 reads, for then it is probed.
    """
    rig = KstRig(turnaround=thinks)
    rig.put(line := FrameLine(FrameFault(Side.DEVICE, 0, "doubled")))
    wrong = 0
    for _ in range(rounds(2 * EQUAL_RUN)):
        wrong += rig.servo.read_raw("present_position") != {"present_position": rig.here}
        rig.stir()
    assert len(line.fired) == 1
    assert wrong <= EQUAL_RUN
    rig.link.advance(LEFT_ALONE)
    for _ in range(2 * EQUAL_RUN):
        rig.stir()
        assert rig.servo.read_raw("present_position") == {"present_position": rig.here}
    assert rig.servos[NODE].raw_position == rig.here
    figures(
        f"L7 reads behind a request that was doubled, answers one read old, of a servo that thinks {thinks * 1e3:g} ms",
        family="kst",
        wrong=wrong,
    )
