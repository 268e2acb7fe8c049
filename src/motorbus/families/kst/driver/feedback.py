"""Position, current, temperature, health.

The manual reads the status by the same frame as the position (commands 6 and 7); four public drivers read it at
0x6005. So by the profile `kst` a status is two bytes that are not decoded.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.family import Health, State
from motorbus.core.request import Request, Response
from motorbus.errors import DeviceError
from motorbus.families.kst import profiles
from motorbus.families.kst.driver.node import Node, feature_row
from motorbus.families.kst.driver.requests import accepted, read_register, upload

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
    if node.reading is None:
        row = node.table["present_position"]
        node.reading = read_register(node, row, lambda raw: float(row.to_value(raw)), reports_position=True)
    return node.reading


def status(node: Node) -> Request[RawStatus | Status]:
    """Current (A) and temperature (°C); by the profile `kst` the two raw bytes of command 7, with a warning."""
    if node.profile.status_row is not None:
        return _status(node)
    row = node.table["present_position"]

    def decode(answer: Response) -> RawStatus:
        data = accepted(node, row, answer).data.ljust(2, b"\0")
        return RawStatus(data[0], data[1])

    return upload(node, row, decode)


def _status(node: Node) -> Request[Status]:
    row = feature_row(node, "status", "current and temperature")
    return read_register(node, row, lambda raw: _decode_status(node, raw))


def _decode_status(node: Node, raw: int) -> Status:
    return Status(profiles.current(node.profile, raw), float(profiles.temperature(raw)))


async def current(node: Node) -> float:
    """Supply current, A. Raises RequestError where the profile has no status object."""
    return (await _status(node)).current


async def temperature(node: Node) -> float:
    """Temperature, °C. Raises RequestError where the profile has no status object."""
    return (await _status(node)).temperature


async def telemetry(node: Node) -> State:
    """One sample: position (rad), with newer firmware current (A) and temperature (°C), recent alarms.

    A status object that the servo refuses is named in `refused`.
    """
    here = await position(node)
    state = State(at=node.at, position=here)
    if node.profile.status_row is not None:
        try:
            state = state._replace(**(await _status(node))._asdict())
        except DeviceError as error:
            state = state._replace(refused=(error.summary,))
    return state._replace(alarm=node.alarm)


def health(node: Node) -> Request[Health]:
    """Current (A), temperature (°C), recent alarms, or, without a status object, the position (rad).

    `restarts` counts boot messages (CiA 301); no source says that these servos send one.
    """
    status_row, bus = node.profile.status_row, node.settings.state
    row = status_row or node.table["present_position"]

    def take(raw: int) -> Health:
        values = (
            {"position": float(row.to_value(raw))}
            if status_row is None
            else _decode_status(node, raw)._asdict()
        )
        return Health(
            State(at=node.at, alarm=node.alarm, **values),
            restarts=None if bus is None else bus.boots[node.node],
        )

    return read_register(node, row, take, reports_position=status_row is None)
