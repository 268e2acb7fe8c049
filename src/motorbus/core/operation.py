"""Procedures, the steps that they await, and the requests that they send.

A driver function is a coroutine (a procedure) that awaits *steps*; no event loop is involved. A step is a plain value:
the bus that runs the procedure (`bus/tasks.py`) carries it out. A function with a single request returns the
`Exchange` itself, which may be kept and run again. A procedure awaits nothing but steps and procedures.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator, Hashable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from enum import Enum, IntEnum
from inspect import CORO_CREATED, getcoroutinestate
from types import CoroutineType
from typing import Any, ClassVar, Final, Generic, NamedTuple, Self, TypeAlias, TypeVar

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


class Priority(IntEnum):
    """Priority among waiting exchanges: the lowest number leaves first."""

    STOP = 0
    CONTROL = 1
    POLL = 2
    CONFIGURATION = 3


class Effect(IntEnum):
    """Effect of a write; of several effects the highest number counts."""

    NONE = 0
    PERSISTENT = 1
    IDENTITY = 2
    TORQUE = 3
    MOTION = 4


class TimeoutClass(IntEnum):
    """Class of the time that a device takes before it replies; the family defines the seconds."""

    REPLY = 0
    SCAN = 1
    STORE = 2


class Expected(NamedTuple):
    """An expected reply: its node, the key that identifies it, and its exact length in bytes.

    A refusal is a reply, too; where it is shorter, the family pads it to this length, as CANopen does.
    """

    node: int
    key: Key
    length: int


class Any_(Enum):  # noqa: N801 - typing.Any is taken
    """The type of `ANY`: every reply before the deadline is part of the answer."""

    ANY = "any"


ANY: Final = Any_.ANY
EVERY_LANE: Final = -1
"""Lane of a request to all nodes of a bus where each node has its own lane. Its replies are `ANY`: it takes the replies
of any lane that no other exchange expects."""


class Reply(NamedTuple):
    """A frame that answers a request. `key` identifies it, `data` is the whole frame or the CAN data field."""

    lane: int
    key: Key
    data: bytes


class Notification(NamedTuple):
    """A frame that a device sent unsolicited: a report, an alarm, the end of a program.

    `at` is its arrival time (s, link clock), set by the bus.
    """

    node: int
    kind: str
    data: bytes
    at: float = 0.0


class Noise(NamedTuple):
    """Bytes that are no reply and no notice.

    `fault` is "framing" or "checksum": the bytes may be a damaged reply of a node that was asked recently. Or it is
    "foreign": a whole frame of other traffic. `lane` is the lane of the bytes, None if any node may have sent them.
    """

    data: bytes
    fault: str
    lane: int | None = None


Event: TypeAlias = Reply | Notification | Noise


class Response(NamedTuple):
    """The replies in the expected order, the nodes without a reply, and the arrival time (s, link clock)."""

    replies: tuple[Reply, ...]
    missing: tuple[int, ...]
    at: float


class Unlike(Enum):
    """The type of `UNLIKE`: the bytes are not exactly the expected replies, or need the general decoder."""

    UNLIKE = "unlike"


UNLIKE: Final = Unlike.UNLIKE
Whole: TypeAlias = "Callable[[Any, float], T | Unlike]"
"""(all received bytes, arrival time in s) -> value, or `UNLIKE` for the general decoder."""

Stops: TypeAlias = Callable[[int], int]
"""Node -> number of stops sent to it so far, stops to all nodes included."""
Refusal: TypeAlias = Callable[[Stops], MotorbusError | None]
"""The error if an exchange must not leave, None if it may."""


class Step(Generic[T_co]):
    """What a procedure awaits; the value of the `await` has the type of the step."""

    __slots__ = ()

    def __await__(self) -> Generator[Step[Any], Any, T_co]:
        value: T_co = yield self
        return value


@dataclass(slots=True, eq=False, repr=False)
class Exchange(Step[T_co]):
    """One request and its expected replies. A value: no field but `course` changes.

    `request`     the bytes or the CAN frame to send
    `replies`     one `Expected` per expected reply; () for none; `ANY` for all replies before the deadline
    `read`        answer -> value; None: the value is the `Response`. Matching of replies does not use it
    `lane`        exchanges on the same lane never overlap
    `effect`      highest effect of the rows that it writes
    `goals`       goal of each node, for the gate
    `repeatable`  sending it twice has the same effect as sending it once
    `later`       its goals wait in the node, or it makes waiting goals take effect
    `refusal`     checked before each attempt that moves or switches torque: the error if the exchange must not leave,
                  as after a stop or a change of settings
    `whole`       for an exchange that is kept: the value of `read`, decoded from the bytes of all expected replies if
                  each is valid and reports no alarm; else `UNLIKE`. `course` is the state that a bus keeps for it
    `other`       makes an equivalent exchange with replies of another length. The bus alternates where replies carry no
                  number, so that a second copy of the last reply is not taken for the next one
    `tells_position`  True: the replies begin with the present position, so a stop can hold it. A function: answer ->
                  position (rad) by node, without the nodes whose reply does not give it; the gate uses it
    """

    request: Final[Data]
    replies: Final[tuple[Expected, ...] | Any_] = ()
    read: Callable[[Response], T_co] | None = None
    _: KW_ONLY
    lane: Final[int] = 0
    rank: Final[Priority] = Priority.POLL
    effect: Final[Effect] = Effect.NONE
    goals: Final[tuple[Goal, ...]] = ()
    timeout: Final[TimeoutClass] = TimeoutClass.REPLY
    repeatable: Final[bool] = False
    tells_position: Final[bool | Callable[[Response], Mapping[int, float]]] = False
    refusal: Final[Refusal | None] = None
    later: Final[Later | None] = None
    other: Callable[[], Exchange[T_co]] | None = None
    whole: Whole[T_co] | None = None
    course: Any = field(default=None, init=False)

    aim: ClassVar[Any] = None
    sure: ClassVar[bool] = False
    """Every goal is within the limits that it carries, and none is an endless motion; see `Aimed`."""

    @property
    def ordered(self) -> Sequence[int]:
        """The nodes of the goals."""
        return [goal.node for goal in self.goals]

    def reading(self, read: Callable[[Response], T]) -> Exchange[T]:
        """The same request with another `read`, without `other` and `whole`."""
        own = ("request", "replies", "read", "other", "whole", "course")
        rest = [name for name in Exchange.__slots__ if name not in own]
        return Exchange(self.request, self.replies, read, **{name: getattr(self, name) for name in rest})

    def __repr__(self) -> str:
        text = self.request.hex(" ") if isinstance(self.request, bytes) else repr(self.request)
        return f"<Exchange {text}>"


@dataclass(slots=True, eq=False)
class Gather(Step[list[T_co]]):
    """Operations that overlap where the bus allows it; gives their results in order.

    An error in one does not end the others; an interruption (KeyboardInterrupt, MemoryError) ends all. After all have
    ended the first error is raised, with a note for each other; `catch()` around each gives errors as values.
    """

    operations: Sequence[Runnable[T_co]]


@dataclass(slots=True, eq=False)
class Exclusive(Step[T_co]):
    """An operation during which the bus sends nothing else, except a stop."""

    operation: Runnable[T_co]


@dataclass(slots=True, eq=False)
class Sleep(Step[float]):
    """Wait at least `seconds` on the link clock; gives the time (s) then. 0 only reads the clock."""

    seconds: Final[float]


@dataclass(slots=True, eq=False)
class WaitFor(Step["Notification | None"]):
    """Wait at most `until` seconds from this step on for a notice that `match` accepts; gives it, or None."""

    match: Final[Callable[[Notification], bool]]
    until: Final[float]


@dataclass(slots=True, eq=False)
class SetBitrate(Step[int]):
    """Set the rate of the link (bit/s) when nothing is in flight; gives the previous rate. 0 only reads it.

    With `listen_only` the link sends nothing until the next `SetBitrate`, not even the acknowledge bit of CAN: a bus of
    unknown rate is not disturbed. A serial link has no such bit.
    """

    rate: Final[int]
    listen_only: Final[bool] = False


class Progress(NamedTuple):
    """An event for `Emit`: `done` of `total` units of work, and the present activity."""

    done: int
    total: int
    what: str = ""


class JournalEntry(NamedTuple):
    """An event for `Emit` that must be on disk before the next step: the state of a guarded change.

    `change`  the verb that makes the change, as "set_id"
    `state`   ASKED    requested, conditions not yet checked; not stored, but refused while another change on the bus
                       is unfinished
              INTENT   the next step may change something
              OUTCOME  the change has ended; `facts["outcome"]` says how
              Any other word is a step that was reached.
    `facts`   of INTENT: plain data that suffices to finish or revert the change, with the id of the device as "node".
              For people, where the verb does not suffice: "what" is unfinished, its "cause", and "advice" ({bus} in
              it is replaced)
    """

    change: str
    state: str
    facts: dict[str, object]


ASKED: Final = "asked"
INTENT: Final = "intent"
OUTCOME: Final = "outcome"
REACHED: Final = "reached"  # in the facts of a resumed change: its states so far, in order
READABLE: Final = "readable"  # in the facts: True for a change that only reads or leaves readings valid


@dataclass(slots=True, eq=False)
class Emit(Step[None]):
    """Pass an event (progress, an early result, a journal record) to its observers before the next step."""

    event: Final[object]


@dataclass(slots=True, eq=False)
class Shielded(Step[T_co]):
    """A procedure into which no cancellation is thrown: it is raised at this `await` when the procedure has ended.

    For the end of a `Guard` only. From the time-out of the clean-up on its steps fail; see `bus/tasks.py`.
    """

    operation: Runnable[T_co]


Procedure: TypeAlias = Coroutine[Step[Any], Any, T]
Runnable: TypeAlias = "Coroutine[Step[Any], Any, T] | Step[T]"
"""What a bus runs: a procedure or a step."""


class Guard:
    """A guarded sequence for `async with`: `leave` follows `enter`, also when `enter` fails, for its first request may
    have arrived.

    Nothing is thrown into `leave`. A procedure that is dropped sends nothing: GeneratorExit never calls `leave`.
    """

    async def enter(self) -> None:
        """Begin the sequence."""

    async def leave(self, error: BaseException | None) -> None:
        """End the sequence; `error` is what is being raised."""
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        try:
            await self.enter()
        except GeneratorExit:
            raise
        except BaseException as error:
            await Shielded(self.leave(error))
            raise
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if not isinstance(error, GeneratorExit):
            await Shielded(self.leave(error))


class CleanUp(Guard):
    """A guarded sequence that ends with the procedure that this function makes."""

    def __init__(self, function: Callable[[], Runnable[object]]) -> None:
        self._function = function

    async def leave(self, error: BaseException | None) -> None:
        await self._function()


async def with_cleanup(runnable: Runnable[T], clean_up: Callable[[], Runnable[object]]) -> T:
    """Run `runnable`, then `clean_up()`, whatever is raised; see `Guard`."""
    async with CleanUp(clean_up):
        return await runnable


async def catch(runnable: Runnable[T]) -> T | MotorbusError:
    """Run `runnable`; a MotorbusError becomes the value, so that a loop can visit all nodes."""
    try:
        return await runnable
    except MotorbusError as error:
        return error


def discard(runnable: object) -> None:
    """Close a procedure that never starts, and those that it was given; Python warns of a coroutine that is dropped."""
    given: Iterable[object] = ()
    if isinstance(runnable, CoroutineType) and getcoroutinestate(runnable) == CORO_CREATED:
        given = tuple(runnable.cr_frame.f_locals.values()) if runnable.cr_frame else ()
        runnable.close()
    elif isinstance(runnable, list | tuple):
        given = runnable
    elif isinstance(runnable, Gather):
        given = runnable.operations
    elif isinstance(runnable, Exclusive | Shielded):
        given = (runnable.operation,)
    for one in given:
        discard(one)
