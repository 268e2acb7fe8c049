"""Position, current, temperature, health.

The manual reads the status by the same frame as the position (commands 6 and 7); four public drivers read it at
0x6005. So by the profile `kst` a status is two bytes that are not decoded.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from motorbus.core.family import Health, State
from motorbus.core.request import Request
from motorbus.errors import DeviceError
from motorbus.families.kst import profiles
from motorbus.families.kst.driver.node import Node, feature_row
from motorbus.families.kst.driver.requests import accepted, read_position, read_row, upload


class RawStatus(NamedTuple):
    """The two status bytes of command 7 as received; they may be the position, low byte first."""

    x1: int
    x2: int


class Status(NamedTuple):
    """Supply current (A) and temperature (°C) of a servo with newer firmware."""

    current: float
    temperature: float


def position(node: Node) -> Request[float]:
    """Present position, rad."""
    if node.reading is None:
        row = node.table["present_position"]
        node.reading = read_position(node, lambda raw: float(row.to_value(raw)))
    return node.reading


def status(node: Node) -> Request[RawStatus | Status]:
    """Current (A) and temperature (°C); by the profile `kst` the two raw bytes of command 7."""
    if "status" in node.table:
        return _status(node)
    row = node.table["present_position"]
    return upload(node, row, lambda answer: RawStatus(*accepted(node, row, answer).data.ljust(2, b"\0")[:2]))


def _status(node: Node) -> Request[Status]:
    row = feature_row(node, "status", "current and temperature")

    def decode(raw: int) -> Status:
        return Status(profiles.current(node.profile, raw), float(profiles.temperature(raw)))

    return read_row(node, row, decode)


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
    if "status" in node.table:
        try:
            state = state._replace(**(await _status(node))._asdict())
        except DeviceError as error:
            state = state._replace(refused=(error.summary,))
    return state._replace(alarm=node.alarm)


def health(node: Node) -> Request[Health]:
    """Current (A), temperature (°C), recent alarms, or, without a status object, the position (rad).

    `restarts` counts boot messages (CiA 301); no source says that these servos send one.
    """

    def take(**values: Any) -> Health:
        state = State(at=node.at, alarm=node.alarm, **values)
        return Health(state, restarts=node.settings.state.boots[node.node])

    if "status" in node.table:
        return _status(node).convert(lambda found: take(**found._asdict()))
    return position(node).convert(lambda here: take(position=here))
