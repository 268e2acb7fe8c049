"""Position, current, temperature, health.

The manual reads the status by the same frame as the position (commands 6 and 7); four public drivers read it at
0x6005. So by the profile `kst` a status is two bytes that are not decoded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

from motorbus.core.family import Health, State
from motorbus.core.register import Register
from motorbus.core.request import Request
from motorbus.families.kst import profiles
from motorbus.families.kst.driver.node import Node, lacking
from motorbus.families.kst.driver.requests import read_object, read_register
from motorbus.families.kst.sdo import SdoReply

T = TypeVar("T")

SAME_FRAME: Final = (
    "the manual's command 7 is the same frame as its command 6, read position: this device may be returning the "
    "position, low byte first"
)


class RawStatus(NamedTuple):
    """The two status bytes of command 7 as received; `warning` says why they are not decoded."""

    x1: int
    x2: int
    warning: str = SAME_FRAME


class Status(NamedTuple):
    """Supply current (A) and temperature (°C) of a servo with newer firmware."""

    current: float
    temperature: float


def position(node: Node) -> Request[float]:
    """Present position, rad."""
    return _kept(node, "position", _position)


def _kept(node: Node, name: str, make: Callable[[Node], Request[T]]) -> Request[T]:
    if name not in node.kept:
        node.kept[name] = make(node)
    return node.kept[name]


def _position(node: Node) -> Request[float]:
    row = node.table["present_position"]
    return read_register(node, row, lambda raw: float(row.to_value(raw)), reports_position=True)


def status(node: Node) -> Request[RawStatus | Status]:
    """Current (A) and temperature (°C); by the profile `kst` the two raw bytes of command 7, with a warning."""
    return raw_status(node) if node.profile.status_row is None else _decoded_status(node)


def raw_status(node: Node) -> Request[RawStatus]:
    """Command 7 of the manual with any profile: the bytes may be a position."""
    row = node.table["present_position"]

    def take(reply: SdoReply) -> RawStatus:
        return RawStatus(*(reply.data + bytes(2))[:2])

    return read_object(node, row.address, row.subindex or 0, take)


def _decoded_status(node: Node) -> Request[Status]:
    def take(raw: int) -> Status:
        return Status(profiles.current(node.profile, raw), float(profiles.temperature(raw)))

    return _kept(node, "status", lambda same: read_register(same, _status_row(same), take))


def current(node: Node) -> Request[float]:
    """Supply current, A. Raises RequestError where the profile has no status object."""

    def take(raw: int) -> float:
        return profiles.current(node.profile, raw)

    return _kept(node, "current", lambda same: read_register(same, _status_row(same), take))


def temperature(node: Node) -> Request[float]:
    """Temperature, °C. Raises RequestError where the profile has no status object."""

    def take(raw: int) -> float:
        return float(profiles.temperature(raw))

    return _kept(node, "temperature", lambda same: read_register(same, _status_row(same), take))


async def telemetry(node: Node) -> State:
    """One sample: position (rad), with newer firmware current (A) and temperature (°C), recent alarms."""
    here = await position(node)
    at = node.at
    if node.profile.status_row is None:
        return State(at=at, position=here, alarm=node.alarm)
    now = await _decoded_status(node)
    return State(at=at, position=here, current=now.current, temperature=now.temperature, alarm=node.alarm)


def health(node: Node) -> Request[Health]:
    """Current (A), temperature (°C) and recent alarms; by a profile without a status object the position (rad).

    `restarts` counts the boot messages (CiA 301) received from the node. No source says that these servos send one: a
    servo that does not restarts unnoticed, or is silent for a while.
    """
    row, state = node.profile.status_row, node.settings.state

    def take(raw: int) -> Health:
        restarts = None if state is None else state.boots[node.node]
        if row is None:
            here = float(node.table["present_position"].to_value(raw))
            return Health(State(at=node.at, position=here, alarm=node.alarm), restarts=restarts)
        sample = State(
            at=node.at,
            current=profiles.current(node.profile, raw),
            temperature=float(profiles.temperature(raw)),
            alarm=node.alarm,
        )
        return Health(sample, restarts=restarts)

    return read_register(node, row or node.table["present_position"], take, reports_position=row is None)


def _status_row(node: Node) -> Register:
    if node.profile.status_row is None:
        raise lacking(node, "current and temperature", "status")
    return node.profile.status_row
