"""Axes without a machine: on a bus of which there is only what a canary and a watch look at, and which answers at once.

Their tests say what must be so of one answer, or of two; for that nobody needs a wire or a servo.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from motorbus.core.family import Health, State
from motorbus.core.operation import Exchange, Operation, Pause, Report, Runnable
from motorbus.errors import MotorbusError
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.machine import AxisSpec
from motorbus.motion.safety.gate import Gate

AIR = 0.001
"""s that asking how one fares takes of the wire."""


def fares(torque: bool | None = True, blank: bool | None = False, **rest: Any) -> Health:
    """How a device fares: well, but for what is said."""
    restarts = rest.pop("restarts", None)
    return Health(State(rest.pop("at", 10.0), **rest), torque, blank, restarts)


class Alone:
    """Axes n1, n2 … on devices 1, 2 …, and their bus: its gate, the time on it, and the stops that have left on it.

    `answers` says by device how each fares, `asked` who was asked, `told` what was reported.
    """

    def __init__(self, admit: object = None) -> None:
        self.admit = Gate() if admit is None else admit
        self.now = 10.0
        self.stops: dict[int, int] = {}
        self.answers: dict[int, Health | MotorbusError] = {}
        self.asked: list[int] = []
        self.told: list[object] = []
        known = SimpleNamespace(stops=lambda node: self.stops.get(node, 0))
        family = SimpleNamespace(air_time=lambda exchange, rate: AIR)
        self.bus: Any = SimpleNamespace(
            admit=self.admit, turns=SimpleNamespace(known=known), family=family, rate=9600
        )

    def axis(self, node: int = 1, *able: str, engaged: bool = True, **spec: Any) -> AxisVerbs:
        """One of them; it tells how it fares unless it is said what it is `able` to do."""
        made = AxisSpec(device=f"arm#{node}", unit="deg", max_velocity=2.0, max_acceleration=9.0, **spec)
        can: dict[str, Callable[..., Runnable[Any]]] = dict.fromkeys(able or ("health", "position"), question)
        axis = AxisVerbs(self.bus, f"n{node}", made, node, can)
        axis.engaged = engaged
        return axis

    def run(self, operation: Operation[Any]) -> Any:
        """Carry it out: what it gives, or raises."""
        told: object = None
        try:
            while True:
                step = operation.throw(told) if isinstance(told, MotorbusError) else operation.send(told)
                told = self._step(step)
        except StopIteration as end:
            return end.value

    def _step(self, step: object) -> object:
        if isinstance(step, Report):
            self.told.append(step.event)
            return None
        if isinstance(step, Pause):
            return self.now + step.seconds
        assert isinstance(step, Exchange)
        self.asked.append(step.lane)
        return self.answers.get(step.lane, fares(at=self.now))


def question(device: int) -> Exchange[Any]:
    """The question to this device how it fares."""
    return Exchange(b"?", lane=device)
