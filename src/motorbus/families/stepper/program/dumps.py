"""Raw dumps as files hold them, taken in, and the command frames of a project, given out.

A dump file is the 226 bytes that a controller sent, or the 220 of the image alone, as they are or in hexadecimal. There
is no checksum, so what can be checked is: that the project is said twice alike, and that no number is one that no
command puts there. What fails is told with field and range, for a bit that has turned over in a file is not to be sent
to a motor. What a controller may well hold is taken, if it makes sense or not: a loop that a shorter project has left
behind, no geometry after clearing. The lint tells that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.program.words import HELD
from motorbus.families.stepper.table import (
    BASE_NAMES,
    STEP_NAMES,
    STEPS,
    Order,
    Project,
    check,
    decode_image,
    edits,
    refusal,
    refusals,
)

_HEX: Final = re.compile(rb"[\s0-9A-Fa-f]+")
_HELD: Final = {**HELD, "total_steps": range(STEPS + 1)}
"""0 steps: it was cleared, and has not been selected since."""


class Raw(NamedTuple):
    """A project and the 220 bytes it came from; `asked` is the project its reply names, 0 for a bare image."""

    project: Project
    image: bytes
    asked: int


def from_dump(data: bytes, *, order: Order = "little", strict: bool = True, expert: bool = True) -> Raw:
    """A dump of 226 bytes, or an image of 220, or either of them in hexadecimal.

    With `strict` no field may hold what no command puts there. Raises RequestError, naming the field and its range.
    """
    image, asked = _image(_binary(data))
    project = decode_image(image, order)
    if strict:
        for text, expected in faults(project, asked, expert=expert):
            raise RequestError(
                f"this dump cannot be right: {text}",
                expected=expected,
                cause="bytes were lost, or a bit has changed; a dump has no checksum",
                advice="read the project from the controller again",
            )
    return Raw(project, image, asked)


def faults(project: Project, asked: int = 0, *, expert: bool = True) -> Iterator[tuple[str, str]]:
    """What in a dump cannot be, for no commands that are taken lead there: what is wrong, and what may be.

    Steps behind the last one are not judged, nor is what the lint is for. A project that was cleared has the number 0.
    """
    if asked and project.number != asked and (project.number or project.total_steps):
        yield f"number: the reply says project {asked} and its image {project.number}", f"{asked} twice"
    carried_out = range(1, min(project.total_steps, STEPS) + 1)
    numbers = [(name, 0, getattr(project, name)) for name in BASE_NAMES]
    numbers += [(name, n, getattr(project.step(n), name)) for n in carried_out for name in STEP_NAMES]
    for name, step, raw in numbers:
        error = refusal(name, raw, step=step, expert=expert)
        if error is not None and raw not in _HELD.get(name, ()):
            yield error.summary, error.expected


def frames(project: Project, *, motor: int = wire.MOTOR, save: bool = True) -> list[bytes]:
    """The requests that write a project and, with `save`, keep it: 9 + 7n of them for n steps.

    Raises RequestError for a project that has been cleared, and for a number that a controller would ignore: it would
    then write the rest into whichever project is selected. A loop from a step to an earlier one is refused too.
    """
    if project == Project(number=project.number):
        raise RequestError(
            f"project {project.number} has been cleared: there is nothing to write",
            expected="at least one step",
            advice="a controller clears a project by one order, 1E",
        )
    for error in refusals(project, expert=True):
        raise error
    for edit in edits(project):
        check(edit.command, edit.values, expert=True)
    found = [edit.frame(motor) for edit in edits(project)]
    return [*found, wire.encode("save_project", project=project.number)] if save else found


def _binary(data: bytes) -> bytes:
    if len(data) in (wire.DUMP_LENGTH, wire.IMAGE_LENGTH) or not _HEX.fullmatch(data):
        return data
    digits = b"".join(data.split())
    if len(digits) % 2:
        raise RequestError(
            f"a dump in hexadecimal of {len(digits)} digits ends in half a byte", expected="226 bytes, or 220"
        )
    return bytes.fromhex(digits.decode("ascii"))


def _image(data: bytes) -> tuple[bytes, int]:
    if len(data) == wire.IMAGE_LENGTH:
        return data, 0
    if fault := wire.dump_fault(data):
        raise RequestError(
            f"this is no dump of a project: {fault}",
            received=data[:12],
            expected="226 bytes that begin with FF AA 3E and the project, or the 220 bytes behind them",
            cause="bytes were lost, or the file is another one",
        )
    dump = wire.decode_dump(data)
    return dump.image, dump.project
