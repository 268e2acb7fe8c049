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

    The attempt of a request with `decode_exact` is kept and used again. A group does not wait for `excluded` nodes.
    """

    def __init__(
        self, request: Request[Any], *, is_probe: bool = False, excluded: tuple[int, ...] = ()
    ) -> None:
        self.request = request
        self.priority = request.priority
        self.is_probe = is_probe
        self.is_probed = False  # a probe was answered, so a reply may equal what was sent
        self.excluded = excluded
        self.expected: tuple[Expected, ...] = () if request.expected is ANY else request.expected
        self.nodes = tuple([due.node for due in self.expected])
        self.size = sum([due.length for due in self.expected])  # bytes of all replies
        self.timing: object = None
        """Rate and latency for which `air` (s on the wire) and `budget` (s to the deadline) hold."""
        self.air = self.budget = 0.0
        self.task: Any = None
        """The task that waits for it; None: its caller no longer waits."""
        self.direct = True  # the task awaits the request itself, not its policy this attempt
        self.since = self.stop_since = -1
        """Epochs when its caller decided; -1: a stop does not withdraw it."""
        self.in_flight = False
        self.sent_at = 0.0
        self.deadline = inf
        self.shared = 0  # attempts on other lanes that the deadline allows for
        self.write_until = 0.0
        """When it fails (s) if the link is still full; 0 while the link was not."""
        self.data: Data = b""
        """The last reply accepted as a whole, and below when (s), after how many orders, and split."""
        self.at = -inf
        self.orders = 0
        self.answer: Response | None = None
        self.reset()

    def reset(self) -> None:
        """Nothing has come for it."""
        self.is_used = False
        self.error: BaseException | None = None
        """What ended it before its time: a lost link, a stop."""
        self.accepted: Response | None = None
        """What its caller gets; None if it failed."""
        self.replies: dict[int, Reply] = {}
        self.noise: list[tuple[str, bytes]] = []
        self.fault = ""
        self.surplus = self.complete = False

    def reading(self) -> tuple[Request[Any], Response]:
        """The request and its last accepted reply, split into the replies of the nodes."""
        if self.answer is None:
            content = self.data.data if isinstance(self.data, CanFrame) else self.data
            replies, start = [], 0
            for due in self.expected:
                end = start + due.length
                replies.append(Reply(self.request.lane, due.key, content[start:end]))
                start = end
            self.answer = Response(tuple(replies), (), self.at)
        return self.request, self.answer

    # -- what comes in -----------------------------------------------------------------------------------------

    def take(self, reply: Reply) -> bool:
        """Keep this reply if it is one of those expected."""
        if self.request.expected is ANY:
            self.replies[len(self.replies)] = reply
            return True
        for index, due in enumerate(self.expected):
            if due.accepts(reply.key, len(reply.data)) and index not in self.replies:
                self.replies[index] = reply
                self._check_complete()
                return True
        return False

    def _check_complete(self) -> None:
        self.complete = all(
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
            self._check_complete()
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
        replies, missing = [], []
        for index, due in enumerate(self.expected):
            if index in self.replies and due.node not in self.excluded:
                replies.append(self.replies[index])
            else:
                missing.append(due.node)
        return Response(tuple(replies), tuple(missing), at)

    def received(self) -> bytes:
        """All that came, for the error message."""
        return b"".join([*(data for _, data in self.noise), *(reply.data for reply in self.replies.values())])
