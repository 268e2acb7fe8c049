"""Between the 220 bytes of a stored project and its numbers, in both directions and without loss.

A device may hold anything, so nothing is judged here. Bytes that the manual does not name go through untouched when
they are given; there is no command that writes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, Final, Literal, TypeAlias

from motorbus.core.register import Register, shown
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.table.project import STEPS, Project, Step
from motorbus.families.stepper.table.rows import BASE, RESERVED, STEP

Order: TypeAlias = Literal["little", "big"]
BLANK: Final = bytes(wire.IMAGE_LENGTH)
_ORDERS: Final[Mapping[str, Order]] = {"little": "little", "big": "big"}


def checked_order(said: object) -> Order:
    """Which byte of a number comes first in a dump: little (the lowest) or big. Raises RequestError for other words."""
    if (order := _ORDERS.get(str(said))) is None:
        raise RequestError(f"dump_order={shown(said)} is not possible", expected="little or big")
    return order


def decode_image(image: bytes, order: Order = "little") -> Project:
    """The numbers in an image. Raises RequestError when it has not 220 bytes.

    `order` says which byte of a number comes first; that it is the lowest is an assumption.
    """
    _check(image)
    base: dict[str, Any] = {row.name: row_value(image, row, order) for row in BASE}
    steps = tuple(
        Step(**{row.name: row_value(image, row, order, wire.ROW_LENGTH * x) for row in STEP})
        for x in range(1, STEPS + 1)
    )
    return Project(**base, steps=steps)


def encode_image(project: Project, order: Order = "little", *, over: bytes = BLANK) -> bytes:
    """The image of a project; the bytes that no row names are those of `over`.

    Raises RequestError for a number that does not fit its bytes, and when `over` has not 220.
    """
    _check(over)
    image = bytearray(over)
    for row in BASE:
        _put(image, row.address, row, getattr(project, row.name), order, 0)
    for x in range(1, STEPS + 1):
        for row in STEP:
            _put(image, wire.ROW_LENGTH * x + row.address, row, getattr(project.step(x), row.name), order, x)
    return bytes(image)


def row_value(image: bytes, row: Register, order: Order = "little", start: int = 0) -> int:
    """The raw value of one row of an image; `start` is where the row of its step begins, if it counts from there."""
    at = start + row.address
    return int.from_bytes(image[at : at + row.size], order)


def reserved_bytes(image: bytes) -> dict[int, int]:
    """Every byte that no row names and that is not 0, by its offset in the image."""
    _check(image)
    return {at: image[at] for run in RESERVED for at in run if image[at]}


def differences(one: Project, other: Project) -> Iterator[tuple[str, int, int, int]]:
    """The named numbers in which two projects differ: name, step (0: of the project), and both values."""
    for field in fields(Project):
        if field.name != "steps":
            mine, theirs = getattr(one, field.name), getattr(other, field.name)
            if mine != theirs:
                yield field.name, 0, mine, theirs
    for x in range(1, STEPS + 1):
        for field in fields(Step):
            mine, theirs = getattr(one.step(x), field.name), getattr(other.step(x), field.name)
            if mine != theirs:
                yield field.name, x, mine, theirs


def _put(image: bytearray, at: int, row: Register, value: int, order: Order, step: int) -> None:
    if not 0 <= value < 1 << 8 * row.size:
        where = f"step {step}, " if step else ""
        raise RequestError(
            f"{where}{row.name}: {value} does not fit", expected=f"0 to {(1 << 8 * row.size) - 1}"
        )
    image[at : at + row.size] = value.to_bytes(row.size, order)


def _check(image: bytes) -> None:
    if len(image) != wire.IMAGE_LENGTH:
        raise RequestError(
            f"an image of {len(image)} bytes is none", expected=f"{wire.IMAGE_LENGTH} bytes, 11 rows of 20"
        )
