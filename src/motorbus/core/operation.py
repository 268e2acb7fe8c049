"""How work is said, so that it can be said once and run blocking or async.

A driver function is a generator (an `Operation`) that yields *steps* and returns its answer. There are seven steps and
no others. A step is a plain value: the bus that runs the operation (`bus/tasks.py`) decides when and how. One
that needs a single exchange returns the `Exchange` itself, which may be kept and run again.

Each step is iterable so that `value = yield from step` has a type; the bare `yield` occurs in this file only.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from enum import Enum, IntEnum
from typing import Any, Final, Generic, NamedTuple, TypeAlias, TypeVar

from motorbus.core.frame import ERROR_FLAG as ERROR_FLAG
from motorbus.core.frame import REMOTE_FLAG as REMOTE_FLAG
from motorbus.core.frame import CanFrame as CanFrame
from motorbus.core.goal import Goal as Goal
from motorbus.core.goal import Later
from motorbus.errors import MotorbusError

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

Data: TypeAlias = bytes | CanFrame
Key: TypeAlias = Hashable


class Rank(IntEnum):
    """Who goes first when several exchanges wait: the lower the earlier."""

    STOP = 0
    CONTROL = 1
    POLL = 2
    CONFIGURATION = 3


class Effect(IntEnum):
    """What carrying out a write does to the world; the greatest of several counts."""

    NONE = 0
    PERSISTENT = 1
    IDENTITY = 2
    TORQUE = 3
    MOTION = 4


class Timeout(IntEnum):
    """How long the device itself may take before it answers; the family gives the seconds."""

    REPLY = 0
    SCAN = 1
    STORE = 2


class Due(NamedTuple):
    """One reply that an exchange calls for: from which node, recognised by which key, how many bytes exactly.

    A refusal is a reply too: where it is shorter, the family's `wire` pads it to this length, as CANopen does.
    """

    node: int
    key: Key
    length: int


class Any_(Enum):  # noqa: N801 - typing.Any is taken
    """The type of `ANY`: every reply that comes until the deadline is part of the answer."""

    ANY = "any"


ANY: Final = Any_.ANY
EVERY_LANE: Final = -1
"""The lane of an exchange that addresses everyone on a bus where each node has a lane of its own; its replies are
`ANY`: it takes each that nobody else awaits, on whatever lane it comes."""


class Reply(NamedTuple):
    """A frame that answers some request. `key` tells which, `data` is the whole frame or the CAN data field."""

    lane: int
    key: Key
    data: bytes


class Notice(NamedTuple):
    """A frame the device sent on its own account: a report, an alarm, the end of a program.

    `at` is when it arrived, s on the link's clock; the bus fills it in.
    """

    node: int
    kind: str
    data: bytes
    at: float = 0.0


class Noise(NamedTuple):
    """Bytes that belong to nobody, and why.

    `fault` is framing or checksum, which cast doubt on whoever was asked lately, or foreign, which does not: a whole
    frame of other traffic. `lane` confines the doubt to one lane; None means that anyone may have sent it.
    """

    data: bytes
    fault: str
    lane: int | None = None


Event: TypeAlias = Reply | Notice | Noise


class Answer(NamedTuple):
    """What came back: the replies in the order they were due, the nodes that did not answer, and when (s)."""

    replies: tuple[Reply, ...]
    missing: tuple[int, ...]
    at: float


class Unlike(Enum):
    """The type of `UNLIKE`: these bytes are not exactly the replies due, or not as they usually are."""

    UNLIKE = "unlike"


UNLIKE: Final = Unlike.UNLIKE
Whole: TypeAlias = "Callable[[Any, float], T | Unlike]"
"""What all that came, and when (s), says at once; `UNLIKE` where it must be looked at piece by piece."""

Stops: TypeAlias = Callable[[int], int]
"""How many stops have left for a node by now, those for everybody included."""
Refusal: TypeAlias = Callable[[Stops], MotorbusError | None]
"""Why an exchange must not leave after all, None when it may."""


class Exchange(Generic[T_co]):
    """One request and the replies, or the silence, it calls for. A value: never changed after it is made.

    `request`     the bytes or the CAN frame to send
    `replies`     one `Due` for each reply; empty when none is due; `ANY` for all that come until the deadline
    `read`        answer -> value; None gives the `Answer` itself. Matching never looks at it, so an exchange
                  without it is plain data
    `lane`        two exchanges on one lane never overlap
    `rank`        who goes first
    `effect`      the greatest effect of the rows it writes
    `goals`       what it orders, per node, for the gate
    `later`       its goals wait where it brings them, or it lets those begin that wait; None: neither
    `timeout`     how long the device may think
    `repeatable`  sending it twice does no more than sending it once
    `tells_position`  the replies begin with the present position, so stop can hold it. As a function it says where that
                  is (rad, by node; none for whom nobody can tell), so the gate can judge by it
    `refusal`     asked just before it leaves, at every try, where it moves or switches torque: the error for which it
                  must not, None when it may. So what was ordered under other settings, or before a stop, never leaves
    `whole`       of one that is kept: what `read` makes of the answer, straight from all the bytes of the replies due,
                  when each is sound and tells no alarm; else `UNLIKE`. `course` is what a bus keeps of it
    `other`       makes one that says the same and has replies of another length: where replies carry no number, taking
                  turns keeps a second copy of the last one from being taken for the next
    """

    __slots__ = (
        "course",
        "effect",
        "goals",
        "lane",
        "later",
        "other",
        "rank",
        "read",
        "refusal",
        "repeatable",
        "replies",
        "request",
        "tells_position",
        "timeout",
        "whole",
    )

    aim: Any = None
    sure = False
    """Every goal of it lies within the limits that it brings, and moves nothing without an end: see `Aimed`."""

    def __init__(
        self,
        request: Data,
        replies: tuple[Due, ...] | Any_ = (),
        read: Callable[[Answer], T_co] | None = None,
        *,
        lane: int = 0,
        rank: Rank = Rank.POLL,
        effect: Effect = Effect.NONE,
        goals: tuple[Goal, ...] = (),
        timeout: Timeout = Timeout.REPLY,
        repeatable: bool = False,
        tells_position: bool | Callable[[Answer], Mapping[int, float]] = False,
        refusal: Refusal | None = None,
        later: Later | None = None,
        other: Callable[[], Exchange[T_co]] | None = None,
        whole: Whole[T_co] | None = None,
    ) -> None:
        self.request: Final = request
        self.replies: Final = replies
        self.read: Final = read
        self.lane: Final = lane
        self.rank: Final = rank
        self.effect: Final = effect
        self.goals: Final = goals
        self.timeout: Final = timeout
        self.repeatable: Final = repeatable
        self.tells_position: Final = tells_position
        self.refusal: Final = refusal
        self.later: Final = later
        self.other: Final = other
        self.whole: Final = whole
        self.course: Any = None

    @property
    def ordered(self) -> Sequence[int]:
        """The nodes of its goals."""
        return [goal.node for goal in self.goals]

    def reading(self, read: Callable[[Answer], T]) -> Exchange[T]:
        """The same request, whose answer is read in another way."""
        own = ("request", "replies", "read", "other", "whole", "course")
        rest = [name for name in Exchange.__slots__ if name not in own]
        return Exchange(self.request, self.replies, read, **{name: getattr(self, name) for name in rest})

    def __iter__(self) -> Generator[Step, Any, T_co]:
        value: T_co = yield self
        return value

    def __repr__(self) -> str:
        shown = self.request.hex(" ") if isinstance(self.request, bytes) else repr(self.request)
        return f"<Exchange {shown}>"


class Together(Generic[T_co]):
    """Operations that may overlap where the bus allows it; results in order.

    One failure does not stop the others, an interruption in one (KeyboardInterrupt, want of memory) ends them all. When
    all have ended the first error is raised, with a note for each other; `outcome()` around each makes them values.
    """

    __slots__ = ("operations",)

    def __init__(self, operations: Sequence[Runnable[T_co]]) -> None:
        self.operations: Final = operations

    def __iter__(self) -> Generator[Step, Any, list[T_co]]:
        values: list[T_co] = yield self
        return values


class Alone(Generic[T_co]):
    """An operation during which nothing else but a stop goes onto the bus."""

    __slots__ = ("operation",)

    def __init__(self, operation: Runnable[T_co]) -> None:
        self.operation: Final = operation

    def __iter__(self) -> Generator[Step, Any, T_co]:
        value: T_co = yield self
        return value


class Pause:
    """Let at least `seconds` pass on the link's clock; gives the moment (s) it is over. 0 only asks what time it is."""

    __slots__ = ("seconds",)

    def __init__(self, seconds: float) -> None:
        self.seconds: Final = seconds

    def __iter__(self) -> Generator[Step, Any, float]:
        moment: float = yield self
        return moment


class Listen:
    """Wait for a notice that `match` accepts, at most `until` seconds from this step on; None when none came."""

    __slots__ = ("match", "until")

    def __init__(self, match: Callable[[Notice], bool], until: float) -> None:
        self.match: Final = match
        self.until: Final = until

    def __iter__(self) -> Generator[Step, Any, Notice | None]:
        notice: Notice | None = yield self
        return notice


class Tune:
    """Set the rate of the link, in bit/s, once nothing is in flight; gives the rate it had. 0 only asks.

    With `listen_only` the link sends nothing, not even the acknowledge bit of CAN, until it is tuned again: so a bus of
    unknown rate is not disturbed. A serial link is silent anyway while nothing is sent.
    """

    __slots__ = ("listen_only", "rate")

    def __init__(self, rate: int, listen_only: bool = False) -> None:
        self.rate: Final = rate
        self.listen_only: Final = listen_only

    def __iter__(self) -> Generator[Step, Any, int]:
        before: int = yield self
        return before


class Progress(NamedTuple):
    """An event for `Report`: `done` of `total` units of work, and what is being done."""

    done: int
    total: int
    what: str = ""


class Journal(NamedTuple):
    """An event for `Report` that must be on disk before the next step: how far a guarded change has come.

    `change`  the verb that makes it, as "set_id"
    `state`   ASKED: it is wanted, and its conditions are about to be checked; nothing is kept, but a bus on which
              another change is unfinished refuses. INTENT: from the next step on something may be changed; `facts` are
              all that is needed to finish it or to take it back, as plain data, the id of the device as "node", and
              for people, where the verb tells too little, "what" is unfinished, its "cause", and "advice" ({bus}).
              Any other word: a step that has been reached. OUTCOME: it is over, `facts["outcome"]` says how
    """

    change: str
    state: str
    facts: dict[str, object]


ASKED: Final = "asked"
INTENT: Final = "intent"
OUTCOME: Final = "outcome"
REACHED: Final = "reached"  # among the facts of a change that is taken up again: its states so far, in order
READABLE: Final = "readable"  # True among the facts of a change that leaves readings true, or that only reads


class Report:
    """Hand an event (progress, an early result, a journal record) to whoever listens, before the next step."""

    __slots__ = ("event",)

    def __init__(self, event: object) -> None:
        self.event: Final = event

    def __iter__(self) -> Generator[Step, Any, None]:
        yield self


Step: TypeAlias = "Exchange[Any] | Together[Any] | Alone[Any] | Pause | Listen | Tune | Report"
Operation: TypeAlias = Generator[Step, Any, T]
Runnable: TypeAlias = "Generator[Step, Any, T] | Exchange[T]"


class Closed(BaseException):
    """Raised in an operation whose coroutine was closed: settings are given back, and no motion is ordered."""


def outcome(runnable: Runnable[T]) -> Operation[T | MotorbusError]:
    """Carry out `runnable`; an error of ours becomes the value, so that a loop can visit everyone."""
    try:
        return (yield from runnable)
    except MotorbusError as error:
        return error


def afterwards(runnable: Runnable[T], clean_up: Callable[[], Runnable[object]]) -> Operation[T]:
    """Carry out `runnable`, then `clean_up()`, whatever happens: an unlock is always followed by a lock.

    An error, or an interruption or two at any line, is raised when that is over. It must be harmless to repeat.
    """
    tries: list[str] = []
    try:
        try:
            try:
                return (yield from runnable)
            finally:
                yield from _insist(clean_up, tries)
        finally:
            if not tries:  # an interruption fell between the lines above
                yield from _insist(clean_up, tries)
    finally:
        if not tries:  # and a second one
            yield from _insist(clean_up, tries)


def _insist(clean_up: Callable[[], Runnable[object]], tries: list[str]) -> Operation[None]:
    try:
        yield from clean_up()
    except MotorbusError:
        tries.append("failed")
        raise
    except BaseException:
        yield from clean_up()
        tries.append("interrupted")
        raise
    tries.append("done")
