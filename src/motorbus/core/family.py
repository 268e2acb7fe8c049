"""The contract between a family of devices and everything that is family-blind.

A family is a folder with four rooms (`wire`, `table`, `driver`, `simulator`) whose `__init__` says
`FAMILY = …`, an object that fulfils `Family`. Nothing above knows more of a family than this file says, and
`tests/conformance` is its executable definition of done.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple, Protocol

from motorbus.core.assurance import Assurance
from motorbus.core.capture import Captures
from motorbus.core.entry import Table, Value
from motorbus.core.operation import Answer, Data, Event, Exchange, Operation, Runnable


class Option(NamedTuple):
    """One option that a bus string or a flag may carry for this family: `name=value`.

    `choices` are all values it takes, () when that is not said; `source` is who says so, where somebody has to.
    """

    name: str
    kind: type
    default: object
    help: str
    choices: tuple[object, ...] = ()
    source: str = ""


class LinkNeeds(NamedTuple):
    """What a family asks of its link.

    `kind`      bytes or frames
    `rate`      the usual rate (bit/s), and `rates` those worth scanning
    `options`   of its simulator: what `sim,name=value` takes
    `settings`  of a bus, simulated or not: what `Family.configured` takes
    `window`    how many lanes may be in flight at once
    `only`      the id of the only device that a line of this family can have; None: there may be many
    `both_ways` a device hears while it speaks: a stop waits for no reply
    `stops`     what an emergency stop may do to an axis, `torque_off` or `hold`, the usual first; () where that cannot
                be said. Who has both takes a setting `estop_hold`, the ids of those that it holds
    `captures`  how a recording of its line is taken apart; None: as the receiver hears it
    """

    kind: str
    rate: int
    rates: tuple[int, ...] = ()
    options: tuple[Option, ...] = ()
    settings: tuple[Option, ...] = ()
    window: int = 1
    only: int | None = None
    both_ways: bool = False
    stops: tuple[str, ...] = ()
    captures: Captures | None = None


@dataclass(frozen=True, slots=True)
class Identity:
    """What a device says it is. `table` is "" when its firmware is unknown: readable then, never written."""

    node: int
    model: str
    firmware: str
    table: str
    details: Mapping[str, object] = field(default_factory=dict)


class Found(NamedTuple):
    """An event for `Report`, and what a scan returns: a node that answered, at which rate, and what it is."""

    node: int
    rate: int
    identity: Identity | None


class Readdressed(NamedTuple):
    """An event for `Report`: what is told to the id `new` is from now on, or soon, told to the device of `node`, too.

    `node` is None where nobody knows which device that is. It is told before anything of that is written.
    """

    node: int | None
    new: int


class Quality(Enum):
    """How far a sample can be trusted."""

    FRESH = "fresh"
    REPEATED = "repeated"
    CONFIRMED = "confirmed"
    SUSPECT = "suspect"


class State(NamedTuple):
    """One sample of a device in API units (rad, rad/s, fraction, A, V, °C); None where it does not tell.

    `at` is the arrival time on the link's clock in seconds, `alarm` the names of the alarm bits that are set.
    """

    at: float
    position: float | None = None
    velocity: float | None = None
    load: float | None = None
    current: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    moving: bool | None = None
    alarm: tuple[str, ...] = ()
    quality: Quality = Quality.FRESH


class Health(NamedTuple):
    """How a device fares, from one cheap exchange; what it does not tell is None, also in its `state`.

    `torque` whether its torque is on, None where it has no switch. `blank`: what it was told to keep until power-off is
    as power-up leaves it. `restarts` counts how often it has said that it starts anew, where it says so.
    """

    state: State
    torque: bool | None = None
    blank: bool | None = None
    restarts: int | None = None


class Positions(NamedTuple):
    """Positions in rad by id of all who answered, the ids of those who did not, and when (s on the link's clock)."""

    values: dict[int, float]
    missing: tuple[int, ...]
    at: float


class Train(Protocol):
    """Devices of one bus in a control loop, of which all is known that a cycle needs; see `Family.axis`.

    Its exchanges ask nothing but what they bring. Those on different lanes may be in flight at once. Until `begin` is
    carried out, or goals are sent, nothing is written. When settings of a device were written since through the same
    object, goals that were made before do not leave, and later ones are reckoned anew or raise RequestError.
    """

    @property
    def nodes(self) -> tuple[int, ...]:
        """Their ids, in the order they were given."""

    @property
    def positions(self) -> Sequence[Exchange[Positions]]:
        """What together brings all positions; may be kept and run again.

        Each tells of some of the nodes, and who is silent is among its missing; one that asks a single node raises
        NoReply then.
        """

    def goals(self, to: Mapping[int, float]) -> Sequence[Exchange[Any]]:
        """What orders these goals (rad), for some or all of them; the gate judges them when it leaves.

        Raises LimitExceeded for what is no finite number or what no device of this kind could be told, RequestError for
        a node that is none of these.
        """

    def begin(self, speeds: Mapping[int, float]) -> Operation[None]:
        """Make these ready to be led: torque on without a jump, and each as quick in following as it can be, but not
        quicker than its speed (rad/s, above 0) where it can be told that, rounded up to what it can be told.

        Who has no torque switch holds where it stands. Everyone is visited; then the first error is raised, with a note
        for each other. Errors as `enable_torque`.
        """


class Stop(NamedTuple):
    """Frames that stop the nodes, in order, and what an acknowledgement of them promises."""

    exchanges: tuple[Exchange[Answer], ...]
    promise: str


class Part(NamedTuple):
    """One field of a frame: where it starts, its bytes, what it is called and what it says."""

    start: int
    data: bytes
    name: str
    meaning: str


class Explanation(NamedTuple):
    """One frame, or a run of bytes that is none: `fault` is "" for a good frame, else why it is bad."""

    data: bytes
    title: str
    parts: tuple[Part, ...]
    fault: str = ""


class Receiver(Protocol):
    """Turns what a link delivers into events. Never raises on any input, never holds more than 4 KiB.

    Every byte that is fed comes out in exactly one event.
    """

    @property
    def held(self) -> int:
        """How many bytes wait for more before anything can be made of them."""

    def feed(self, data: Data, /) -> list[Event]:
        """Take bytes (cut anywhere) or one CAN frame; give what is complete."""

    def flush(self) -> list[Event]:
        """Nothing more is coming: give what can be made of the rest, and the remainder as noise."""


class RawMemory(Protocol):
    """The raw value of every row by its name."""

    def __getitem__(self, name: str, /) -> int: ...


class Remark(NamedTuple):
    """What a simulated device notes and tells no host: what it ignored, what a fault has done.

    `number` counts its remarks from 1, `at` is s since the simulation began, as in a script of inputs.
    """

    number: int
    at: float
    text: str


class SimulatedNode(Protocol):
    """One simulated device, as a test or a control socket pokes it. `memory` is what it holds at this moment.

    What only some have: `set_input(number, active)`. `log`, their latest `Remark`s in order. `notice()`, which lets the
    device say what it says unasked although nothing has caused it. `switch(**changes)`, which changes switches while it
    runs, as far as that makes sense, and gives all such switches as they are then; for an impossible name or value it
    raises RequestError and has changed nothing. `midway()`, when (s) the step by which it stores something is half
    done, infinity while it stores nothing: a power cut at that moment tears what is stored.
    `block_shaft(between)`, `push_shaft(angle)`, `load_shaft(share)`, `release_shaft()` take rad, and 1 for full torque.
    """

    @property
    def memory(self) -> RawMemory: ...

    def unplug(self) -> None: ...
    def plug(self) -> None: ...
    def power_cycle(self) -> None: ...
    def status(self) -> dict[str, object]: ...


class Simulator(Protocol):
    """A simulated bus. Time comes in as an argument (seconds); it never waits and has no clock of its own.

    One whose devices are set to another rate than most of their family may tell it as `usual_rate` (bit/s). One whose
    devices have inputs takes what happens there as `script(text)`. One on whose line there may be two devices with one
    id takes `duplicate(id)`: then there are two. One on CAN tells by `audience(frame)` whom that is for (`core.frame`).
    """

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]: ...

    def receive(self, data: Data, at: float) -> None:
        """The host's bytes, or one frame, have arrived completely at this moment."""

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Everything the devices begin to send up to this moment, each with its own moment, in order."""

    def due(self) -> float | None:
        """The next moment something happens by itself, or None."""

    def tune(self, rate: int) -> None:
        """The host's rate; devices set to another one neither hear nor are heard."""


class Device(Protocol):
    """The verbs that faces may expect of a blocking device; a verb a device lacks is absent, never raises.

    `read(*names)` gives values by name, `write(**values)` takes them. What moves also has `position`, `telemetry`
    (a `State`), `enable_torque`, `disable_torque`, `stop` and `move(to, *, wait=True)`; `move` may take `velocity` and
    `acceleration`. What has modes also has `mode()` and `set_mode(mode)`, and of `set_velocity`, `set_duty`,
    `set_current` and `step` those that some model of the family heeds. What can be given a zero has
    `calibrate(to=None)` (rad; None: the middle) and `zero()`, and both give a named tuple whose floats are angles and
    whose whole numbers are raw; `alarms()`, where it is there, gives each alarm that is set in words. Persistent rows
    are written through a guarded sequence; where that opens a lock, the lock is a row named `lock` with a choice called
    "closed", and it is closed again whatever happens. `table` is its register map once that is known (None before),
    `value(row, raw)` and `raw(row, value)` convert with the factors of this very device. Reading has rank POLL and
    effect NONE, so a dry run can tell it from what changes something.
    """

    @property
    def node(self) -> int: ...
    @property
    def alarm(self) -> tuple[str, ...]: ...
    @property
    def ping(self) -> Callable[[], bool]: ...
    @property
    def identify(self) -> Callable[[], Identity]: ...
    @property
    def read(self) -> Callable[..., dict[str, Value]]: ...
    @property
    def write(self) -> Callable[..., None]: ...


class Devices(NamedTuple):
    """The verb classes of a family, each called with a bus and a node id; `assures` is what these devices give to
    whoever relies on them, None where the family does not say."""

    blocking: Callable[[Any, int], Any]
    awaiting: Callable[[Any, int], Any]
    assures: Assurance | None = None


class Family(Protocol):
    """What motorbus knows of a family: eighteen members, no state (but see `configured`)."""

    @property
    def name(self) -> str:
        """The word before the colon in a bus address."""

    @property
    def link(self) -> LinkNeeds: ...

    @property
    def tables(self) -> Mapping[str, Table]:
        """Every register map by its name."""

    def configured(self, **settings: object) -> Family:
        """This family as one bus speaks it, by its `link.settings`; one per open bus, and it may keep what that bus
        has taught it. Without settings of its own a family gives itself. Raises RequestError for impossible ones.
        """

    @property
    def devices(self) -> Devices: ...

    def lane(self, node: int) -> int:
        """The lane of this node; a family on a half-duplex line has one."""

    def air_time(self, exchange: Exchange[Any], rate: int) -> float:
        """Seconds on the wire for the request and every reply due, gaps of the protocol included."""

    def turnaround(self, exchange: Exchange[Any]) -> float:
        """The longest time the devices may think before and between their replies, by `exchange.timeout`."""

    def quiet_time(self, rate: int) -> float:
        """Seconds a node must have been left alone before it is probed again after a doubtful exchange."""

    def echo_test(self) -> Exchange[Any] | None:
        """An exchange whose echo cannot be taken for its answer, sent when a bus is opened; None: cannot echo."""

    def explain(self, data: bytes) -> list[Explanation]:
        """Every frame in these bytes, field by field, and why a bad one is bad.

        A CAN frame stands in a run of bytes as `CanFrame.flat()` says.
        """

    def receiver(self) -> Receiver: ...

    def probe(self, node: int, attempt: int) -> Exchange[bool]:
        """A harmless exchange with a known answer; its value says whether the answer was right.

        Attempts with different numbers differ in the key or in the length of their reply, and none of them
        can be confused with its own echo.
        """

    def stop(self, nodes: Mapping[int, Answer | None]) -> Stop:
        """Stop these nodes; each comes with its last answer that told a position, if there was one."""

    def identify(self, node: int) -> Runnable[Identity]: ...

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Operation[list[Found]]:
        """Look for devices by unicast; () means every id, or the present rate, which is set again in the end.

        Reports `Progress`, and `Found` as soon as one answers, perhaps before it was asked what it is.
        """

    def axis(self, model: str) -> Mapping[str, Callable[..., Runnable[Any]]]:
        """What devices of this model can do, by name, in SI units; empty when it has none. What is absent it cannot do.

        Each is called with a device (what `devices` makes) and gives an operation, but `train`. They are

            state position velocity load current voltage temperature    what it tells: a `State`, else a number
            health(device)                      how it fares, a `Health`: of a known device an exchange that can be kept
            enable_torque(device)  disable_torque(device)               without a jump; limp
            move(device, to, *, wait)  stop(device)                     to rad; decelerate and stay, gives a promise
            move_by(device, angle, *, velocity, wait)                   by rad from where it stands
            jog(device, velocity, seconds)  home(device, *, deadline)   for a while; to its switch
            run(device, number, *, timeout)                             a program that is stored in it
            limits(device)                      its own lowest and highest position, rad; read when not known
            travel(device)                      between which positions, rad, any limits of it must lie; None: not known
            cap_torque(device, fraction)  cap_current(device, ampere)   bound what it pushes with, until power-off
            train(devices, *, rate) -> Operation[Train]                 several, to be led in a loop; rate in bit/s
            keep_time(device, angle, timing, *, velocity, acceleration) -> Operation[Turned]
                by rad from where it stands, by a profile of its own, as long as others take; at most so fast (rad/s)
                and so steep (rad/s²), where it can be told
        """

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        """A simulated bus with these nodes; "" is the family's usual model."""
