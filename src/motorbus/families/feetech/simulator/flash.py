"""The EEPROM of one servo: cells that take their time, one after the other, and what is left when the supply goes.

A byte that is written with the lock open is obeyed at once and committed later. Between the two the supply may go: what
was committed stays, what was waiting is lost, and the cell just under work is torn. Nobody has measured which of its
three possible contents it has then, so that is a switch. That it takes about 20 ms for a write was measured (public
recovery tool for STS3215); how these are shared among its cells was not: here they are shared equally.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from math import inf
from typing import Final, NamedTuple

ERASED: Final = 0xFF


class Commit(NamedTuple):
    """A cell that will hold `value` from `moment` (s) on, if the supply lasts."""

    moment: float
    address: int
    value: int


class Flash:
    """Cells with their wear, and the commits still to come.

    `clock`  what time it is (s); whatever is due by then is done when somebody looks
    `time`   s that one write needs, however many cells it has
    `torn`   what a cell holds whose commit was cut: "old", "new" or "erased"
    """

    __slots__ = ("_begun_at", "_cells", "_clock", "_done", "_waiting", "_wear", "time", "torn")

    def __init__(
        self,
        cells: bytes,
        *,
        clock: Callable[[], float] = lambda: 0.0,
        time: float = 0.0,
        torn: str = "erased",
    ) -> None:
        self.time = time
        self.torn = torn
        self._cells = bytearray(cells)
        self._wear: Counter[int] = Counter()
        self._waiting: list[Commit] = []
        self._done = 0
        self._begun_at = -inf  # when the first of those that wait began, or the last of all was done
        self._clock = clock

    @property
    def cells(self) -> bytearray:
        """What they hold now, and what comes back after a power cut at this moment but for a cell under work."""
        self._settle()
        return self._cells

    @property
    def wear(self) -> Counter[int]:
        """How often each cell has been programmed."""
        self._settle()
        return self._wear

    @property
    def works(self) -> bool:
        """Whether anything may still be to come: False is certain."""
        return bool(self._waiting)

    @property
    def commits(self) -> list[Commit]:
        """What is still to come, in order."""
        self._settle()
        return list(self._waiting)

    @property
    def busy_until(self) -> float:
        """When the last of them will be done; minus infinity when nothing waits."""
        if self._waiting:
            self._settle()
        return self._waiting[-1].moment if self._waiting else -inf

    def program(self, cells: Iterable[tuple[int, int]], time: float | None = None) -> None:
        """Commit these (address, value), after what is already waiting."""
        wanted = list(cells)
        begin = max(self._clock(), self.busy_until)
        if not self._waiting:
            self._begun_at = begin
        step = (self.time if time is None else time) / max(1, len(wanted))
        for number, (address, value) in enumerate(wanted, start=1):
            self._waiting.append(Commit(begin + number * step, address, value))

    def intended(self) -> bytearray:
        """What they will hold when everything is done."""
        image = bytearray(self.cells)
        for commit in self._waiting:
            image[commit.address] = commit.value
        return image

    @property
    def done(self) -> int:
        """How many cells have been committed in all."""
        self._settle()
        return self._done

    def moment_of(self, done: float) -> float:
        """When so many cells in all will be committed, a half being the middle of the next one; infinity when that is
        not known yet. What has been is no moment to come: infinity, too."""
        whole, part = divmod(done - self.done, 1.0)
        moments = [self._begun_at, *(commit.moment for commit in self._waiting)]
        if whole < 0 or whole + (part > 0) >= len(moments) or not self._waiting:
            return inf
        before = moments[int(whole)]
        return before + part * (moments[int(whole) + 1] - before) if part else before

    def cut(self) -> None:
        """The supply goes at this moment: what waits is lost, and what is under work is torn.

        At the very moment at which one is done, or before it began, the next one is untouched.
        """
        self._settle()
        if self._waiting and self._begun_at < self._clock():
            commit = self._waiting[0]
            self._wear[commit.address] += 1
            if self.torn != "old":
                self._cells[commit.address] = ERASED if self.torn == "erased" else commit.value
        self.drop()

    def drop(self) -> None:
        """What has not been committed yet never will."""
        self._settle()
        self._waiting.clear()

    def _settle(self) -> None:
        now = self._clock()
        while self._waiting and self._waiting[0].moment <= now:
            commit = self._waiting.pop(0)
            self._cells[commit.address] = commit.value
            self._wear[commit.address] += 1
            self._begun_at = commit.moment
            self._done += 1
