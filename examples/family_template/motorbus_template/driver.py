"""Requests and procedures of the Metronome. They send nothing themselves; a bus runs them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import partial
from typing import Any, Final, TypeVar

from motorbus.core.access import readable_rows, writable_values
from motorbus.core.arrival import wait_in_position
from motorbus.core.family import AxisDriver, Explanation, Health, Identity, Receiver, State, Stop
from motorbus.core.half_duplex import HalfDuplexSerial
from motorbus.core.interrupted import Moving, stopped_if_interrupted
from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import Effect, Expected, Precondition, Priority, Request, Response, TimeoutClass
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, Guard, catch
from motorbus.core.stream import PositionStream, read_positions
from motorbus.core.verify import write_verified
from motorbus.errors import DeviceError, LimitExceeded, NoReply, RequestError, UnexpectedReply

from . import protocol
from .protocol import Command
from .registers import TABLE

T = TypeVar("T")

GOAL: Final = TABLE["goal_position"]
PRESENT: Final = TABLE["present_position"]
TORQUE: Final = TABLE["torque_enable"]


class Promise(Enum):
    """What an acknowledged stop means."""

    HOLD_ACCEPTED = "each servo that acknowledged brakes and then holds; its torque stays as it was"


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
        self.at = -math.inf
        self.last_move: object = None


# -- requests ------------------------------------------------------------------------------------------------


def request(
    node: Node,
    command: Command,
    operands: bytes = b"",
    *,
    size: int = 0,
    refusal: int = protocol.OVERHEAD,
    decode: Callable[[bytes], T],
    **options: Any,
) -> Request[T]:
    """A request whose reply has `size` bytes of data, of which `decode` makes the value.

    `refusal` is the length of a refusal, which raises DeviceError. `options` are those of `Request`. All requests are
    repeatable, because goals are absolute.
    """

    def take(response: Response) -> T:
        reply = response.replies[0].data
        status = reply[4]
        node.alarm, node.at = protocol.alarms(status), response.at
        if len(reply) != expected.length and not status & 15:
            raise UnexpectedReply(f"node {node.node} replied to {command.name} without data", node=node.node)
        if status & 15:
            raise DeviceError(
                f"node {node.node} refused {command.name}: {protocol.status_text(status)}",
                code=status & 15,
                node=node.node,
            )
        return decode(reply[5:-2])

    expected = Expected(node.node, node.node, protocol.OVERHEAD + size, refusal)
    frame = protocol.encode_request(node.node, command, operands)
    return Request(frame, (expected,), take, repeatable=True, **options)


def read_row(node: Node, row: Register) -> Request[int]:
    """The raw value of one register."""
    return request(node, Command.READ, bytes((row.address, row.size)), size=row.size, decode=row.decode)


def write_row(node: Node, row: Register, raw: int, *setpoints: Setpoint, **options: Any) -> Request[None]:
    """Write one register. Raises RequestError for a raw value out of range."""
    return request(
        node,
        Command.WRITE,
        bytes((row.address,)) + row.encode(raw),
        decode=_no_value,
        priority=Priority.CONTROL,
        effect=row.effect,
        setpoints=setpoints,
        reply_within=TimeoutClass.STORE if row.storage is Storage.EEPROM else TimeoutClass.REPLY,
        **options,
    )


def health(node: Node) -> Request[Health]:
    """Position (rad), temperature (°C), moving, alarm and torque, in one request."""

    def decode(data: bytes) -> Health:
        position, temperature = to_position(data), TABLE["temperature"].decode(data[5:6])
        state = State(node.at, position, temperature=temperature, moving=bool(data[4]), alarm=node.alarm)
        return Health(state, torque=data[6] == 1)

    def positions(response: Response) -> dict[int, float]:
        reply = response.replies[0].data
        return {} if len(reply) < protocol.OVERHEAD + 7 else {node.node: to_position(reply[5:])}

    block = bytes((PRESENT.address, 7))
    return request(node, Command.READ, block, size=7, decode=decode, reports_position=positions)


def to_position(data: bytes) -> float:
    """The present position (rad) at the start of these bytes."""
    return float(PRESENT.to_value(PRESENT.decode(data[: PRESENT.size])))


def telemetry(node: Node) -> Request[State]:
    """Position (rad), temperature (°C), moving and alarm."""
    return health(node).convert(lambda health: health.state)


def position(node: Node) -> Request[float]:
    """Present position (rad)."""
    return health(node).convert(lambda health: health.state.position or 0.0)


def stop(node: Node) -> Request[Promise]:
    """Brake and hold; torque stays as it is."""
    return request(
        node,
        Command.STOP,
        decode=lambda data: Promise.HOLD_ACCEPTED,
        priority=Priority.STOP,
        effect=Effect.MOTION,
    )


def disable_torque(node: Node) -> Request[None]:
    """Torque off: the shaft turns freely."""
    return write_row(node, TORQUE, 0)


def probe(node: Node, attempt: int = 0) -> Request[bool]:
    """Read 7 to 22 bytes from the model on; True if the id among them is possible. No other read has these lengths."""
    size = 7 + attempt % 16

    def decode(data: bytes) -> bool:
        return data[TABLE["node_id"].address] in protocol.IDS

    return request(node, Command.READ, bytes((0, size)), size=size, refusal=0, decode=decode)


def _no_value(data: bytes) -> None:
    """A reply without data."""


# -- identity and registers ----------------------------------------------------------------------------------


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
    name = "metronome" if known else f"unknown model 0x{model:04X}"
    return Identity(node.node, name, f"{firmware >> 8}.{firmware & 255}", TABLE.name if known else "")


async def read(node: Node, /, *names: str) -> dict[str, Value]:
    """Registers by name in API units; all without a name. Raises RequestError for an unknown name."""
    return {row.name: row.to_value(await read_row(node, row)) for row in readable_rows(TABLE, names)}


async def write(node: Node, /, **values: Value) -> None:
    """Write registers by name in API units; all values are checked before the first is sent.

    Raises RequestError for a value that is not written by name, VerificationFailed when a setting reads back different.
    """
    if values.get("torque_enable"):
        raise RequestError("torque_enable is not written by name: use enable_torque()", node=node.node)
    methods = {"node_id": "the tool of the maker", "lock": "write(), which opens and closes it"}
    raws = writable_values(TABLE, values, Register.to_raw, node=node.node, methods=methods)
    await Exclusive(_write_settings(node, [(row, raw) for row, raw in raws if row.storage is Storage.EEPROM]))
    for row, raw in raws:
        if row is GOAL:
            await write_row(node, row, raw, await setpoint(node, raw))
        elif row.storage is Storage.RAM:
            await write_row(node, row, raw)


class Unlocked(Guard):
    """Settings can be written inside the block. The lock is closed after it, also after an error or an interrupt."""

    def __init__(self, node: Node) -> None:
        self._node = node

    async def enter(self) -> None:
        await write_row(self._node, TABLE["lock"], 0)

    async def leave(self, error: BaseException | None) -> None:
        lock = write_row(self._node, TABLE["lock"], 1)
        if await catch(lock) is not None:  # no acknowledgement: write it again
            await lock


async def _write_settings(node: Node, values: Sequence[tuple[Register, int]]) -> None:
    if not values:
        return
    node.limits = None
    async with Unlocked(node):
        for row, raw in values:
            write, read = partial(write_row, node, row, raw), partial(read_row, node, row)
            await write_verified(write, read, raw, node=node.node, what=row.name)


# -- motion --------------------------------------------------------------------------------------------------


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position (rad) in the settings of the servo; read once."""
    if node.limits is None:
        found = await read(node, "min_position", "max_position")
        node.limits = found["min_position"], found["max_position"]
    return node.limits


async def setpoint(node: Node, raw: int) -> Setpoint:
    """What a goal asks of the servo, with its limits; the gate checks it."""
    return Setpoint(node.node, "position", float(GOAL.to_value(raw)), *await limits(node))


def to_goal(node: Node, to: float) -> int:
    """The raw goal of a position (rad). Raises LimitExceeded for a position that no servo can have."""
    raw = GOAL.to_raw(to) if math.isfinite(to) else GOAL.high + 1
    if not GOAL.low <= raw <= GOAL.high:
        raise LimitExceeded(
            f"node {node.node}: {to} is no position", advice="give a number in rad", node=node.node
        )
    return raw


async def enable_torque(node: Node) -> None:
    """Torque on without a jump: the goal becomes the present position first."""
    here = await read_row(node, PRESENT)
    await write_row(node, GOAL, here, await setpoint(node, here))
    await write_row(node, TORQUE, 1)


async def move(node: Node, to: float, *, wait: bool = True) -> None:
    """Move to `to` rad and return in position, at once with `wait=False`.

    An interrupted wait stops the servo. Raises LimitExceeded for a goal outside the limits, Stalled when it stops
    elsewhere.
    """
    raw = to_goal(node, to)
    await write_row(node, GOAL, raw, await setpoint(node, raw))

    if wait:
        arrival = wait_in_position(
            lambda: telemetry(node), to, node=node.node, tolerance=0.01, timeout=lambda way: 5.0 + 2.0 * way
        )
        await stopped_if_interrupted(arrival, Moving(node, partial(stop, node), partial(position, node)))


async def open_stream(nodes: Sequence[Node], *, rate: int) -> PositionStream[Node]:
    """These servos for a control loop. Reads their limits and writes nothing."""
    known = {node: await limits(node) for node in nodes}

    def goal(node: Node, to: float, precondition: Precondition) -> Request[None]:
        raw = to_goal(node, to)
        setpoint = Setpoint(node.node, "position", float(GOAL.to_value(raw)), *known[node])
        return write_row(node, GOAL, raw, setpoint, precondition=precondition)

    async def start(node: Node, speed: float | None) -> None:
        await enable_torque(node)  # the servo has no setting for a speed

    positions = [read_positions(node.node, position(node)) for node in nodes]
    return PositionStream(nodes, positions, goal, start, lambda node: node.limits != known[node])


# -- the bus -------------------------------------------------------------------------------------------------

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
    longest_reply = protocol.OVERHEAD + protocol.MOST_DATA

    def receiver(self) -> Receiver:
        return protocol.receiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return probe(Node(node), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        frame = protocol.encode_request(protocol.BROADCAST, Command.STOP)
        everyone = Request[Response](frame, priority=Priority.STOP, effect=Effect.MOTION)
        each = [stop(Node(node)) for node in nodes]
        return Stop((everyone, *each), Promise.HOLD_ACCEPTED.value)

    async def identify(self, node: int) -> Identity:
        return await identify(Node(node))

    def axis(self, model: str) -> AxisDriver:
        return _AXIS if model == "metronome" else AxisDriver()

    def decode(self, data: bytes) -> list[Explanation]:
        return protocol.decode(data)
