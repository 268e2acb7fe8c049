"""Servos of every map for scripts of bytes: what they have in registers 0 to 39, with a few values said by name.

Values lie where the rows of the map say; the packets around them are made by hand. `MODELS` are simulated models of
each map.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import motorbus
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.node import IMAGE
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, reads

_HEADS: Final = {
    "sts": (3, 10, 0, 9, 3),
    "smbl": (2, 45, 0, 8, 44),
    "smcl": (1, 10, 0, 6, 12),
    "scs": (0, 10, 1, 5, 4),
    "scs2": (3, 25, 1, 9, 15),
    "hls": (3, 43, 0, 10, 18),
}
MODELS: Final = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm60-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
_RATES: Final = {"smbl": "115200", "smcl": "115200"}
_LIMITS: Final = {"sts": (0, 4095), "smbl": (0, 4095), "smcl": (0, 4095), "hls": (0, 4095)}


def eeprom(name: str, **values: int) -> bytes:
    """Registers 0 to 39 of servo 3 with this map: as shipped where that is known, but for raw `values` by name."""
    low, high = _LIMITS.get(name, (20, 1003))
    told = {"id": 3, "min_position_limit": low, "max_position_limit": high, **values}
    data = bytearray(IMAGE)
    for row in TABLES[name].values():
        if row.address < IMAGE:
            raw = told.get(
                row.name, row.default if row.default is not None else row.low if row.low > 0 else 0
            )
            data[row.address : row.address + row.size] = row.encode(raw)
    data[:5] = bytes(_HEADS[name])
    return bytes(data)


def prepares_as(name: str, **values: int) -> Line:
    """The READ that tells what such a servo is and how it is set."""
    return reads(3, 0, *eeprom(name, **values))


def met(name: str, **values: int) -> Node:
    """Such a servo, asked already."""
    node = Node(3)
    learn(node, eeprom(name, **values))
    return node


@contextmanager
def simulated(name: str, **options: Any) -> Iterator[tuple[Any, Any]]:
    """A simulated servo 3 of this map as shipped, and the device that talks to it at the rate it ships with."""
    with (
        motorbus.simulate("feetech", ids="3", model=MODELS[name], **options) as simulation,
        motorbus.open(simulation.url, baud=_RATES.get(name, "1000000")) as bus,
    ):
        yield simulation[3], motorbus.feetech.Servo(bus, 3)
