"""What waits for the bus: a request with its attempts, a change of the bit rate, or exclusive use."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple, TypeAlias

from motorbus.bus.failures import FAULTS
from motorbus.core.request import ANY, Expected, Priority, Reply, Request, Response
from motorbus.core.steps import SetBitrate

NOISE_KEPT = 16
"""Pieces of noise kept for the error message."""

StopCounts: TypeAlias = "Mapping[int | None, int]"
"""Number of stops sent by node; None: for all nodes."""


class Since(NamedTuple):
    """What had happened on a bus when a caller decided: stops, emergency stops, lost ports."""

    stops: StopCounts
    latches: int
    losses: int


class Wait(NamedTuple):
    """Step of a policy: do nothing before this moment (s)."""

    until: float


Policy: TypeAlias = "Generator[Attempt | Wait, Any, Response]"
"""What is done for one request: it yields attempts and gets each back when it has ended, or None after a wait."""


class Job:
    """Something that waits for the bus. `owner` has the bus to itself while `Engine.exclusive` is this owner.

    `settled` is called once, when `done` is set.
    """

    priority: Priority

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
        request: Request[Any],
        owner: object = None,
        settled: Callable[[], None] | None = None,
        since: Since | None = None,
    ) -> None:
        super().__init__(owner, settled)
        self.request = request
        self.priority = request.priority
        self.since = since
        self.policy: Policy | None = None
        self.step: Attempt | Wait | None = None


class RateJob(Job):
    """A change of the bit rate; it waits until nothing is in flight."""

    def __init__(
        self,
        tune: SetBitrate,
        owner: object = None,
        settled: Callable[[], None] | None = None,
        *,
        urgent: bool = False,
    ) -> None:
        super().__init__(owner, settled)
        self.tune = tune
        self.priority = Priority.STOP if urgent else Priority.CONFIGURATION


class ExclusiveJob(Job):
    """A wish to have the bus alone; it is settled when nothing else is in flight."""

    priority = Priority.POLL


@dataclass(slots=True, eq=False)
class Attempt:
    """A request in flight, and what came for it.

    `job` is None for an attempt whose caller no longer waits. `excluded` are nodes of a group that this attempt does
    not wait for, or whose reply was damaged. `after_echo`: the attempt before met an echo. `echo_excluded`: a probe has
    shown since that there is none, so a reply may equal a request. `air` is its time on the wire (s), `competitors` the
    number of attempts on other lanes that its deadline allows for. `fault` is why it failed, "" while it has not;
    `surplus`: more came than was expected. `accepted` is what the caller gets. `ended`: it is not in flight any more.
    `write_until` is when it fails (s) if the link is still full, 0 while the link was not.
    """

    request: Request[Any]
    job: RequestJob | None = None
    excluded: tuple[int, ...] = ()
    is_probe: bool = False
    after_echo: bool = False
    echo_excluded: bool = False
    sent_at: float = 0.0
    deadline: float = inf
    air: float = 0.0
    write_until: float = 0.0
    competitors: int = 0
    replies: dict[int, Reply] = field(default_factory=dict)
    noise: list[tuple[str, bytes]] = field(default_factory=list)
    fault: str = ""
    surplus: bool = False
    complete: bool = False
    accepted: Response | None = None
    ended: bool = False

    @property
    def dues(self) -> tuple[Expected, ...]:
        """The replies expected; none where any reply counts."""
        return () if self.request.expected is ANY else self.request.expected

    def take(self, reply: Reply) -> bool:
        """Keep this reply if it is one of those expected."""
        if self.request.expected is ANY:
            self.replies[len(self.replies)] = reply
            return True
        for index, due in enumerate(self.dues):
            if due.accepts(reply.key, len(reply.data)) and index not in self.replies:
                self.replies[index] = reply
                self._check_complete()
                return True
        return False

    def _check_complete(self) -> None:
        """A group does not wait for excluded nodes."""
        dues = self.request.expected
        self.complete = dues is not ANY and all(
            index in self.replies or due.node in self.excluded for index, due in enumerate(dues)
        )

    def is_excluded(self, reply: Reply) -> bool:
        """An excluded node sent this reply: it came in spite of not being waited for."""
        size = len(reply.data)
        return any(due.node in self.excluded and due.accepts(reply.key, size) for due in self.dues)

    def take_noise(self, fault: str, data: bytes) -> None:
        """Noise before the first reply does no harm; behind a reply that reply may be shifted by a byte."""
        if self.complete:
            self.surplus = True
        elif self.replies and self.dues:
            self.exclude(self.replies[max(self.replies)])
        self.noise.append((fault, data[:64]))
        del self.noise[:-NOISE_KEPT]

    def exclude(self, reply: Reply) -> None:
        """The node of this reply sent something unexpected: a group loses that node, a single request fails."""
        if len(self.dues) > 1:
            self.excluded += tuple(due.node for due in self.dues if due.key == reply.key)
            self._check_complete()
        else:
            self.fault = self.fault or "unexpected"

    def failure(self) -> str:
        """The kind of fault of this attempt, a key of `FAULTS`."""
        if self.fault or self.surplus:
            return self.fault or "surplus"
        kinds = [kind for kind, _ in self.noise]
        if "checksum" in kinds:
            return "checksum"
        return kinds[0] if kinds and kinds[0] in FAULTS else "silence"

    def answer(self, at: float) -> Response:
        """The replies in the order expected; excluded nodes count as missing."""
        if self.request.expected is ANY:
            return Response(tuple(self.replies.values()), (), at)
        taken = [i for i, due in enumerate(self.dues) if i in self.replies and due.node not in self.excluded]
        missing = tuple(due.node for i, due in enumerate(self.dues) if i not in taken)
        return Response(tuple(self.replies[i] for i in taken), missing, at)

    def received(self) -> bytes:
        """All that came, for the error message."""
        return b"".join([*(data for _, data in self.noise), *(reply.data for reply in self.replies.values())])
