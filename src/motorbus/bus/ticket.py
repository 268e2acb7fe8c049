"""What somebody waits for: an exchange, a moment, a notice, a change of rate, or the bus for itself.

Turns finishes a ticket; its owner looks at `done`. The order of assignments in `finish` matters: an interrupt at
any line leaves either an unfinished ticket or a complete one.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from math import inf
from typing import Any

from motorbus.core.operation import ANY, Answer, Event, Exchange, Listen, Rank, Reply, Tune


class Ticket:
    """Something awaited. `owner` is the run it belongs to, `deadline` when turns must look at it again."""

    __slots__ = ("deadline", "done", "error", "owner", "value", "wake")

    def __init__(self, owner: object = None, wake: Callable[[], None] | None = None) -> None:
        self.owner = owner
        self.wake = wake
        self.deadline = inf
        self.value: Any = None
        self.error: BaseException | None = None
        self.done = False

    def finish(self, value: object = None, error: BaseException | None = None) -> None:
        """Settle it, once; later calls change nothing."""
        if not self.done:
            self.value = value
            self.error = error
            self.done = True
            if self.wake is not None:
                self.wake()

    def result(self) -> Any:
        """The value; raises the error."""
        if self.error is not None:
            raise self.error
        return self.value


class Timer(Ticket):
    """Awaits a moment."""

    __slots__ = ()


class Listener(Ticket):
    """Awaits a notice, or a moment."""

    __slots__ = ("listen",)

    def __init__(self, listen: Listen, owner: object, wake: Callable[[], None] | None) -> None:
        super().__init__(owner, wake)
        self.listen = listen


class Retune(Ticket):
    """Awaits a change of the link's rate."""

    __slots__ = ("tune",)

    def __init__(self, tune: Tune, owner: object, wake: Callable[[], None] | None) -> None:
        super().__init__(owner, wake)
        self.tune = tune


class Claim(Ticket):
    """Awaits the bus for its owner alone."""

    __slots__ = ()


class Flight(Ticket):
    """Awaits the answer to one exchange, over all its tries.

    Where lanes share a wire, `air` is its time there and `beside` how many others its deadline allows for.
    """

    air: float
    beside: int

    __slots__ = (
        "abandoned",
        "air",
        "beside",
        "complete",
        "echo_checked",
        "exchange",
        "got",
        "last",
        "left",
        "noise",
        "ordered",
        "parent",
        "put_aside",
        "sent_at",
        "settling",
        "spoiled",
        "surplus",
        "tries",
        "unbelieved",
    )

    def __init__(
        self,
        exchange: Exchange[Any],
        owner: object = None,
        wake: Callable[[], None] | None = None,
        parent: Flight | None = None,
    ) -> None:
        self.owner, self.wake = owner, wake  # as `Ticket` does, and `reset`: here lines count
        self.deadline = inf
        self.value = self.error = None
        self.done = False
        self.exchange = exchange
        self.parent = parent
        self.tries = 0
        self.abandoned = False
        self.left = False
        self.echo_checked = False
        self.unbelieved: tuple[int, ...] = ()
        self.reset()

    def reset(self) -> None:
        """Forget what the last try brought."""
        self.sent_at = 0.0
        self.got: dict[int, Reply] = {}
        self.ordered = 0  # so many came first and in the order due
        self.last: Reply | None = None
        self.put_aside: Reply | None = None
        self.noise: list[tuple[str, bytes]] = []
        self.spoiled = ""
        self.surplus = False
        self.settling = False
        self.complete = self.exchange.replies == ()

    @property
    def rank(self) -> Rank:
        return self.exchange.rank

    def take(self, reply: Reply) -> bool:
        """Is this one of the replies due? Keeps it if so."""
        dues = self.exchange.replies
        if dues is ANY:
            self.got[len(self.got)] = reply
            return True
        _, its, data = reply
        got, size = self.got, len(data)
        index = len(got)
        if index == self.ordered and index < len(dues) and dues[index][1:] == (its, size):
            self.ordered += 1  # the usual case, without a search
        else:
            for index, (_, key, length) in enumerate(dues):
                if key == its and length == size and index not in got:
                    break
            else:
                return False
        got[index] = self.last = reply
        self.complete = len(got) == len(dues) or bool(self.unbelieved and self._all_believed_here())
        return True

    def take_all(self, events: Sequence[Event], sent: Container[bytes]) -> bool:
        """Are these all the replies due, in order, and nothing came before? Keeps them if so: the usual case.

        None of them may look like what was `sent` lately. Everything else is looked at one by one.
        """
        exchange = self.exchange
        dues, lane = exchange.replies, exchange.lane
        if dues is ANY or exchange.rank is Rank.STOP or self.got or self.unbelieved:
            return False
        if not events or len(events) != len(dues):
            return False
        for event, due in zip(events, dues, strict=True):
            if type(event) is not Reply:
                return False
            its, key, data = event
            if its != lane or key != due[1] or len(data) != due[2] or data in sent:
                return False
        self.got = dict(enumerate(events))  # type: ignore[arg-type]  # all of them are replies
        self.ordered, self.last = len(dues), self.got[len(dues) - 1]
        self.complete = True
        return True

    def put_reply_aside(self) -> None:
        """The one reply is suspect: wait for another, but keep it."""
        ((_, self.put_aside),) = self.got.items()
        self.got, self.ordered, self.last, self.complete = {}, 0, None, False

    def take_back(self) -> None:
        """The reply put aside is the answer after all."""
        if self.put_aside is not None:
            self.take(self.put_aside)

    def _all_believed_here(self) -> bool:
        """A group does not wait for a node that is known to be silent."""
        dues = self.exchange.replies
        return dues is not ANY and all(
            index in self.got or due.node in self.unbelieved for index, due in enumerate(dues)
        )

    def passes_over(self, reply: Reply) -> bool:
        """Somebody says this who was asked with the others, and is not waited for."""
        dues, unbelieved = self.exchange.replies, self.unbelieved
        if dues is ANY or not unbelieved:
            return False
        told = reply.key, len(reply.data)
        return any(due.node in unbelieved and (due.key, due.length) == told for due in dues)

    def hear_noise(self, fault: str, data: bytes) -> None:
        """Bytes of nobody: in front of the first reply they do no harm, behind one they cast doubt on it.

        A reply that lost its place by one byte may look whole and leave its last byte behind.
        """
        if self.complete:
            self.surplus = True
        elif self.last is not None:
            self.disbelieve(self.last)
        self.noise.append((fault, data[:64]))
        del self.noise[:-16]

    def disbelieve(self, reply: Reply) -> None:
        """A node of this exchange sent something else: in a group it alone is lost, else the whole try."""
        dues = self.exchange.replies
        if dues is not ANY and len(dues) > 1:
            self.unbelieved += tuple(due.node for due in dues if due.key == reply.key)
            self.complete = self._all_believed_here()
        else:
            self.spoiled = self.spoiled or "unexpected"

    def answer(self, at: float) -> Answer:
        """What came, in the order due; a reply of a node that is not believed counts as missing."""
        dues = self.exchange.replies
        got = self.got
        if dues is ANY:
            return Answer(tuple(got.values()), (), at)
        if len(got) == len(dues) and not self.unbelieved:
            in_order = self.ordered == len(dues)
            return Answer(tuple(got.values() if in_order else [got[i] for i in range(len(dues))]), (), at)
        here = [i for i, due in enumerate(dues) if i in got and due.node not in self.unbelieved]
        missing = tuple(due.node for i, due in enumerate(dues) if i not in here)
        return Answer(tuple(got[i] for i in here), missing, at)


def all_taken(flying: Mapping[int, Flight], events: Sequence[Event], sent: Container[bytes]) -> bool:
    """The usual case: one exchange is in the air, and these are its replies, all of them and nothing else."""
    if len(flying) != 1:
        return False
    (flight,) = flying.values()
    return flight.take_all(events, sent)
