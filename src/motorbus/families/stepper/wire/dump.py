"""The 226 bytes that answer "read project": six of a reply, then the image of the project, 11 rows of 20 bytes.

Row 0 is the project, rows 1 to 10 are its steps. Which number stands where in a row is said by `table`; here is what
holds whatever they mean. There is no checksum, so the frame around the image is all that can be checked.

Source: stepper controller serial protocol manual, item 15; it writes [row][column] and prints no order of bytes.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.errors import FramingError, RequestError
from motorbus.families.stepper.wire.frames import (
    DUMP,
    DUMP_LENGTH,
    HEADER,
    HIGHEST_PROJECT,
    IMAGE_LENGTH,
    REPLY_LENGTH,
)

ROW_LENGTH: Final = 20


class Dump(NamedTuple):
    """The project that was asked for, as the reply says, and its image of 220 bytes."""

    project: int
    image: bytes

    def row(self, number: int) -> bytes:
        """Row 0, the project, or 1 to 10, a step: 20 bytes."""
        return self.image[number * ROW_LENGTH : (number + 1) * ROW_LENGTH]


def encode_dump(project: int, image: bytes) -> bytes:
    """The whole reply. Raises RequestError for a project that is none or an image that has not 220 bytes."""
    if not 1 <= project <= HIGHEST_PROJECT:
        raise RequestError(f"there is no project {project}", expected=f"1 to {HIGHEST_PROJECT}")
    if len(image) != IMAGE_LENGTH:
        raise RequestError(f"an image of {len(image)} bytes is none", expected=f"{IMAGE_LENGTH} bytes")
    return HEADER + bytes((DUMP.code, project, 0, 0)) + image


def dump_fault(data: bytes, project: int | None = None) -> str:
    """Why these bytes are not the dump of a project (of this one), in words; "" when they are."""
    if len(data) != DUMP_LENGTH:
        return f"{len(data)} bytes, {DUMP_LENGTH} are due"
    if data[:2] != HEADER or data[2] != DUMP.code:
        return f"it begins with {data[:3].hex(' ').upper()}, FF AA {DUMP.code:02X} is due"
    if not 1 <= data[3] <= HIGHEST_PROJECT or data[3] != (data[3] if project is None else project):
        asked = f"1 to {HIGHEST_PROJECT}" if project is None else str(project)
        return f"byte 3 says project {data[3]}, {asked} is due"
    if any(data[4:REPLY_LENGTH]):
        return f"bytes 4 and 5 are {data[4:6].hex(' ').upper()}, 00 00 is due"
    return ""


def decode_dump(data: bytes, project: int | None = None) -> Dump:
    """The image in a dump. Raises FramingError, with what is wrong, when it is none or of another project."""
    if fault := dump_fault(data, project):
        raise FramingError(
            f"this is no dump of a project: {fault}",
            received=data,
            expected=f"{DUMP_LENGTH} bytes: FF AA 3E, the project, 00 00, and {IMAGE_LENGTH} bytes",
            cause="bytes were lost or added on the way",
            advice="read it again; a file must hold all of the bytes that came",
        )
    return Dump(data[3], data[REPLY_LENGTH:])
