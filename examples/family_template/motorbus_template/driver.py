"""DRIVER: what to say to get a thing done. Here belong sequences, verification and guards; no bytes, no waiting.

A function takes a node. It returns a `Request`, which can be kept and run again, or is a coroutine that awaits steps; a
blocking or an async bus runs it. Device methods do not call each other; these functions do. They fill `node`, the known
state of a device.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, TypeVar

from motorbus.core.family import Health, Identity, State, Stop
from motorbus.core.register import Register, Storage, Value
from motorbus.core.request import (
    Effect,
    Expected,
    Notification,
    Precondition,
    Priority,
    Request,
    Response,
    TimeoutClass,
)
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import Exclusive, Guard, WaitFor, catch
from motorbus.errors import (
    DeviceError,
    LimitExceeded,
    NoReply,
    RequestError,
    Stalled,
    VerificationFailed,
)

from . import wire
from .table import TABLE

T = TypeVar("T")

PATIENCE: Final = 0.25
"""s to wait for a report of arrival before asking; a report may be lost, so it is never all that is waited for."""


class Node:
    """One servo by its id, 1 to 63, and what is known of it. `limits` in rad; None when not read yet."""

    def __init__(self, node: int) -> None:
        if node not in wire.NODES:
            raise RequestError(f"{node!r} is not the id of one servo", expected="1 to 63")
        self.node: Final = node
        self.limits: tuple[float, float] | None = None
        self.alarm: tuple[str, ...] = ()
        self.at = -math.inf


# --- single exchanges ---------------------------------------------------------------------------------------


def exchange(
    node: Node,
    command: wire.Command,
    index: int = 0,
    subindex: int = 0,
    value: bytes = b"",
    *,
    take: Callable[[bytes], T],
    priority: Priority = Priority.POLL,
    effect: Effect = Effect.NONE,
    setpoints: tuple[Setpoint, ...] = (),
    reply_within: TimeoutClass = TimeoutClass.REPLY,
    reports_position: bool | Callable[[Response], Mapping[int, float]] = False,
    precondition: Precondition | None = None,
) -> Request[T]:
    """One request to one node; `take` makes a value of the four bytes of the answer.

    Everything here is repeatable: a goal is absolute. A relative move would have to say `repeatable=False`.
    """

    def read(answer: Response) -> T:
        data = answer.replies[0].data
        node.alarm, node.at = wire.alarms(data[3]), answer.at
        if data[3] & 0x0F:
            raise _refused(node, data[3] & 0x0F, index, subindex)
        return take(data[4:])

    return Request(
        wire.encode_request(node.node, command, index, subindex, value),
        (Expected(node.node, (int(command), index, subindex), wire.LENGTH),),
        read,
        lane=node.node,
        priority=priority,
        effect=effect,
        setpoints=setpoints,
        reply_within=reply_within,
        repeatable=True,
        reports_position=reports_position,
        precondition=precondition,
    )


def read_row(node: Node, row: Register) -> Request[int]:
    """The raw value of one object."""
    return exchange(
        node,
        wire.Command.READ,
        row.address,
        row.subindex or 0,
        take=lambda data: row.decode(data[-row.size :]),
    )


def write_row(
    node: Node, row: Register, raw: int, *setpoints: Setpoint, precondition: Precondition | None = None
) -> Request[None]:
    """Write one object, unless `precondition` objects just before. Raises RequestError for a raw value out of range."""
    return exchange(
        node,
        wire.Command.WRITE,
        row.address,
        row.subindex or 0,
        row.encode(raw),
        take=_nothing,
        priority=Priority.CONTROL,
        effect=row.effect,
        setpoints=setpoints,
        reply_within=TimeoutClass.STORE if row.storage is Storage.EEPROM else TimeoutClass.REPLY,
        precondition=precondition,
    )


def proof(node: Node, attempt: int = 0, reply_within: TimeoutClass = TimeoutClass.REPLY) -> Request[bool]:
    """Ask for something whose answer is known beforehand and differs with `attempt`."""
    subindex = attempt & 0xFF
    right = bytes((~subindex & 0xFF,))
    return exchange(
        node,
        wire.Command.READ,
        wire.PROOF,
        subindex,
        take=lambda data: data[-1:] == right,
        reply_within=reply_within,
    )


def position(node: Node) -> Request[float]:
    """Present position, rad."""
    row = TABLE["present_position"]

    def where(answer: Response) -> dict[int, float]:
        data = answer.replies[0].data
        return {} if data[3] & 0x0F else {node.node: float(row.to_value(row.decode(data[4:])))}

    return exchange(
        node,
        wire.Command.READ,
        row.address,
        row.subindex or 0,
        take=lambda data: float(row.to_value(row.decode(data))),
        reports_position=where,
    )


def stop(node: Node) -> Request[None]:
    """Brake and hold; torque stays as it is. Goes before everything else and needs to know nothing."""
    return exchange(node, wire.Command.STOP, take=_nothing, priority=Priority.STOP, effect=Effect.MOTION)


def disable_torque(node: Node) -> Request[None]:
    """Torque off: it goes limp where it is."""
    return write_row(node, TABLE["torque_enable"], 0)


def _nothing(data: bytes) -> None:
    """An answer without a value."""


def _refused(node: Node, code: int, index: int, subindex: int) -> DeviceError:
    row = TABLE.at(index, subindex)
    name = row.name if row else f"0x{index:02X}:{subindex}"
    why = wire.REFUSALS.get(code, f"refusal {code}")
    return DeviceError(f"node {node.node} refused {name}: {why}", code=code, register=name, node=node.node)


# --- who is there -------------------------------------------------------------------------------------------


async def ping(node: Node) -> bool:
    """Is it there? Silence is the answer False."""
    try:
        return await proof(node)
    except NoReply:
        return False


async def identify(node: Node) -> Identity:
    """Model and firmware. Unknown firmware would get table "": readable, never written."""
    model = await read_row(node, TABLE["model"])
    firmware = await read_row(node, TABLE["firmware"])
    name = TABLE["model"].choices.get(model, f"unknown model 0x{model:04X}")
    known = TABLE.name if model in TABLE["model"].choices else ""
    return Identity(node.node, name, f"{firmware >> 8}.{firmware & 0xFF}", known, {"model_number": model})


# --- objects by name ----------------------------------------------------------------------------------------


async def read(node: Node, *names: str) -> dict[str, Value]:
    """Objects in API units by name, all when none is named. Raises RequestError for an unknown name."""
    rows = [TABLE[name] for name in names or TABLE if TABLE[name].readable]
    values: dict[str, Value] = {}
    for row in rows:
        values[row.name] = row.to_value(await read_row(node, row))
    return values


async def write(node: Node, /, **values: Value) -> None:
    """Write objects by name, in API units; all are checked before the first is sent.

    What lies in EEPROM goes through the guarded sequence. Raises RequestError for what cannot or must not be
    written so, VerificationFailed when EEPROM reads back different.
    """
    orders = [(TABLE[name], _checked(TABLE[name], value)) for name, value in values.items()]
    kept = [(row, raw) for row, raw in orders if row.storage is Storage.EEPROM]
    if kept:
        await Exclusive(_write_eeprom(node, kept))
    for row, raw in orders:
        if row.effect is Effect.MOTION:
            await write_row(node, row, raw, await _goal(node, raw))
        elif row.storage is not Storage.EEPROM:
            await write_row(node, row, raw)


async def set_node_id(node: Node, new: int) -> None:
    """Give it another id, 1 to 63, which it takes at its next power-up."""
    TABLE["node_id"].encode(new)
    await Exclusive(_write_eeprom(node, [(TABLE["node_id"], new)]))


def _checked(row: Register, value: Value) -> int:
    """The raw value to write. Raises RequestError when this may not be written by name."""
    raw = row.to_raw(value)
    refusal = ""
    if not row.writable:
        refusal = "it can only be read"
    elif row.protected:
        refusal = "a verb of its own writes it"
    elif row.name == "torque_enable" and raw:
        refusal = "it could jump to an old goal; enable_torque() first makes the goal the present position"
    if refusal:
        raise RequestError(f"{row.name} is not written by name: {refusal}", advice="nothing was sent")
    row.encode(raw)
    return raw


class Unlocked(Guard):
    """EEPROM can be written inside the block; locked again after an error, an interrupt and a cancellation."""

    def __init__(self, node: Node) -> None:
        self._node = node

    async def enter(self) -> None:
        await write_row(self._node, TABLE["lock"], 0)

    async def leave(self, error: BaseException | None) -> None:
        lock = write_row(self._node, TABLE["lock"], 1)
        if await catch(lock) is not None:  # not acknowledged, after the retries of the bus
            await lock


async def _write_eeprom(node: Node, orders: list[tuple[Register, int]]) -> None:
    """Unlock, write, read back, lock."""
    node.limits = None
    async with Unlocked(node):
        for row, raw in orders:
            await write_row(node, row, raw)
            found = await read_row(node, row)
            if found != raw:
                raise VerificationFailed(f"{row.name} reads back {found}, not {raw}", node=node.node)


# --- moving -------------------------------------------------------------------------------------------------


async def enable_torque(node: Node) -> None:
    """Torque on without a jump: the goal becomes the present position first."""
    here = await read_row(node, TABLE["present_position"])
    await write_row(node, TABLE["goal_position"], here, await _goal(node, here))
    await write_row(node, TABLE["torque_enable"], 1)


async def move(
    node: Node, to: float, *, velocity: float | None = None, wait: bool = True, tolerance: float = 0.01
) -> None:
    """Move to `to` rad, at most at `velocity` rad/s; returns when it is there, at once with `wait=False`.

    Raises LimitExceeded when `to` is not finite (and the gate does outside the limits), Stalled when it stopped
    elsewhere.
    """
    if not math.isfinite(to):
        raise LimitExceeded(f"node {node.node}: {to} is no position", advice="give a number in rad")
    row = TABLE["goal_position"]
    goal = await _goal(node, row.to_raw(to))
    if velocity is not None:
        await write(node, move_velocity=velocity)
    await write_row(node, row, row.to_raw(to), goal)
    if wait:
        await _arrival(node, to, tolerance)


async def _arrival(node: Node, to: float, tolerance: float) -> None:
    """Wait for the report, and ask now and then: it may have been sent before we listened."""
    while await read_row(node, TABLE["moving"]):
        await WaitFor(partial(_is_arrival, node.node), PATIENCE)
    here = await position(node)
    if abs(here - to) > tolerance:
        raise Stalled(f"node {node.node} stands at {here:.4g} rad, not at {to:.4g} rad", node=node.node)


def _is_arrival(node: int, notice: Notification) -> bool:
    return notice.node == node and notice.kind == "arrived"


async def _goal(node: Node, raw: int) -> Setpoint:
    """What this raw goal orders, with the limits the device itself declares, for the gate to judge."""
    known = await limits(node)
    return Setpoint(node.node, "position", float(TABLE["goal_position"].to_value(raw)), *known)


async def limits(node: Node) -> tuple[float, float]:
    """Lowest and highest position, rad, as the device itself has them; read once."""
    if node.limits is None:
        found = await read(node, "min_position", "max_position")
        node.limits = found["min_position"], found["max_position"]
    return node.limits


async def telemetry(node: Node) -> State:
    """One sample: position (rad), temperature (°C), moving, alarm."""
    here = await position(node)
    at = node.at
    others = await read(node, "moving", "present_temperature")
    return State(
        at=at,
        position=here,
        temperature=others["present_temperature"],
        moving=bool(others["moving"]),
        alarm=node.alarm,
    )


def health(node: Node) -> Request[Health]:
    """Whether its torque is on, and its alarms: what is asked again and again while it is led, so one exchange."""
    row = TABLE["torque_enable"]

    def take(data: bytes) -> Health:
        return Health(State(at=node.at, alarm=node.alarm), torque=row.decode(data[-row.size :]) == 1)

    return exchange(node, wire.Command.READ, row.address, row.subindex or 0, take=take)


def stop_all(nodes: tuple[int, ...]) -> Stop:
    """What an emergency stop sends: everyone at once, then each known node until it acknowledges."""
    everyone = Request[Response](
        wire.encode_request(wire.EVERYONE, wire.Command.STOP), priority=Priority.STOP, effect=Effect.MOTION
    )
    each = [_plain(stop(Node(node))) for node in nodes]
    return Stop(
        (everyone, *each),
        "each node that acknowledged brakes and then holds where it came to rest; its torque stays as it was",
    )


def _plain(one: Request[None]) -> Request[Response]:
    """The same exchange without a reading of its answer: an alarm must not count as a missing acknowledgement."""
    return Request(
        one.wire, one.expected, lane=one.lane, priority=one.priority, effect=one.effect, repeatable=True
    )
