"""A simulated arm, and a user who answers, plugs and pushes as a script says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import motorbus
from motorbus import feetech
from motorbus.bus.blocking import Bus
from motorbus.setup.engine import Live, Note, Prompt, Step
from motorbus.simulation import Simulation

TURN = 4096
COUNT = 6.283185307179586 / TURN


@contextmanager
def arm(ids: str = "1-6", **options: Any) -> Iterator[tuple[Bus, Simulation]]:
    """An arm of STS servos, numbered as shipped from 1 to 6, and its open bus."""
    with motorbus.simulate("feetech", ids=ids, **options) as sim, motorbus.open(sim.url) as bus:
        yield bus, sim


@contextmanager
def new_servos() -> Iterator[tuple[Bus, Simulation, list[Any]]]:
    """Six servos with the id 1, none connected: the bus, the simulation, the servos."""
    with arm("11-16") as (bus, sim):
        nodes = list(sim.simulator.nodes.values())
        for node in nodes:
            node.unplug()
        for number, node in enumerate(nodes, 11):
            node.plug()
            feetech.Servo(bus, number).set_id(1)
            node.unplug()
        yield bus, sim, nodes


def turn_to(sim: Simulation, node: int, count: int) -> None:
    """Put the shaft of a servo at this count."""
    sim[node].raw_position = count


class User:
    """A `Face`: `answers` by a part of the text of a prompt, functions before an answer, pushes in a live table.

    `sweep` gives for each joint (id) the counts of its two ends from where it stands; `notes` are collected.
    """

    def __init__(
        self,
        sim: Simulation,
        *,
        sweep: Mapping[int, tuple[int, int]] | None = None,
        before: Mapping[str, Callable[[], object]] | None = None,
        answers: Mapping[str, str] | None = None,
        stop_at: int = -1,
    ) -> None:
        self.sim = sim
        self.sweep = dict(sweep or {})
        self.before = dict(before or {})
        self.answers = dict(answers or {})
        self.notes: list[str] = []
        self.prompts: list[str] = []
        self._stop_at = stop_at
        self._pushes: Iterator[Callable[[], object]] | None = None
        self._text = ""
        self._until = 0.0

    def show(self, step: Step) -> str | None:
        if isinstance(step, Note):
            self.notes.append(step.text)
            self._text = ""
            return None
        if isinstance(step, Prompt):
            self._count(step.text)
            self._pushes = None
            for part, action in self.before.items():
                if part in step.text:
                    action()
            return next((answer for part, answer in self.answers.items() if part in step.text), "")
        return self._live(step)

    def _count(self, text: str) -> None:
        if len(self.prompts) == self._stop_at:
            raise KeyboardInterrupt
        self.prompts.append(text)

    def _live(self, live: Live) -> str | None:
        """Push the next joint when the last push is over; Enter after the last one."""
        if self.sim.now < self._until:
            return None
        if self._pushes is None or live.text != self._text:
            self._text = live.text
            self._count(live.text)
            self._pushes = iter(self._actions(live))
        action = next(self._pushes, None)
        if action is None:
            self._pushes = None
            return ""
        action()
        return None

    def _actions(self, live: Live) -> Sequence[Callable[[], object]]:
        if "end to end" in live.text:
            ways = {id: (low, high - low, -high) for id, (low, high) in self.sweep.items()}
            return [partial(self._push_all, ways, turn) for turn in range(3)]
        part = next((part for part in self.before if part in live.text), None)
        return [self.before[part]] if part is not None else []

    def _push_all(self, ways: Mapping[int, Sequence[int]], turn: int) -> None:
        for id, way in ways.items():
            self.push(id, way[turn])

    def push(self, node: int, counts: int) -> None:
        """Turn a shaft by hand at 1 rad/s."""
        self.sim[node].push_shaft(counts * COUNT)
        self._until = max(self._until, self.sim.now + abs(counts) * COUNT * 1.1 + 0.3)


def run_until_interrupted(steps: Any, user: User) -> bool:
    """Whether the procedure came to its end."""
    from motorbus.setup.engine import run

    try:
        run(steps, user)
    except KeyboardInterrupt:
        return False
    return True
