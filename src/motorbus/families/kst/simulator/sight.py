"""All that a host could read of a servo at a moment, as a value that is cheap to make and to compare."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from typing import cast

from motorbus.core.register import RegisterMap
from motorbus.families.kst.simulator import objects
from motorbus.families.kst.simulator.servo import Servo


def sight(servos: Iterable[Servo], at: float) -> Iterator[tuple[int, tuple[Hashable, ...]]]:
    """The id and the picture of each: its table, and the raw value of each row, in the order of the table."""
    for servo in servos:
        table = servo.profile.table
        yield servo.node, (table, *[objects.read(servo, name, at) for name in table])


def shown(picture: tuple[Hashable, ...], name: str) -> int:
    """The raw value of a row in a picture. Raises RequestError for a row that is not there."""
    table = cast("RegisterMap", picture[0])
    return cast("int", picture[1 + list(table).index(table[name].name)])
