"""What every simulated device held at every moment, so that a host's word can be held against it afterwards.

A value that a host believes is right when the device held it at some instant of the call, and wrong when it is only
old: that cannot be judged by what the device holds now. `History` stands in front of a simulator, passes everything on,
and at each event that a host can see compares what each device shows with what it showed last. Only what differs is
kept, so a million exchanges with devices at rest cost a comparison each and no memory.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Mapping
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

from motorbus.core.family import SimulatedNode, Simulator
from motorbus.core.operation import Data
from motorbus.errors import RequestError

Raw: TypeAlias = int | bytes
Picture: TypeAlias = tuple[Hashable, ...]


class Seen(NamedTuple):
    """A device from this moment (s) on: the id it answered to and all that a host could read of it."""

    at: float
    node: int
    picture: Picture


@runtime_checkable
class Sighted(Protocol):
    """A simulator that shows what its devices hold; all of this package do.

    `obeys_at_once`: whatever a device tells it has worked out when the request reached it, and it tells nothing else.
    """

    obeys_at_once: bool

    def sight(self, at: float) -> Iterable[tuple[int, Picture]]:
        """The id and the picture of each device at this moment, always in one order; two devices may share an id."""

    def shown(self, picture: Picture, name: str) -> Raw:
        """The raw value that a row, by its name, has in a picture. Raises RequestError for a row that it has not."""


class History:
    """A `motorbus.core.family.Simulator` around another one, which remembers. All else of the other is there too.

    `heard`  how often the host's data have reached the devices
    `keep`   how many changes of each device are kept, the latest; None: all
    `at`     what the clock shows when it begins, s

    Time is that of the link. A movement counts as what it was whenever a host's request or a device's answer passed,
    and whenever `look` was called: the first and the last instant of a call are for whoever judges it to look at.
    """

    def __init__(self, simulator: Simulator, *, keep: int | None = None, at: float = 0.0) -> None:
        if not isinstance(simulator, Sighted):
            raise RequestError(
                f"{type(simulator).__name__} does not show what its devices hold",
                expected="a simulator with `sight` and `shown`",
            )
        if keep is not None and keep < 2:
            raise RequestError(f"a history of {keep} changes is none", expected="2 or more, or None for all")
        self.simulator: Any = simulator
        self.keep = keep
        self.heard = 0
        self._answers_count = not simulator.obeys_at_once
        self._logs = [deque([Seen(at, *seen)], keep) for seen in simulator.sight(at)]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["simulator"], name)

    # -- what every simulator does ----------------------------------------------------------------------------------

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        """The devices of the other simulator."""
        nodes: Mapping[int, SimulatedNode] = self.simulator.nodes
        return nodes

    def receive(self, data: Data, at: float) -> None:
        """Pass on what the host sends, and see what has become of it."""
        self.simulator.receive(data, at)
        self.heard += 1
        self.look(at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Everything the devices begin to send up to this moment."""
        said: list[tuple[float, Data]] = self.simulator.advance(to)
        if said and self._answers_count:
            self.look(to)
        return said

    def due(self) -> float | None:
        """The next moment something happens by itself."""
        due: float | None = self.simulator.due()
        return due

    def tune(self, rate: int) -> None:
        """The host's rate."""
        self.simulator.tune(rate)

    # -- what it remembers ------------------------------------------------------------------------------------------

    def look(self, at: float) -> None:
        """Keep what has changed since the last event, as of this moment."""
        seen = tuple(self.simulator.sight(at))
        for newcomer in seen[len(self._logs) :]:  # a second device with an id that was there
            self._logs.append(deque([Seen(at, *newcomer)], self.keep))
        for log, (node, picture) in zip(self._logs, seen, strict=True):
            _, last_node, last = log[-1]
            if picture != last or node != last_node:
                log.append(Seen(at, node, picture))

    def held(self, node: int, name: str, since: float, until: float) -> set[Raw]:
        """The raw values that a row of this node had at some instant between two moments, both included (s).

        At the very moment of a change it had both, so `look` and let time pass before a window begins. Of two devices
        with one id, those of both. Raises RequestError when that lies further back than is kept.
        """
        return {self.simulator.shown(seen.picture, name) for seen in self._between(node, since, until)}

    def applied(self, node: int, name: str, since: float, until: float) -> list[Raw]:
        """The raw values that a row took on between two moments, in order. To be given what it has is no change."""
        changes: list[tuple[float, Raw]] = []
        for log in self._logs:
            seen = [one for one in self._span(log, since, until) if one.node == node]
            values = [(one.at, self.simulator.shown(one.picture, name)) for one in seen]
            changes += [now for before, now in pairwise(values) if now[1] != before[1] and now[0] >= since]
        return [value for _, value in sorted(changes, key=lambda change: change[0])]

    def changes(self) -> int:
        """How many changes are kept just now, of all devices together."""
        return sum(len(log) - 1 for log in self._logs)

    def _between(self, node: int, since: float, until: float) -> Iterator[Seen]:
        for log in self._logs:
            yield from (seen for seen in self._span(log, since, until) if seen.node == node)

    def _span(self, log: deque[Seen], since: float, until: float) -> list[Seen]:
        """What was in force between these moments, in order."""
        span: list[Seen] = []
        until_next = inf
        for seen in reversed(log):
            if seen.at <= until and until_next >= since:
                span.append(seen)
            until_next = seen.at
            if seen.at < since:
                return span[::-1]
        if len(log) == self.keep:
            raise RequestError(
                f"{since:g} s lies before the {self.keep} changes that are kept",
                advice="keep more, or ask sooner",
            )
        return span[::-1]
