"""What a servo feels: its position, and with newer firmware its current and its temperature.

The manual reads the status by the very frame that reads the position, and answers alike; four public drivers read it
elsewhere. So by the profile `kst` a status is two bytes that nothing decodes, and a warning.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

from motorbus.core.family import State
from motorbus.core.register import Register
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.families.kst import table
from motorbus.families.kst.driver.exchanges import decided, ready, upload, upload_row
from motorbus.families.kst.driver.node import Node
from motorbus.families.kst.driver.refusals import lacking
from motorbus.families.kst.wire import SdoReply

T = TypeVar("T")

SAME_FRAME: Final = (
    "the manual's command 7 is the same frame as its command 6, read position: this device may be returning the "
    "position, low byte first"
)


class RawStatus(NamedTuple):
    """The two status bytes of the manual's command 7, as they came; `warning` says why nothing decodes them."""

    x1: int
    x2: int
    warning: str = SAME_FRAME


class Status(NamedTuple):
    """The status of a servo with newer firmware: supply current in A, temperature in °C."""

    current: float
    temperature: float


def position(node: Node) -> Runnable[float]:
    """Present position, rad."""
    return ready(node, position_exchange)


def position_exchange(node: Node) -> Request[float]:
    """As `position`, of a servo whose id format is known: one exchange that can be kept and run again."""
    return kept(node, "position", _position)


def _position(node: Node) -> Request[float]:
    row = node.table["present_position"]
    return upload_row(node, row, lambda raw: float(row.to_value(raw)), reports_position=True)


def kept(node: Node, name: str, make: Callable[[Node], Request[T]]) -> Request[T]:
    """The exchange that brings this quantity: made once, and anew when the node is asked in another id format."""
    extended = node.dialect.extended(node.node)
    found = node.kept.get(name)
    if found is None or found[0] is not extended:
        found = node.kept[name] = extended, make(node)
    return found[1]


def status(node: Node) -> Runnable[RawStatus | Status]:
    """By the profile `kst` the two raw bytes of command 7, with a warning; else current (A) and temperature (°C)."""
    return ready(node, raw_status if node.profile.status_row is None else _felt)


def raw_status(node: Node) -> Request[RawStatus]:
    """The manual's command 7, whatever the profile: the bytes may be a position."""
    return kept(node, "raw_status", _raw_status)


def _raw_status(node: Node) -> Request[RawStatus]:
    row = node.table["present_position"]

    def take(reply: SdoReply) -> RawStatus:
        return RawStatus(*(reply.data + bytes(2))[:2])

    return upload(node, row.address, row.subindex or 0, take)


def current(node: Node) -> Runnable[float]:
    """Supply current, A. Raises RequestError where the profile has no status object."""
    _status_row(node)
    return ready(node, lambda same: kept(same, "current", _current))


def temperature(node: Node) -> Runnable[float]:
    """Temperature inside, °C. Raises RequestError where the profile has no status object."""
    _status_row(node)
    return ready(node, lambda same: kept(same, "temperature", _temperature))


async def telemetry(node: Node) -> State:
    """One sample: position (rad); current (A) and temperature (°C) where the profile has them; alarms heard lately.

    Whether it moves, how fast, at what voltage and under what load is None: these servos do not tell.
    """
    await decided(node)
    here = await position_exchange(node)
    at = node.at
    if node.profile.status_row is None:
        return State(at=at, position=here, alarm=node.alarm)
    felt = await _felt(node)
    return State(at=at, position=here, current=felt.current, temperature=felt.temperature, alarm=node.alarm)


def _felt(node: Node) -> Request[Status]:
    return kept(node, "status", _status)


def _status(node: Node) -> Request[Status]:
    def take(raw: int) -> Status:
        return Status(table.current(node.profile, raw), float(table.temperature(node.profile, raw)))

    return upload_row(node, _status_row(node), take)


def _current(node: Node) -> Request[float]:
    return upload_row(node, _status_row(node), lambda raw: table.current(node.profile, raw))


def _temperature(node: Node) -> Request[float]:
    return upload_row(node, _status_row(node), lambda raw: float(table.temperature(node.profile, raw)))


def _status_row(node: Node) -> Register:
    if node.profile.status_row is None:
        raise lacking(node, "current and temperature", "status")
    return node.profile.status_row
