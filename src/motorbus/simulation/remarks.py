"""What simulated devices remark, as lines for whoever watches a simulation, and not too many of them.

A device tells its host little: of a wrong checksum, nothing; of a number out of range, nothing. A simulated one can say
so to a person meanwhile. A host that repeats its mistake a thousand times a second is told of once a second, so that
another remark is not lost among them.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.family import Remark, Simulator

MOST: Final = 5
"""Lines in a second, no two of them the same; what is beyond is counted."""


class Remarks:
    """The remarks of every node that keeps a `log`, from now on."""

    def __init__(self, simulator: Simulator) -> None:
        self._nodes = [(id, node) for id, node in sorted(simulator.nodes.items()) if hasattr(node, "log")]
        self._seen = dict.fromkeys((id for id, _ in self._nodes), 0)
        self._since = 0.0
        self._shown: set[tuple[int, str]] = set()
        self._left = 0

    def lines(self, now: float) -> list[str]:
        """What is to be shown at this moment (s, on any clock); call it now and then, also when nothing happens."""
        found: list[str] = []
        if now - self._since >= 1.0:
            found += self.rest()
            self._since = now
            self._shown.clear()
        for id, node in self._nodes:
            found += self._fresh(id, node.log)
        return found

    def rest(self) -> list[str]:
        """How many have not been shown; nothing when none."""
        left, self._left = self._left, 0
        return [f"… and {left} more"] if left else []

    def _fresh(self, id: int, log: list[Remark]) -> list[str]:
        if not log or log[-1].number == self._seen[id]:
            return []
        found = [
            f"{remark.at:9.3f} s  #{id}: {remark.text}"
            for remark in log
            if remark.number > self._seen[id] and self._has_room(id, remark.text)
        ]
        self._left += log[-1].number - self._seen[id] - len(found)
        self._seen[id] = log[-1].number
        return found

    def _has_room(self, id: int, text: str) -> bool:
        if len(self._shown) >= MOST or (id, text) in self._shown:
            return False
        self._shown.add((id, text))
        return True
