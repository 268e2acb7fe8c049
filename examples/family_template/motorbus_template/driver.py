"""Requests, then procedures, then the driver of a bus. They send nothing themselves; a bus runs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import partial
from math import inf
from struct import Struct
from typing import Any, Final, TypeVar

from motorbus.core import move as core
from motorbus.core.access import readable_rows, writable_values, write_verified
from motorbus.core.family import AxisDriver, Explanation, Health, Identity, Receiver, State, Stop
from motorbus.core.framing import FrameReceiver
from motorbus.core.half_duplex import HalfDuplexSerial
from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import Effect, Expected, Precondition, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, catch, with_cleanup
from motorbus.core.stream import PositionStream, read_positions
from motorbus.errors import DeviceError, LimitExceeded, NoReply, RequestError, UnexpectedReply

from . import protocol
from .protocol import Command
from .registers import COUNT, TABLE

T = TypeVar("T")

GOAL: Final = TABLE["goal_position"]
FEEDBACK: Final = Struct("<iBbB")
"""The registers from present_position on: position (counts), moving, temperature (°C), torque."""
METHODS: Final = {
    "node_id": "the tool of the maker",
    "lock": "write(), which opens and closes it",
    "torque_enable": "enable_torque() or disable_torque()",
}
"""What writes a protected register."""


class Promise(Enum):
    """What an acknowledged stop means."""

    HOLD = "each servo that acknowledged brakes and then holds; its torque stays as it was"


class Node:
    """One servo by its id, 1 to 63, and what the driver knows of it.

    `limits` (rad) as last read; None: not read yet. `alarm` and `at` (s, link clock) are those of its last reply.
    `last_move` identifies its latest move.
    """

    def __init__(self, node: int) -> None:
        if node not in protocol.IDS:
            raise RequestError(f"{node!r} is not the id of a servo", expected="1 to 63")
        self.node: Final = node
        self.limits: tuple[float, float] | None = None
        self.alarm: tuple[str, ...] = ()
        self.at = -inf
        self.last_move: object = None


def request(
    node: Node, command: Command, operands: bytes, decode: Callable[[bytes], T], size: int = 0, **options: Any
) -> Request[T]:
    """A request; `decode` makes its value of the `size` bytes of data in the reply. A refusal raises DeviceError."""
    expected = Expected(node.node, node.node, protocol.OVERHEAD + size, refusal=protocol.OVERHEAD)

    def take(response: Response) -> T:
        reply = response.replies[0].data
        node.at = response.at
        node.alarm = ("temperature",) if reply[4] & protocol.HOT else ()
        if code := reply[4] & 15:
            summary = f"node {node.node} refused {command.name}: {protocol.STATUS.get(code, code)}"
            raise DeviceError(summary, code=code, node=node.node)
        if len(reply) != expected.length:
            raise UnexpectedReply(f"node {node.node} replied to {command.name} without data", node=node.node)
        return decode(reply[5:-2])

    frame = protocol.encode(protocol.REQUEST, node.node, command, operands)
    # Goals are absolute, so every request may be repeated.
    return Request(frame, (expected,), take, repeatable=True, **options)


def read_row(node: Node, row: Register) -> Request[int]:
    """The raw value of one register."""
    return request(node, Command.READ, bytes((row.address, row.size)), row.decode, row.size)


def write_row(node: Node, row: Register, raw: int, **options: Any) -> Request[None]:
    """Write one register. Raises RequestError for a raw value out of range."""
    return request(
        node,
        Command.WRITE,
        bytes((row.address,)) + row.encode(raw),
        lambda data: None,
        priority=Priority.CONTROL,
        effect=row.effect,
        reply_within=TimeoutClass.STORE if row.storage is Storage.EEPROM else TimeoutClass.REPLY,
        **options,
    )


def probe(node: Node, attempt: int = 0) -> Request[bool]:
    """Read 8 to 23 bytes from address 0; True if the id among them is possible. No other reply has these lengths."""
    size = 8 + attempt % 16
    frame = protocol.encode(protocol.REQUEST, node.node, Command.READ, bytes((0, size)))
    expected = Expected(node.node, node.node, protocol.OVERHEAD + size)

    def decode(response: Response) -> bool:
        return response.replies[0].data[5 + TABLE["node_id"].address] in protocol.IDS

    return Request(frame, (expected,), decode, repeatable=True)


def health(node: Node) -> Request[Health]:
    """Position (rad), temperature (°C), moving, alarm and torque, in one request."""

    def decode(data: bytes) -> Health:
        counts, moving, temperature, torque = FEEDBACK.unpack(data)
        state = State(node.at, counts * COUNT, temperature=temperature, moving=bool(moving), alarm=node.alarm)
        return Health(state, torque=bool(torque))

    def positions(response: Response) -> dict[int, float]:
        counts, *_ = FEEDBACK.unpack(response.replies[0].data[5:-2])
        return {node.node: counts * COUNT}

    block = bytes((TABLE["present_position"].address, FEEDBACK.size))
    return request(node, Command.READ, block, decode, FEEDBACK.size, reports_position=positions)


def telemetry(node: Node) -> Request[State]:
    """Position (rad), temperature (°C), moving and alarm."""
    return health(node).convert(lambda found: found.state)


def position(node: Node) -> Request[float]:
    """Present position (rad)."""
    return health(node).convert(lambda found: found.state.position or 0.0)


def stop(node: Node) -> Request[Promise]:
    """Brake and hold; torque stays as it is."""
    return request(
        node, Command.STOP, b"", lambda data: Promise.HOLD, priority=Priority.STOP, effect=Effect.MOTION
    )


def disable_torque(node: Node) -> Request[None]:
    """Torque off: the shaft turns freely."""
    return write_row(node, TABLE["torque_enable"], 0)


def goal(node: Node, to: float, bounds: tuple[float, float], **options: Any) -> Request[None]:
    """Send a goal (rad). The gate checks that it is within these bounds (rad). Raises LimitExceeded if not finite."""
    try:
        raw = GOAL.to_raw(to)
        setpoint = Setpoint(node.node, "position", float(GOAL.to_value(raw)), *bounds)
        return write_row(node, GOAL, raw, setpoints=(setpoint,), **options)
    except RequestError as error:
        summary = f"node {node.node}: {error.summary}"
        raise LimitExceeded(summary, expected=error.expected, node=node.node) from None


async def ping(node: Node) -> bool:
    """Whether the servo replies."""
    try:
        return await probe(node)
    except NoReply:
        return False


async def identify(node: Node) -> Identity:
    """Model and firmware. `table` is "" for an unknown model: it is read but never written."""
    model = await read_row(node, TABLE["model"])
    firmware = await read_row(node, TABLE["firmware"])
    known = model == TABLE["model"].default
    name = TABLE.name if known else f"unknown model 0x{model:04X}"
    return Identity(node.node, name, f"{firmware >> 8}.{firmware & 255}", TABLE.name if known else "")


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Registers by name in API units; all without a name. Raises RequestError for an unknown name."""
    return {row.name: row.to_value(await read_row(node, row)) for row in readable_rows(TABLE, names)}


async def write(node: Node, /, **values: Value) -> None:
    """Write registers by name in API units. Raises RequestError before anything is sent, or VerificationFailed."""
    raws = writable_values(TABLE, values, Register.to_raw, node=node.node, methods=METHODS)
    settings = [(row, raw) for row, raw in raws if row.storage is Storage.EEPROM]
    if settings:
        await Exclusive(with_cleanup(_write_settings(node, settings), lambda: _close_lock(node)))
    if GOAL.name in values:
        await move(node, values[GOAL.name], wait=False)


async def _write_settings(node: Node, settings: Sequence[tuple[Register, int]]) -> None:
    """Open the lock, then write and verify each setting."""
    node.limits = None
    await write_row(node, TABLE["lock"], 0)
    for row, raw in settings:
        send = partial(write_row, node, row, raw)
        await write_verified(send, partial(read_row, node, row), raw, node=node.node, what=row.name)


async def _close_lock(node: Node) -> None:
    """Close the lock; without an acknowledgement once more."""
    lock = write_row(node, TABLE["lock"], 1)
    if await catch(lock) is not None:
        await lock


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad) in the settings of the servo; read once."""
    if node.limits is None:
        found = await read(node, "min_position", "max_position")
        node.limits = found["min_position"], found["max_position"]
    return node.limits


async def enable_torque(node: Node) -> None:
    """Torque on without a jump: the goal becomes the present position first."""
    bounds = await limits(node)
    await goal(node, await position(node), bounds)
    await write_row(node, TABLE["torque_enable"], 1)


class Move(core.MoveLogic[Node]):
    """How these servos move, see `core.move`."""

    async def check(self, node: Node, to: float) -> Setpoint:
        (setpoint,) = goal(node, to, await limits(node)).setpoints
        return setpoint

    def send(self, node: Node, goal: Setpoint) -> Request[None]:
        return write_row(node, GOAL, GOAL.to_raw(goal.value), setpoints=(goal,))

    def sample(self, node: Node) -> Request[State]:
        return telemetry(node)

    def stop(self, node: Node) -> Request[Promise]:
        return stop(node)


async def move(node: Node, to: float, *, wait: bool = True) -> None:
    """Move to `to` rad; return in position, or at once with `wait=False`. An interrupt of the wait stops the servo.

    Raises LimitExceeded for a goal outside the limits, Stalled when the servo stops elsewhere.
    """
    await core.move(Move(), {node: to}, wait=wait)


async def open_stream(nodes: Sequence[Node], *, rate: int) -> PositionStream[Node]:
    """These servos for a control loop. Reads their limits and writes nothing."""
    known = {node: await limits(node) for node in nodes}

    def send(node: Node, to: float, precondition: Precondition) -> Request[None]:
        return goal(node, to, known[node], precondition=precondition)

    async def start(node: Node, speed: float | None) -> None:
        await enable_torque(node)  # the servo has no setting for a speed

    positions = [read_positions(node.node, position(node)) for node in nodes]
    return PositionStream(nodes, positions, send, start, lambda node: node.limits != known[node])


_AXIS: Final = AxisDriver(
    state=telemetry,
    position=position,
    health=health,
    enable_torque=enable_torque,
    disable_torque=disable_torque,
    move=move,
    stop=stop,
    limits=limits,
    stream=open_stream,
)


class MetronomeDriver(HalfDuplexSerial):
    """Metronomes on one open bus; see `core.family.BusDriver`."""

    ids = protocol.IDS

    def receiver(self) -> Receiver:
        return FrameReceiver(protocol.parser(protocol.REPLY), lambda frame: frame[2])

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return probe(Node(node), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        frame = protocol.encode(protocol.REQUEST, protocol.BROADCAST, Command.STOP)
        broadcast = Request[Response](frame, priority=Priority.STOP, effect=Effect.MOTION)
        return Stop((broadcast, *[stop(Node(node)) for node in nodes]), Promise.HOLD.value)

    async def identify(self, node: int) -> Identity:
        return await identify(Node(node))

    def axis(self, identity: Identity) -> AxisDriver:
        return _AXIS if identity.table == TABLE.name else AxisDriver()

    def decode(self, data: bytes) -> list[Explanation]:
        return protocol.decode(data)
