"""Rows L3 and L7 on the stepper controller, 10^6 times: no false acknowledgement, no stale one, no false value.

Its replies have no checksum, so what could be believed wrongly is everything; each acknowledgement is held against what
reached the controller during that very call, and against what it then did.
"""

from __future__ import annotations

from math import log, log1p

import pytest

from motorbus.core.operation import Data
from motorbus.link.base import Delivery, Side
from tests.conftest import Figures, Rounds
from tests.families.stepper.fault_rig import FalseWord, Rig
from tests.families.stepper.mischief import Mischief
from tests.families.stepper.test_faults import Ledger
from tests.faults.chance import poisson_line

SHARE = 0.01
CALLS = 700_000
"""So many calls have 10^6 exchanges and more."""


class Spoilt(Mischief):
    """Of all bytes toward the host this share becomes another one."""

    def __init__(self, seed: int, share: float) -> None:
        super().__init__(seed, share)
        self._left = self._gap()

    def _gap(self) -> int:
        return int(log(1 - self.random.random()) / log1p(-self.share))

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.DEVICE:
            while self._left < len(data):
                data = self._struck(data, self._left, self.random.randrange(1, 256))
                self.fired["byte"] += 1
                self.last = at
                self._left += 1 + self._gap()
            self._left -= len(data)
        return super().carry(sender, data, at)


class Late(Mischief):
    """Of all replies this share is late, and holds up what comes behind it."""

    def __init__(self, seed: int, share: float) -> None:
        super().__init__(seed, share, "late")


class Asked(Rig):
    """As `Rig`; a dump has no checksum, so those that came through wrong are counted apart, as are all of them."""

    dumps = false_dumps = 0

    def dump(self) -> bool:
        """A project, as the driver reads it."""
        self.dumps += 1
        try:
            return super().dump()
        except FalseWord:
            self.false_dumps += 1
            return True


def expected_dumps(dumps: int) -> float:
    """So many dumps pass wrong where one byte in a hundred is another one: two of three readings have one byte of the
    220 changed alike."""
    return dumps * 220 * 3 * SHARE**2 / 255


def suffered(line: Mischief, total: int) -> tuple[Ledger, Asked]:
    """So many calls, drawn by lot among everything a host asks of a controller. FalseWord for what is not so."""
    rig = Asked(line, 12)
    ledger = Ledger(rig, line)
    rig.open()
    for _ in range(total):
        ledger.call()
    assert (ledger.failed_untouched, ledger.again_untouched) == (0, 0)
    assert line.count > total * SHARE / 4
    return ledger, rig


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("row", "promise", "kind"), [("L3", 2, Spoilt), ("L7", 3, Late)])
def test_l3_l7_nothing_false_is_told(
    row: str, promise: int, kind: type[Spoilt | Late], rounds: Rounds, figures: Figures
) -> None:
    total = rounds(CALLS, 800)
    line = kind(31, SHARE)
    _, rig = suffered(line, total)
    right = sum(rig.right.values())
    exchanges = sum(one.sent for one in rig.bus.statistics.nodes.values())
    assert total < CALLS or exchanges >= 1_000_000
    figures(
        "L3 1 % of bytes toward the host changed" if row == "L3" else "L7 late replies",
        family="stepper", promise=promise, seed=31, calls=total,
        exchanges=exchanges, faults=line.count, false=0,
        single_levels_wrong=rig.levels, succeeded=right, untouched_failed=0, untouched_again=0,
        longest_s=round(rig.longest, 2),
    )  # fmt: skip
    assert right > 0.8 * total
    assert rig.false_dumps <= (poisson_line(expected_dumps(rig.dumps)) if row == "L3" else 0)
