"""--dry-run: the same operation, with everything that would change a device shown and withheld.

What only reads is carried out, because what would be sent depends on it (limits, register map, where a servo
stands). A read that follows a withheld write would find the old value; it is not carried out but taken to confirm
what was "written", so that a guarded sequence is shown to its end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from motorbus.core.operation import (
    Alone,
    Effect,
    Exchange,
    Goal,
    Listen,
    Pause,
    Rank,
    Report,
    Runnable,
    Together,
    Tune,
)
from motorbus.errors import MotorbusError
from motorbus.motion.safety import Gate

if TYPE_CHECKING:
    from collections.abc import Callable

    from motorbus.bus.pump import Bus

T = TypeVar("T")


class Unforeseeable(MotorbusError):
    """What would be sent next depends on an answer to what was withheld."""


class _AsWritten:
    """The answer to a read of what was withheld: equal to whatever it is compared with, and nothing else."""

    def __eq__(self, other: object) -> bool:
        return True

    def __ne__(self, other: object) -> bool:
        return False

    __hash__ = None  # type: ignore[assignment]

    def __getattr__(self, name: str) -> Any:
        raise Unforeseeable("what would be sent next depends on an answer that only a real run gets")


class DryBus:
    """Stands where a bus stands. `show` gets each request that was withheld, and the goals in it."""

    def __init__(self, bus: Bus, show: Callable[[bytes, tuple[Goal, ...]], None]) -> None:
        self.bus = bus
        self.family = bus.family
        self.link = bus.link
        self._show = show
        self._gate = Gate()
        self._withheld = False

    def run(self, operation: Runnable[T], report: object = None) -> T:
        """Carry out an operation, reading only."""
        value: Any = self._exchange(operation) if isinstance(operation, Exchange) else self._drive(operation)
        return value  # type: ignore[no-any-return]

    def _drive(self, operation: Any) -> object:
        answer: object = None
        error: MotorbusError | None = None
        while True:
            try:
                step = operation.throw(error) if error else operation.send(answer)
            except StopIteration as end:
                return end.value
            answer, error = None, None
            try:
                answer = self._step(step)
            except MotorbusError as failure:
                error = failure

    def _step(self, step: object) -> object:
        if isinstance(step, Exchange):
            return self._exchange(step)
        if isinstance(step, Alone):
            return self.run(step.operation)
        if isinstance(step, Together):
            return [self.run(operation) for operation in step.operations]
        assert isinstance(step, Pause | Listen | Tune | Report)
        return None

    def _exchange(self, exchange: Exchange[Any]) -> object:
        if exchange.effect is Effect.NONE and exchange.rank is Rank.POLL:
            return _AsWritten() if self._withheld else self.bus.run(exchange)
        self._gate(exchange)
        self._withheld = True
        assert isinstance(exchange.request, bytes)
        self._show(exchange.request, exchange.goals)
        return None
