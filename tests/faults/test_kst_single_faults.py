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
from tests.support.catalogue.kst import KINDS, Kind, KstRig
from tests.support.single_faults import suffer

LEFT_ALONE = 0.002
"""s after which a servo that was asked twice has said all that it has to say."""
AT_MOST = 1.5


def frames_of(kind: Kind) -> dict[Side, int]:
    """How many frames it has to each side when nothing goes wrong."""
    rig = KstRig(kind.profile, **kind.options)
    rig.put(line := FrameLine())
    kind.act(rig)
    return line.counts


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

    faults = list(every_fault(counts))
    faults = faults[: rounds(len(faults))]

    tally = suffer(
        KstRig(kind.profile, **kind.options),
        kind.act,
        faults,
        line_of=FrameLine,
        settle=settle,
        at_most=AT_MOST,
    )
    assert tally.faults == sum(counts.values()) * (2 + len(LATE)) > 0
    late = sum(fault.seconds == max(LATE) for fault in faults)
    if kind.sure:
        assert tally.succeeded >= tally.faults - late, (
            "what may be said again gets over any but the longest wait"
        )
    figures(f"L1 L2 single frame faults, {name}", family="kst", **tally.told)
