"""What the tests of the numbered points share: what only asks, what was sent, and a device that is known."""

from __future__ import annotations

from typing import Any

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from tests.support.machines import Heard


def asks(data: Data) -> bool:
    """PING, READ or SYNC READ of FEETECH; an SDO upload; read project or read input of a stepper controller."""
    if isinstance(data, CanFrame):
        return data.id > 0x600 and data.data[0] & 0xE0 == 0x40
    if data[:2] == b"\xff\xff":
        return data[4] in (1, 2, 0x82)
    return data[2] in (0x3E, 0x00)


def sent(sims: Any) -> list[Data]:
    """What left for these since `listened`."""
    return [data for sim in sims.values() for data in sim.line.sent if isinstance(sim.line, Heard)]


def known(axis: Any) -> Any:
    """The device of an axis, once its limits and units have been read."""
    axis.bus.run(axis.able.limits(axis.device))
    return axis.device
