"""Rows L3 and L7 on the stepper controller, 10^6 times: no false acknowledgement, no stale one, no false value.

Its replies have no checksum, so what could be believed wrongly is everything; each acknowledgement is held against what
reached the controller during that very call, and against what it then did. Of the dumps nearly every single one is
damaged, which is told apart. A project as the driver reads it is wrong where two dumps came wrong in the same way: one
in a million at this rate, reckoned and held against what happened; none where replies are only late.
"""

from __future__ import annotations

from math import log, log1p

import pytest

from motorbus.core.operation import Data
from motorbus.families.stepper import wire
from motorbus.link.base import Delivery, Side
from tests.conftest import Figures, Rounds
from tests.support.lines import Mischief
from tests.support.rigs.stepper import Rig

SHARE = 0.01
DOUBLES = 3
"""Projects that may come wrong: 0.04 are to be expected, and four or more in one of eight million such runs."""
CALLS = {"L3": 580_000, "L7": 700_000}
"""So many calls have 10^6 exchanges and more; where bytes are changed, dumps are read five times and not twice."""


class Ledger:
    """How many calls went how, and how many of those that no fault touched did not go at once."""

    def __init__(self, rig: Rig, line: Mischief) -> None:
        self.rig = rig
        self.line = line
        self.failed_untouched = 0
        self.again_untouched = 0
        self.last: list[tuple[bool, bool]] = []

    def call(self) -> None:
        """One more."""
        faults, again = self.line.count, self.rig.tried_again
        waits = any(at > self.rig.link.now() + 1e-6 for at, *_ in self.rig.link._under_way)
        done = self.rig.anything()
        touched = waits or self.line.count > faults
        if not touched:
            self.failed_untouched += not done
            self.again_untouched += self.rig.tried_again > again


class Spoilt(Mischief):
    """Of all bytes toward the host this share becomes another one. How many `dumps`, and with `wrong` images?"""

    def __init__(self, seed: int, share: float) -> None:
        super().__init__(seed, share)
        self._left = self._gap()
        self.dumps = self.wrong = 0

    def _gap(self) -> int:
        return int(log(1 - self.random.random()) / log1p(-self.share))

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.DEVICE:
            before = data
            while self._left < len(data):
                data = self._struck(data, self._left, self.random.randrange(1, 256))
                self.fired["byte"] += 1
                self.last = at
                self._left += 1 + self._gap()
            self._left -= len(data)
            if len(data) == wire.DUMP_LENGTH:
                self.dumps += 1
                self.wrong += data[wire.REPLY_LENGTH :] != before[wire.REPLY_LENGTH :]
        return super().carry(sender, data, at)


class Late(Mischief):
    """Of all replies this share is late, and holds up what comes behind it."""

    def __init__(self, seed: int, share: float) -> None:
        super().__init__(seed, share, "late")


def expected_wrong(dumps: int) -> float:
    """So many of so many dumps read once have one of their 220 bytes changed, or more."""
    return dumps * (1 - (1 - SHARE) ** wire.IMAGE_LENGTH)


def expected_doubles(projects: int) -> float:
    """Of so many projects so many first two dumps are the same, and not what the controller holds."""
    same, right = (1 - SHARE) ** 2 + SHARE**2 / 255, (1 - SHARE) ** 2
    return projects * (same**wire.IMAGE_LENGTH - right**wire.IMAGE_LENGTH)


def suffered(line: Mischief, total: int) -> tuple[Rig, Ledger]:
    """So many calls, drawn by lot among everything a host asks of a controller. FalseWord for what is not so."""
    rig = Rig(line, 12)
    rig.doubles = 0 if isinstance(line, Spoilt) else None
    ledger = Ledger(rig, line)
    rig.open()
    for _ in range(total):
        ledger.call()
    assert (ledger.failed_untouched, ledger.again_untouched) == (0, 0)
    assert line.count > total * SHARE / 4
    return rig, ledger


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("row", "promise", "kind"), [("L3", 2, Spoilt), ("L7", 3, Late)])
def test_l3_l7_nothing_false_is_told(
    row: str, promise: int, kind: type[Spoilt | Late], rounds: Rounds, figures: Figures
) -> None:
    total = rounds(CALLS[row], 600)
    line = kind(31, SHARE)
    rig, ledger = suffered(line, total)
    right = sum(rig.right.values())
    exchanges = sum(one.sent for one in rig.bus.statistics.nodes.values())
    assert total < CALLS[row] or exchanges >= 1_000_000
    dumps: dict[str, float] = {}
    if isinstance(line, Spoilt):
        expected = expected_wrong(line.dumps)
        assert abs(line.wrong - expected) <= 4 * expected**0.5
        doubles, projects = rig.doubles or 0, rig.right["dump"] + rig.failed["dump"]
        assert doubles <= DOUBLES
        dumps = {
            "dumps": line.dumps, "dumps_wrong": line.wrong, "dumps_wrong_expected": round(expected),
            "projects": projects, "projects_wrong": doubles,
            "projects_wrong_expected": round(expected_doubles(projects), 3),
        }  # fmt: skip
    figures(
        "L3 1 % of bytes toward the host changed" if row == "L3" else "L7 late replies",
        family="stepper", seed=31, calls=total,
        exchanges=exchanges, faults=line.count,
        single_levels_wrong=rig.levels, succeeded=right,
        untouched_failed=ledger.failed_untouched, untouched_again=ledger.again_untouched,
        longest_s=round(rig.longest, 2), **dumps,
    )  # fmt: skip
    assert right > 0.8 * total
