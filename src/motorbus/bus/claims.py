"""Who waits to have the bus alone, and who has it.

An interrupt may fall between any two lines here, as everywhere on a bus. So a claim is granted by one assignment, which
may be done again and is taken back by one removal; there is no count that could be wrong by one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from motorbus.bus.ticket import Claim


class Claims:
    """The claims on one bus: `waiting` in order, and `held`, all of one owner."""

    def __init__(self) -> None:
        self.waiting: deque[Claim] = deque()
        self.held: dict[Claim, None] = {}

    def __bool__(self) -> bool:
        return bool(self.waiting or self.held)

    def ours(self, owner: object) -> bool:
        """Has this owner the bus alone?"""
        return any(claim.owner is owner for claim in self.held)

    def outside(self) -> list[Claim]:
        """Those that wait and are not of the one who has it."""
        return [claim for claim in self.waiting if not self.ours(claim.owner)]

    def grant(self, free: bool, settle: Callable[[Claim], None]) -> None:
        """Grant what may be granted: the first when the bus is free, and all of the one who has it."""
        for claim in list(self.waiting):
            if (free and not self.held) or self.ours(claim.owner):
                self.held[claim] = None
                settle(claim)
                self.waiting.remove(claim)

    def forget(self, claim: Claim) -> bool:
        """It has ended or is given up, granted or not, however often that is said. True when nobody has the bus now."""
        last = claim in self.held and len(self.held) == 1
        self.held.pop(claim, None)
        if claim in self.waiting:
            self.waiting.remove(claim)
        return last
