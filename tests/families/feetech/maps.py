"""Servos of every map for scripts of bytes: what they have in registers 0 to 39, and simulated models of each map.

Their bytes are made by hand, as the packets around them: no row of a table says where they lie, unless a test changes
a value by the name of its row.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import motorbus
from motorbus.core.register import Register
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.identity import learn
from motorbus.families.feetech.driver.node import IMAGE
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Line, image, reads

MODELS: Final = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm60-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
_RATES: Final = {"smbl": "115200", "smcl": "115200"}


def spread(row: Register) -> list[int]:
    """Raw values of a row from end to end: all of a row of one byte, and a thousand or so of a longer one."""
    step = max(1, (row.high - row.low) // 997)
    between = {*range(row.low, row.high + 1, step), -1, 0, 1, row.high - 1, row.high}
    return sorted(raw for raw in between if row.low <= raw <= row.high)


def _at(**changes: int) -> dict[str, int]:
    return changes


HEADS: Final = {
    "sts": _at(),
    "smbl": _at(at_0=2, at_1=45, at_3=8, at_4=44),
    "smcl": _at(at_0=1, at_1=10, at_3=6, at_4=12, at_31=0, at_33=0)
    | _at(at_34=0, at_35=0, at_36=200, at_37=20, at_38=200, at_39=80),
    "scs": _at(at_0=0, at_1=10, at_2=1, at_3=5, at_4=4, at_11=3, at_12=0xFF, at_18=0),
    "scs2": _at(at_0=3, at_1=25, at_2=1, at_3=9, at_4=15, at_11=3, at_12=0xFF, at_18=0, at_34=0),
    "hls": _at(at_0=3, at_1=43, at_3=10, at_4=18, at_7=0),
}
"""Map -> what makes an image one of this map: firmware, model, limits over everything, no offset, position mode."""


def eeprom(name: str, id: int = 3, **changes: int) -> bytes:
    """Registers 0 to 39 of a servo of this map, made by hand.

    But for `changes`: bytes by address, as `at_33=1`, and raw values by the name of the row.
    """
    by_address = {key: byte for key, byte in changes.items() if key.startswith("at_")}
    data = bytearray(image(id, **{**HEADS[name], **by_address}))
    for row_name in changes.keys() - by_address.keys():
        row = TABLES[name][row_name]
        data[row.address : row.address + row.size] = row.encode(changes[row_name])
    assert len(data) == IMAGE
    return bytes(data)


def prepares_as(name: str, id: int = 3, **changes: int) -> Line:
    """The READ that tells what such a servo is and how it is set."""
    return reads(id, 0, *eeprom(name, id, **changes))


def met(name: str, id: int = 3, **changes: int) -> Node:
    """Such a servo, asked already."""
    node = Node(id)
    learn(node, eeprom(name, id, **changes))
    return node


@contextmanager
def simulated(name: str, **options: Any) -> Iterator[tuple[Any, Any]]:
    """A simulated servo 3 of this map as shipped, and the device that talks to it at the rate it ships with."""
    with (
        motorbus.simulate("feetech", ids="3", model=MODELS[name], **options) as simulation,
        motorbus.open(simulation.url, baud=_RATES.get(name, "1000000")) as bus,
    ):
        yield simulation[3], motorbus.feetech.Servo(bus, 3)
