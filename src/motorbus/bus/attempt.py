"""One request on the wire, and what came for it."""

from __future__ import annotations

from math import inf
from typing import Any, Final

from motorbus.bus.failures import FAULTS
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Data, Expected, Reply, Request, Response, Step

NOISE_KEPT: Final = 16
"""Pieces of noise kept for the error message."""


class Attempt(Step["Attempt | None"]):
    """A request on the wire. A policy awaits it and gets it back when it has ended.

    A kept request has one attempt for each bus, which is used again, so what depends on the request alone is computed
    once.
    """

    __slots__ = (
        "accepted",
        "air",
        "answer",
        "at",
        "budget",
        "complete",
        "data",
        "deadline",
        "direct",
        "error",
        "excluded",
        "expected",
        "fault",
        "in_flight",
        "is_probe",
        "is_probed",
        "is_used",
        "nodes",
        "noise",
        "orders",
        "replies",
        "request",
        "sent_at",
        "shared",
        "since",
        "size",
        "stop_since",
        "surplus",
        "task",
        "timing",
        "write_until",
    )

    def __init__(
        self,
        request: Request[Any],
        *,
        is_probe: bool = False,
        is_probed: bool = False,
        excluded: tuple[int, ...] = (),
    ) -> None:
        self.request = request
        self.is_probe = is_probe
        self.is_probed = (
            is_probed  # a probe has shown that there is no echo, so a reply may equal what was sent
        )
        self.expected: tuple[Expected, ...] = () if request.expected is ANY else request.expected
        self.nodes = tuple([due.node for due in self.expected])
        self.size = sum([due.length for due in self.expected])  # bytes of all replies
        self.timing: object = None
        """Identifies the rate and latency for which `air` and `budget` hold."""
        self.air = 0.0  # s on the wire
        self.budget = 0.0  # s from the start to the deadline
        self.task: Any = None
        """The task that waits for it; None: its caller no longer waits."""
        self.direct = True  # the task awaits the request itself, not its policy this attempt
        self.since = self.stop_since = -1
        """Epochs when its caller decided; -1: a stop does not withdraw it."""
        self.excluded = excluded
        """Nodes of a group that it does not wait for, or whose reply was damaged."""
        self.in_flight = False
        self.is_used = False  # `reset` is needed before it is sent again
        self.sent_at = 0.0
        self.deadline = inf
        self.shared = 0  # attempts on other lanes that the deadline allows for
        self.write_until = 0.0
        """When it fails (s) if the link is still full; 0 while the link was not."""
        self.replies: dict[int, Reply] = {}
        self.noise: list[tuple[str, bytes]] = []
        self.fault = ""
        self.surplus = False  # more came than was expected
        self.complete = False
        self.error: BaseException | None = None
        """What ended it before its time: a lost link, a stop."""
        self.accepted: Response | None = None
        """What its caller gets; None if it failed."""
        self.data: Data = b""
        """The last reply accepted as a whole, and below when (s), and after how many orders."""
        self.at = -inf
        self.orders = 0
        self.answer: Response | None = None

    def reset(self) -> None:
        """It is sent: nothing has come for it. `excluded` stays."""
        self.is_used = False
        self.error = self.accepted = None
        self.replies, self.noise, self.fault = {}, [], ""
        self.surplus = self.complete = False

    def reading(self) -> tuple[Request[Any], Response]:
        """The request and its last accepted reply, split into the replies of the nodes."""
        if self.answer is None:
            self.answer = Response(self._split(), (), self.at)
        return self.request, self.answer

    def _split(self) -> tuple[Reply, ...]:
        content = self.data.data if isinstance(self.data, CanFrame) else self.data
        replies, start = [], 0
        for due in self.expected:
            replies.append(Reply(self.request.lane, due.key, content[start : start + due.length]))
            start += due.length
        return tuple(replies)

    # -- what comes in -----------------------------------------------------------------------------------------

    def take(self, reply: Reply) -> bool:
        """Keep this reply if it is one of those expected."""
        if self.request.expected is ANY:
            self.replies[len(self.replies)] = reply
            return True
        for index, due in enumerate(self.expected):
            if due.accepts(reply.key, len(reply.data)) and index not in self.replies:
                self.replies[index] = reply
                self.check_complete()
                return True
        return False

    def check_complete(self) -> None:
        """A group does not wait for excluded nodes."""
        self.complete = self.request.expected is not ANY and all(
            index in self.replies or due.node in self.excluded for index, due in enumerate(self.expected)
        )

    def is_excluded(self, reply: Reply) -> bool:
        """An excluded node sent this reply: it came in spite of not being waited for."""
        size = len(reply.data)
        return any(due.node in self.excluded and due.accepts(reply.key, size) for due in self.expected)

    def take_noise(self, fault: str, data: bytes) -> None:
        """Noise before the first reply does no harm; behind a reply that reply may be shifted by a byte."""
        if self.complete:
            self.surplus = True
        elif self.replies and self.expected:
            self.exclude(self.replies[max(self.replies)])
        self.noise.append((fault, data[:64]))
        del self.noise[:-NOISE_KEPT]

    def exclude(self, reply: Reply) -> None:
        """The node of this reply sent something unexpected: a group loses that node, a single request fails."""
        if len(self.expected) > 1:
            self.excluded += tuple(due.node for due in self.expected if due.key == reply.key)
            self.check_complete()
        else:
            self.fault = self.fault or "unexpected"

    # -- how it ends -------------------------------------------------------------------------------------------

    def failure(self) -> str:
        """The kind of fault of this attempt, a key of `FAULTS`."""
        if self.fault or self.surplus:
            return self.fault or "surplus"
        kinds = [kind for kind, _ in self.noise]
        if "checksum" in kinds:
            return "checksum"
        return kinds[0] if kinds and kinds[0] in FAULTS else "silence"

    def response(self, at: float) -> Response:
        """The replies in the order expected; excluded nodes count as missing."""
        if self.request.expected is ANY:
            return Response(tuple(self.replies.values()), (), at)
        taken = [
            i for i, due in enumerate(self.expected) if i in self.replies and due.node not in self.excluded
        ]
        missing = () if len(taken) == len(self.expected) else self._missing(taken)
        return Response(tuple([self.replies[index] for index in taken]), missing, at)

    def _missing(self, taken: list[int]) -> tuple[int, ...]:
        return tuple(due.node for index, due in enumerate(self.expected) if index not in taken)

    def received(self) -> bytes:
        """All that came, for the error message."""
        return b"".join([*(data for _, data in self.noise), *(reply.data for reply in self.replies.values())])
