"""What one servo remembers: live values, and what its flash gives back after a restart.

A write changes the live value alone. A save takes a picture of what is worth keeping and needs its time; a restart
brings back the last picture that was finished (KST CAN protocol manual, commands 1 to 3: changes of bit rate and
node id must be saved, and count after the restart).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from motorbus.families.kst.profiles import REVERSED

KEPT = frozenset(
    {"node_id", "bit_rate_code", "mid_point", "negative_limit", "positive_limit", "function_enable", "zero"}
)
"""What a save keeps: "node id, bit rate, etc." (manual, command 3); the travel limits and the function byte by a public
flight-controller driver, the mid point by a public demo of a newer protocol; never the target position. `zero` is
no object but the place of the shaft that a mid point has made."""
REVERSE = 1 << REVERSED
"""The mask of the bit that reverses the sense of rotation (public flight-controller driver)."""


class Memory:
    """Raw values by name. `factory` is what it is made with, live and stored."""

    def __init__(self, factory: Mapping[str, int]) -> None:
        self._factory = dict(factory)
        self._live = dict(factory)
        self._stored = {name: raw for name, raw in factory.items() if name in KEPT}
        self._picture: dict[str, int] | None = None
        self._begun_at = self._done_at = 0.0

    def __getitem__(self, name: str) -> int:
        return self._live[name]

    def __setitem__(self, name: str, raw: int) -> None:
        self._live[name] = raw

    def get(self, name: str, default: int) -> int:
        """The live value, or this where there is no such object."""
        return self._live.get(name, default)

    def __contains__(self, name: object) -> bool:
        return name in self._live

    def stored(self, name: str, at: float) -> int:
        """What a restart at this moment would bring back."""
        self._settle(at)
        return self._stored[name]

    def save(self, at: float, takes: float, *, without_reverse: bool = False) -> None:
        """Keep the live values; done after so many seconds. `without_reverse` leaves out the reverse bit."""
        self._settle(at)
        self._picture = {name: self._live[name] for name in self._stored}
        if without_reverse and "function_enable" in self._picture:
            kept = self._stored["function_enable"] & REVERSE
            self._picture["function_enable"] = self._picture["function_enable"] & ~REVERSE | kept
        self._begun_at, self._done_at = at, at + takes
        self._settle(at)

    def saving(self, at: float) -> bool:
        """Whether the flash is being written at this moment."""
        self._settle(at)
        return self._picture is not None

    def midway(self, at: float) -> float:
        """When the flash is written to the half; infinity while it is not."""
        return (self._begun_at + self._done_at) / 2 if self.saving(at) else inf

    def saved(self, at: float) -> bool:
        """Whether a restart would bring back what is worth keeping as it is now."""
        self._settle(at)
        return all(self._live[name] == raw for name, raw in self._stored.items())

    def lose_supply(self, at: float, *, cut: str) -> None:
        """From here on nothing is written. A save under way has kept nothing ("old") or everything ("new")."""
        self._settle(at)
        if self._picture is not None and cut == "new":
            self._stored = self._picture
        self._picture = None

    def restart(self, at: float, *, cut: str) -> None:
        """Lose the supply, and begin anew with what was stored."""
        self.lose_supply(at, cut=cut)
        self._live = self._factory | self._stored

    def _settle(self, at: float) -> None:
        if self._picture is not None and at >= self._done_at:
            self._stored, self._picture = self._picture, None
