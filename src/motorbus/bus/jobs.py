"""What waits for the bus: a request, a change of the bit rate, or exclusive use."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any, NamedTuple, TypeAlias

from motorbus.core.operation import Answer, Exchange, Rank, Tune

Stops: TypeAlias = "Mapping[int | None, int]"
"""Number of stops sent by node; None: for all nodes."""


class Since(NamedTuple):
    """What had happened on a bus when a caller decided: stops, emergency stops, lost ports."""

    stops: Stops
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

    `settled` is called once, when `done` is set.
    """

    priority: Rank

    def __init__(self, owner: object = None, settled: Callable[[], None] | None = None) -> None:
        self.owner = owner
        self.settled = settled
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
    """A request, over all its attempts; `step` is what its policy waits for.

    A request that moves something is refused after a stop, or a loss of the port, that came after `since`.
    """

    def __init__(
        self,
        request: Exchange[Any],
        owner: object = None,
        settled: Callable[[], None] | None = None,
        since: Since | None = None,
    ) -> None:
        super().__init__(owner, settled)
        self.request = request
        self.priority = request.rank
        self.since = since
        self.policy: Policy | None = None
        self.step: Send | Wait | None = None


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
