"""Alarms of a device in words, where it can say more of them than their names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.cli.wording import shell_words

if TYPE_CHECKING:
    from motorbus.cli.output import Output
    from motorbus.core.family import State


def in_words(one: Any) -> list[str]:
    """Each alarm that is set, with the figures behind it; [] when there is none, or the device has no such verb."""
    if not hasattr(one, "alarms"):
        return []
    return [shell_words(words, one.bus.family) for words in one.alarms()]


class Told:
    """Who watches devices tells of an alarm when it comes, and not at every sample."""

    def __init__(self, output: Output) -> None:
        self._output = output
        self._last: dict[tuple[str, int], tuple[str, ...]] = {}

    def look(self, bus: str, one: Any, state: State) -> None:
        """Say on stderr what is new among the alarms of this sample."""
        before, self._last[bus, one.node] = self._last.get((bus, one.node), ()), state.alarm
        if set(state.alarm) - set(before):
            for words in in_words(one):
                self._output.note(f"warning: {bus}#{one.node}: {words}")
