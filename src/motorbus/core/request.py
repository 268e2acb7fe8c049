"""Requests, the replies that they expect, and what a bus makes of received data.

A `Request` is a step: a procedure awaits it, see `core.steps`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from enum import Enum, IntEnum
from typing import Any, Final, Generic, NamedTuple, TypeAlias, TypeVar

from motorbus.core.can_frame import CanFrame
from motorbus.core.setpoint import Deferred, Setpoint
from motorbus.errors import MotorbusError, RequestError

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

Data: TypeAlias = bytes | CanFrame
Key: TypeAlias = Hashable


class Priority(IntEnum):
    """Priority among waiting requests: the lowest number leaves first."""

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
    """An expected reply: its node, the key that identifies it, and its exact length in bytes."""

    node: int
    key: Key
    length: int
    refusal: int = 0  # length of a refusal where that differs; 0: none, as for a probe
    refusals: tuple[Key, ...] = ()  # keys of a refusal of the same length, where those differ

    def accepts(self, key: Key, size: int) -> bool:
        """A reply with this key and number of bytes is this one."""
        if key == self.key:
            return size == self.length or 0 < size == self.refusal
        return size == self.length and key in self.refusals


class Any_(Enum):  # noqa: N801 - typing.Any is taken
    """The type of `ANY`: every reply before the deadline is part of the answer."""

    ANY = "any"


ANY: Final = Any_.ANY
EVERY_LANE: Final = -1
"""Lane of a request to all nodes of a bus where each node has its own lane. Its replies are `ANY`: it takes the replies
of any lane that no other request expects."""


class Reply(NamedTuple):
    """A frame that answers a request. `key` identifies it, `data` is the whole frame or the CAN data field."""

    lane: int
    key: Key
    data: bytes


class Notification(NamedTuple):
    """A frame that a device sent unsolicited: a report, an alarm, the end of a program."""

    node: int
    kind: str
    data: bytes
    at: float = 0.0  # arrival time (s, link clock), set by the bus


class Noise(NamedTuple):
    """Bytes that are no reply and no notice."""

    data: bytes
    fault: str
    """"framing" or "checksum": maybe a damaged reply of a node asked recently; "foreign": a frame of other traffic."""
    lane: int | None = None  # None if any node may have sent them


Event: TypeAlias = Reply | Notification | Noise


class Response(NamedTuple):
    """The replies in the expected order, the nodes without a reply, and the arrival time (s, link clock)."""

    replies: tuple[Reply, ...]
    missing: tuple[int, ...]
    at: float


ExactDecoder: TypeAlias = "Callable[[Any, float], T | None]"
"""(received bytes, arrival time in s) -> value; None unless they are exactly the expected replies without an alarm."""

Stops: TypeAlias = Callable[[int], int]
"""Node -> number of stops sent to it so far, stops to all nodes included."""
Precondition: TypeAlias = Callable[[Stops], MotorbusError | None]
"""The error if a request must not leave, None if it may."""


class Step(Generic[T_co]):
    """What a procedure awaits; the value of the `await` has the type of the step."""

    __slots__ = ()

    def __await__(self) -> Generator[Step[Any], Any, T_co]:
        try:
            value: T_co = yield self
        except RuntimeError as error:
            if not str(error).startswith("Task got bad yield"):  # of asyncio
                raise
            raise RequestError(
                f"{type(self).__name__} was awaited outside of a procedure", advice="use `await bus.run(...)`"
            ) from None
        return value


@dataclass(slots=True, eq=False, repr=False)
class Request(Step[T_co]):
    """One request and its expected replies. It is immutable, except for `attempt`, and may be sent again."""

    wire: Final[Data]
    expected: Final[tuple[Expected, ...] | Any_] = ()
    """One for each reply; () for none; `ANY` for all replies before the deadline."""
    decode: Callable[[Response], T_co] | None = None
    """Response -> value; None: the value is the `Response`. Matching of replies does not use it."""
    _: KW_ONLY
    lane: Final[int] = 0  # requests on the same lane never overlap
    priority: Final[Priority] = Priority.POLL
    effect: Final[Effect] = Effect.NONE  # highest effect of the registers that it writes
    setpoints: Final[tuple[Setpoint, ...]] = ()  # what it asks of each node, for the gate
    reply_within: Final[TimeoutClass] = TimeoutClass.REPLY
    repeatable: Final[bool] = False  # sending it twice has the same effect as sending it once
    reports_position: Final[bool | Callable[[Response], Mapping[int, float]]] = False
    """True: the replies begin with the present position, so a stop can hold it. A function, for the gate: response ->
    position (rad) by node, without the nodes whose reply does not give it."""
    precondition: Final[Precondition | None] = None
    """Checked before each attempt that moves or switches torque, as for stops or changed settings."""
    deferred: Final[Deferred | None] = None
    """Its setpoints wait in the node, or it makes waiting setpoints take effect."""
    decode_exact: ExactDecoder[T_co] | None = None
    """Fast path of `decode` for a request that is kept: decodes the bytes of all expected replies at once."""
    attempt: Any = field(default=None, init=False)  # that a bus keeps for a request with `decode_exact`

    @property
    def setpoint_nodes(self) -> Sequence[int]:
        """The nodes of the setpoints."""
        return [setpoint.node for setpoint in self.setpoints]

    def with_decoder(self, decode: Callable[[Response], T]) -> Request[T]:
        """The same request with another `decode`, without `decode_exact`."""
        given: Any = self
        changed: Request[T] = replace(given, decode=decode, decode_exact=None)
        return changed

    def convert(self, function: Callable[[T_co], T]) -> Request[T]:
        """The same request, whose value is `function` of the value of this one."""
        decode = self.decode
        if decode is None:
            raise RequestError(f"{self!r} has no decoder", advice="use with_decoder")
        return self.with_decoder(lambda response: function(decode(response)))

    def __repr__(self) -> str:
        text = self.wire.hex(" ") if isinstance(self.wire, bytes) else repr(self.wire)
        return f"<Request {text}>"


class SetpointGroup(NamedTuple):
    """The common part of `SetpointWrite`s: their nodes, the conversion of raw values to setpoints, the precondition."""

    nodes: Sequence[int]
    to_setpoints: Callable[[Sequence[int]], tuple[Setpoint, ...]]
    precondition: Precondition


class SetpointWrite(Request[None]):
    """A request of a control loop that moves several nodes and has no reply."""

    __slots__ = ("_raws", "group")

    def __init__(self, wire: Data, group: SetpointGroup, raws: Sequence[int]) -> None:
        super().__init__(
            wire,
            (),
            lambda _: None,
            priority=Priority.CONTROL,
            effect=Effect.MOTION,
            setpoints=group.to_setpoints(raws),
            precondition=group.precondition,
        )
        self.group: Final = group
        self._raws: Final = raws

    def with_group(self, group: SetpointGroup) -> SetpointWrite:
        """The same request with another group."""
        return SetpointWrite(self.wire, group, self._raws)
