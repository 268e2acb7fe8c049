"""Between the 220 bytes of a stored project and its numbers, in both directions and without loss.

A device may hold anything, so nothing is judged here. Bytes that the manual does not name go through untouched when
they are given; there is no command that writes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Final, Literal, TypeAlias

from motorbus.core.entry import Entry
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.table.project import STEPS, Project, Step
from motorbus.families.stepper.table.rows import BASE, RESERVED, STEP

Order: TypeAlias = Literal["little", "big"]
BLANK: Final = bytes(wire.IMAGE_LENGTH)


def decode_image(image: bytes, order: Order = "little") -> Project:
    """The numbers in an image. Raises RequestError when it has not 220 bytes.

    `order` says which byte of a number comes first; that it is the lowest is an assumption.
    """
    _check(image)
    base: dict[str, Any] = {row.name: _number(image, row.address, row, order) for row in BASE}
    steps = tuple(
        Step(**{row.name: _number(image, wire.ROW_LENGTH * x + row.address, row, order) for row in STEP})
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


def _number(image: bytes, at: int, row: Entry, order: Order) -> int:
    return int.from_bytes(image[at : at + row.size], order)


def _put(image: bytearray, at: int, row: Entry, value: int, order: Order, step: int) -> None:
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
