"""What waits for the bus: a request, a change of the bit rate, or exclusive use."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any, NamedTuple, TypeAlias

from motorbus.core.operation import Answer, Exchange, Rank, Tune


class Since(NamedTuple):
    """What had happened on a bus when a caller decided: stops by node and in all, emergency stops, lost ports."""

    stops: tuple[Mapping[int | None, int], int]
    latches: int
    losses: int


class Send(NamedTuple):
    """Step of a policy: send this request; the engine gives the finished attempt.

    `excluded` are nodes of a group that are not waited for. `after_echo`: the last attempt failed by an echo, so this
    one takes a reply that equals a request if a probe has excluded an echo since.
    """

    request: Exchange[Any]
    excluded: tuple[int, ...] = ()
    is_probe: bool = False
    after_echo: bool = False


class Wait(NamedTuple):
    """Step of a policy: do nothing before this moment (s)."""

    until: float


Policy: TypeAlias = "Generator[Send | Wait, Any, Answer]"
"""What is done for one request; it gets a finished `Attempt`, or None after a wait."""


class Job:
    """Something that waits for the bus. `owner` has the bus to itself while `Engine.exclusive` is this owner.

    `settled` is called once, when `done` is set. `losses` is the number of lost connections when its caller began.
    """

    priority: Rank

    def __init__(self, owner: object, settled: Callable[[], None] | None, losses: int = 0) -> None:
        self.owner = owner
        self.settled = settled
        self.losses = losses
        self.serial = 0
        self.done = False
        self.value: Any = None
        self.error: BaseException | None = None

    def __lt__(self, other: Job) -> bool:
        return (self.priority, self.serial) < (other.priority, other.serial)

    def settle(self, value: Any = None, error: BaseException | None = None) -> None:
        """End it with a value or an error; later calls change nothing."""
        if self.done:
            return
        self.value, self.error, self.done = value, error, True
        if self.settled is not None:
            self.settled()

    def result(self) -> Any:
        """The value; raises the error."""
        if self.error is not None:
            raise self.error
        return self.value


class RequestJob(Job):
    """A request, over all its attempts.

    `step` is what its policy waits for. `stops` is how many stops of its nodes had been sent when it was called,
    `latches` how many emergency stops when its procedure began; None where none can come between.
    """

    def __init__(
        self,
        request: Exchange[Any],
        owner: object = None,
        settled: Callable[[], None] | None = None,
        losses: int = 0,
    ) -> None:
        super().__init__(owner, settled, losses)
        self.request = request
        self.priority = request.rank
        self.policy: Policy | None = None
        self.step: Send | Wait | None = None
        self.stops: int | None = None
        self.latches: int | None = None


class RateJob(Job):
    """A change of the bit rate; it waits until nothing is in flight."""

    def __init__(
        self,
        tune: Tune,
        owner: object = None,
        settled: Callable[[], None] | None = None,
        *,
        urgent: bool = False,
    ) -> None:
        super().__init__(owner, settled)
        self.tune = tune
        self.priority = Rank.STOP if urgent else Rank.CONFIGURATION


class ExclusiveJob(Job):
    """A wish to have the bus alone; it is settled when nothing else is in flight."""

    priority = Rank.POLL
