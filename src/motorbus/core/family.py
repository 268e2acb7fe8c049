"""The contract between a device family and the code that works with any family.

The `__init__` of a family defines `FAMILY`, a `Family`: facts, and functions that make its parts. `FAMILY.open()` makes
a `BusDriver` for one open bus; an `AxisDriver` is what one kind of device can do. Other packages use only what this
module describes; `tests/conformance` tests it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from importlib import import_module
from math import inf
from typing import Any, NamedTuple, Protocol

from motorbus.core.recording import ABSENT, RecordingReceiver
from motorbus.core.register import RegisterMap
from motorbus.core.request import Data, Event, Request, Response
from motorbus.core.steps import Procedure, Runnable
from motorbus.errors import RequestError


class Option(NamedTuple):
    """An option `name=value` of a family, in a bus string or a flag."""

    name: str
    kind: type
    default: object
    help: str
    choices: tuple[object, ...] = ()  # all valid values; () if not listed
    source: str = ""  # where the simulated behaviour is documented, or that it is assumed
    span: tuple[float, float] = (0.0, inf)  # range of a number without choices


class LinkSpec(NamedTuple):
    """Facts of a family that are needed before a bus is opened."""

    kind: str  # "bytes" or "frames"
    rate: int  # bit/s by default
    rates: tuple[int, ...] = ()  # bit/s that a device may have, for a scan of all rates
    settings: tuple[Option, ...] = ()  # of a bus, simulated or not: arguments of `Family.open`
    only: int | None = None  # id of the only device on a line of this family; None: several are possible
    stops: tuple[str, ...] = ()
    """Possible actions of an emergency stop on an axis, "torque_off" and "hold", the default first; () if unknown. A
    family with both has a setting `estop_hold`: the ids that an emergency stop holds."""


@dataclass(frozen=True, slots=True)
class Identity:
    """The identity that a device reports. `table` is "" for unknown firmware: the device is never written."""

    node: int
    model: str
    firmware: str
    table: str
    details: Mapping[str, object] = field(default_factory=dict)


class Found(NamedTuple):
    """A node found by a scan, its rate (bit/s) and identity (None: unknown); also an event for `Emit`."""

    node: int
    rate: int
    identity: Identity | None


class IdChanged(NamedTuple):
    """An event for `Emit` before the first write that gives a device another id: `new` may reach it from now on."""

    node: int | None  # None if the device is unknown
    new: int


class State(NamedTuple):
    """One sample of a device in API units (rad, rad/s, fraction, A, V, °C); None for values it does not report."""

    at: float  # arrival time (s, link clock)
    position: float | None = None
    velocity: float | None = None
    load: float | None = None
    current: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    moving: bool | None = None
    alarm: tuple[str, ...] = ()  # names of the alarm bits that are set
    refused: tuple[str, ...] = ()  # errors of values that the device refused; they are None


class Health(NamedTuple):
    """Health of a device, from one short request. Values that it does not report are None, in `state` too."""

    state: State
    torque: bool | None = None  # torque is on; None without a torque switch
    blank: bool | None = None  # volatile settings have their power-up values, as after a restart
    restarts: int | None = None  # number of start-up messages received from the device


class Positions(NamedTuple):
    """Positions (rad) by id, the ids without a reply, and the arrival time (s, link clock)."""

    values: dict[int, float]
    missing: tuple[int, ...]
    at: float


class PositionStream(Protocol):
    """Devices of one bus in a control loop, with all data that a cycle needs; made by `AxisDriver.stream`.

    Its requests can run without reading anything first. Those on different lanes may be in flight at once. Before
    `start` runs or goals are sent, nothing is written. If settings of a device are written through the object that
    `stream` was given, goal requests made before are refused; `goals` then uses the new settings or raises
    RequestError.
    """

    @property
    def nodes(self) -> tuple[int, ...]:
        """The ids, in the given order."""

    @property
    def positions(self) -> Sequence[Request[Positions]]:
        """Requests that together read all positions; may be kept and run again.

        A request that reads several nodes lists silent ones as missing; a request for one node raises NoReply.
        """

    def goals(self, to: Mapping[int, float]) -> Sequence[Request[Any]]:
        """Requests that send these goals (rad) to some or all nodes; the gate checks them when they leave.

        Raises LimitExceeded for a goal that is not finite or that no device of this kind can take, RequestError for
        a node that is not one of these.
        """

    def start(self, speeds: Mapping[int, float]) -> Procedure[None]:
        """Prepare every node for goals: torque on without a jump.

        `speeds` gives a maximum tracking speed (rad/s, above 0) for some nodes. A device rounds it up to a value that
        it supports; a device without such a setting ignores it. A device without torque switch holds its position.
        Every node is visited, then the first error is raised, with a note for each other. Errors as `enable_torque`.
        """


class SelfTimedMove(Protocol):
    """A move that a device makes by a profile of its own, in one order; made by `AxisDriver.plan_move`.

    The device reports no position while it moves: all values are estimates. Nothing is written before `prepare` runs.
    An angle of 0 (less than a step of the device) is neither prepared nor started.
    """

    @property
    def angle(self) -> float:
        """The whole signed movement (rad) in the steps of the device."""

    @property
    def shortest(self) -> float:
        """The shortest duration (s) within its velocity and acceleration."""

    def fit(self, duration: float) -> float:
        """The nearest possible duration (s) that is not shorter than `duration`; the longest if all are shorter."""

    def prepare(self, duration: float) -> Procedure[None]:
        """Write what the move needs, for a duration that `fit` gave."""

    @property
    def start(self) -> Request[Any]:
        """The request that starts the prepared move. It leaves once, in a slot of the caller."""

    def position(self, elapsed: float) -> float:
        """The angle (rad) done `elapsed` s after the start."""

    def finish(self) -> Procedure[None]:
        """Wait for the end, unless it was stopped or not started, and give back what `prepare` borrowed.

        Called once more after each failure, of `prepare` or of another axis too; then it may have nothing to do. Raises
        Interrupted after a stop.
        """


class Stop(NamedTuple):
    """Requests that stop the nodes, in order, and what their acknowledgement promises."""

    requests: tuple[Request[Any], ...]
    promise: str


class Part(NamedTuple):
    """One field of a frame: its offset, bytes, name and meaning."""

    start: int
    data: bytes
    name: str
    meaning: str


class Explanation(NamedTuple):
    """One frame, or a run of bytes that is not a frame: `fault` is "" for a valid frame, else the reason."""

    data: bytes
    title: str
    parts: tuple[Part, ...]
    fault: str = ""
    kind: str = ""  # of a CAN frame, with `node` and `code`: see `core.recording.RecordedFrame`; "" for noise
    node: int = ABSENT
    code: int = ABSENT


class Receiver(Protocol):
    """Parses data from a link into events. Never raises on any input, never holds more than 4 KiB.

    Every byte that is fed is part of exactly one event.
    """

    @property
    def held(self) -> int:
        """Number of bytes of an incomplete frame."""

    def feed(self, data: Data, /) -> list[Event]:
        """Take a chunk of bytes, or one CAN frame; return the events that are complete."""

    def flush(self) -> list[Event]:
        """End of data: return the frames in the held bytes, and the remainder as noise."""


class Remark(NamedTuple):
    """A note of a simulated device that no host receives: what it ignored, what a fault did."""

    number: int  # from 1
    at: float  # s since the start of the simulation, as in a script of inputs
    text: str


class SimulatedNode(Protocol):
    """One simulated device, for tests and the control socket. `memory` holds its present values.

    Some devices also have

        set_input(number, active)
        log                the latest `Remark`s, in order
        notice()           sends an unsolicited message without a cause
        switch(**changes)  changes switches at run time, where possible, and returns all of these; RequestError for an
                           invalid name or value, without a change
        midway()           moment (s) when half of a store operation is done, inf if none runs: a power cut at that
                           moment leaves the stored data incomplete
        voltage, temperature   may be set: its supply (V), its temperature (°C)
        block_shaft(between) push_shaft(angle) load_shaft(share) release_shaft()    in rad; a share of 1 is full torque
    """

    @property
    def memory(self) -> Any: ...

    def unplug(self) -> None: ...
    def plug(self) -> None: ...
    def power_cycle(self) -> None: ...
    def status(self) -> dict[str, object]: ...


class Simulator(Protocol):
    """A simulated bus. Time is an argument (s): it never waits and has no clock.

    Some simulators also have `usual_rate` (bit/s; the rate of the devices, if not the default of the family),
    `script(text)` (inputs of the devices), `duplicate(id)` (adds a second device with this id) and, on CAN,
    `audience(frame)` (its receivers, a `core.can_frame.Audience`).
    """

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]: ...

    def receive(self, data: Data, at: float) -> None:
        """Take bytes of the host, or one frame, whose last bit arrives at this moment (s)."""

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Return all data that the devices start to send up to this moment (s), each with its moment, in order."""

    def due(self) -> float | None:
        """The next moment (s) at which a device acts by itself, or None."""

    def tune(self, rate: int) -> None:
        """Set the rate (bit/s) of the host; devices set to another rate neither receive nor are received."""


class DeviceTypes(NamedTuple):
    """Device classes of a family, called with a bus and a node id."""

    blocking: Callable[[Any, int], Any]
    awaiting: Callable[[Any, int], Any]


def unsupported(*args: object, **kwargs: object) -> Any:
    """The function of a capability that a device does not have."""
    raise RequestError("the device does not support this")


@dataclass(frozen=True, kw_only=True)
class AxisDriver:
    """What devices of one model can do, in SI units; a family gives those that the model supports.

    Each is a function of a device (see `DeviceTypes`), several for `stream`, and returns a procedure or a step.
    `name in driver` tests for one. Others raise RequestError when called.
    """

    state: Callable[[Any], Runnable[State]] = unsupported
    position: Callable[[Any], Runnable[float]] = unsupported
    health: Callable[[Any], Runnable[Health]] = unsupported
    """For an identified device a request that can be kept."""
    enable_torque: Callable[[Any], Runnable[None]] = unsupported  # torque on without a jump
    disable_torque: Callable[[Any], Runnable[Any]] = unsupported
    move: Callable[..., Runnable[Any]] = unsupported  # move(device, to, *, wait): to a position (rad)
    stop: Callable[[Any], Runnable[Any]] = unsupported
    """Decelerate and hold; returns a promise, an Enum whose name begins with HOLD, see `Stop`."""
    jog: Callable[..., Runnable[Any]] = unsupported  # jog(device, velocity, seconds): turn for a time
    home: Callable[..., Runnable[Any]] = unsupported  # home(device, *, deadline): to the home switch
    run: Callable[..., Runnable[Any]] = unsupported  # run(device, number, *, timeout): a stored program
    limits: Callable[[Any], Runnable[tuple[float, float]]] = unsupported
    """Lowest and highest position (rad) in its settings; read if unknown."""
    cap_torque: Callable[[Any, float], Runnable[Any]] = unsupported
    """Limit of the torque (fraction) until power-off."""
    stream: Callable[..., Runnable[PositionStream]] = unsupported
    """stream(devices, *, rate): for a control loop; rate in bit/s."""
    set_velocity: Callable[[Any, float], Runnable[Any]] = unsupported
    """Turn at this velocity (rad/s) until the next order; for a control loop."""
    max_velocity: Callable[[Any], Runnable[float | None]] = unsupported
    """The highest velocity (rad/s) of the model or of its settings; None: unknown."""
    plan_move: Callable[..., Runnable[SelfTimedMove]] = unsupported
    """plan_move(device, angle, *, velocity, acceleration): a move by `angle` (rad) with its own profile, at most at
    `velocity` (rad/s) and `acceleration` (rad/s²)."""

    @cached_property
    def names(self) -> frozenset[str]:
        """The capabilities that are given."""
        return frozenset(one.name for one in fields(self) if getattr(self, one.name) is not unsupported)

    def __contains__(self, name: object) -> bool:
        return name in self.names


class BusDriver(Protocol):
    """A family on one open bus: all that the bus and its users ask. It may keep what it learns on that bus."""

    family: Family
    window: int  # maximum number of lanes in flight
    full_duplex: bool  # a stop waits only for the request being sent, not for its reply
    probe_after: int
    """Equal replies in a row after which a node is probed: a copied reply would answer each next request. 0: never."""

    def air_time(self, request: Request[Any], rate: int) -> float:
        """Time (s) on the wire of the request and all expected replies, with the gaps of the protocol."""

    def turnaround(self, request: Request[Any]) -> float:
        """Maximum total time (s) of devices before and between their replies; depends on `request.reply_within`."""

    def quiet_time(self, rate: int) -> float:
        """Time (s) after which no part of an old reply can still arrive; then a node out of sync is probed."""

    def echo_test(self) -> Request[Any] | None:
        """A request whose reply has another length than its echo, sent when a bus is opened; None: no echo."""

    @abstractmethod
    def receiver(self) -> Receiver: ...

    @abstractmethod
    def probe(self, node: int, attempt: int) -> Request[bool]:
        """A request without effect; its value is True for the expected content of the reply.

        Attempts cycle through several probes whose replies differ in key or length. No reply has the length of the echo
        of its request.
        """

    @abstractmethod
    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """Requests that stop these nodes.

        `nodes` maps each node to the last answer with its position, None if there is no valid one.
        """

    @abstractmethod
    def identify(self, node: int) -> Runnable[Identity]: ...

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        """Search devices by unicast. () means all ids, or the present rate, which is restored at the end.

        Reports `Progress`, and `Found` when a device answers, possibly before its identity is read.
        """

    @abstractmethod
    def axis(self, identity: Identity) -> AxisDriver:
        """What the device with this identity can do; an empty one where its register map is unknown."""

    @abstractmethod
    def decode(self, data: bytes) -> list[Explanation]:
        """Explain all frames in these bytes, field by field; a CAN frame is serialized by `CanFrame.flat()`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """A device family: its facts, and what makes its parts."""

    name: str  # the scheme of a bus address
    link: LinkSpec
    registers: Mapping[str, RegisterMap]  # all register maps, by name
    devices: DeviceTypes
    driver: Callable[..., BusDriver]
    """driver(family, **settings) makes the driver of a bus. Raises RequestError for a bad setting."""
    # Names of modules that are imported on first use.
    simulator_module: str  # has `simulate(ids, model, **options)`, and `OPTIONS` if it has options
    recording_module: str = ""
    """Has `Recording(direction)`. "": the bus driver decodes recordings, frames by `decode`, bytes by its receiver."""
    checks_module: str = ""
    """Has `CHECKS`, a tuple of `core.findings.Check`, and `FACTORY_ID`, the id of a new device; see `doctor`."""
    commands: Mapping[str, Callable[..., Runnable[Any]]] = field(default_factory=dict)
    """The commands of the manual: `function(device, …)` by name."""
    sync_write: Callable[[Mapping[Any, Mapping[str, float]]], Runnable[None]] | None = None
    """sync_write({device: {register: value}}) writes RAM registers of many devices with one request."""
    sync_read: Callable[[Sequence[str], Sequence[Any]], Runnable[Any]] | None = None
    """sync_read(registers, devices) reads many devices with few requests: `values` and `errors` by node."""

    def open(self, **settings: object) -> BusDriver:
        """The driver of one open bus. Raises RequestError for an unknown or invalid setting."""
        known = [option.name for option in self.link.settings]
        for name in settings:
            if name not in known:
                raise RequestError(
                    f"a {self.name} bus has no setting {name!r}",
                    expected=f"one of {', '.join(known)}" if known else "no setting",
                )
        return self.driver(self, **settings)

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        """A simulated bus; model "" is the default model. Raises RequestError for bad ids, models and options."""
        simulator: Simulator = import_module(self.simulator_module).simulate(ids, model, **options)
        return simulator

    def simulator_options(self) -> tuple[Option, ...]:
        """The options of `simulator`."""
        return getattr(import_module(self.simulator_module), "OPTIONS", ())

    def recording(self, direction: str) -> RecordingReceiver | None:
        """A receiver for recordings of one direction: "rx" from the devices, "tx" to them, "" unknown or mixed."""
        module = self.recording_module
        return import_module(module).Recording(direction) if module else None
