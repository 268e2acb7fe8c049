"""Requests and replies as bytes, and the last gate before the wire.

    request   FF AA  b2 ... b9  sum      11 bytes; the sum is the low byte of the sum of all ten before it
    reply     FF AA  b2 b3 b4 b5          6 bytes, without a checksum
    dump      a reply and 220 bytes       only to "read project"
    notice    EE DD                       a project that was started has run to its end

The additive sum does not see swapped bytes, and a reply has none at all, so a reply is compared with what is due byte
by byte. Nothing here raises on what a device sent; a number that no frame can carry is a RequestError and never sent.
What a device accepts is said by the rows of `table`, and checked there.

Source: stepper controller serial protocol manual; all 27 example frames of it carry a correct checksum, so where one
of its annotations says otherwise the frame is right.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple, TypeAlias

from motorbus.errors import RequestError
from motorbus.families.stepper.wire.commands import COMMANDS, IO, MOTOR_CLASS, SYSTEM, Command, command_of

HEADER: Final = b"\xff\xaa"
NOTICE: Final = b"\xee\xdd"
"""A project that was started by command 13 has run to its end."""
REQUEST_LENGTH: Final = 11
REPLY_LENGTH: Final = 6
IMAGE_LENGTH: Final = 220
"""Bytes of one stored project: 11 rows of 20."""
DUMP_LENGTH: Final = REPLY_LENGTH + IMAGE_LENGTH
MOTOR: Final = 3
"""The motor number in every frame of the manual; perhaps the rest of a relative with several motors."""
MOTORS: Final = frozenset(range(1, 256)) - {number for number in range(256) if number & 0x0F == 0x0E}
"""Numbers that a motor can have and still be told from the other two classes."""
ONLY: Final = 1
"""What the controller of a line is called: its frames carry no address, so there is one of them."""
DUMP: Final = COMMANDS["read_project"]
HIGHEST_PROJECT: Final = 4
HIGHEST_PORT: Final = 5
HIGHEST_STEP: Final = 10

Key: TypeAlias = tuple[int, ...]
"""What matches a reply to its request: all that can be known beforehand of bytes 2 to 5, see `key_of`."""


class RequestParts(NamedTuple):
    """A request taken apart: which command, its numbers by name, and the motor it names (0: none)."""

    command: Command
    values: Mapping[str, int]
    motor: int


class ReplyParts(NamedTuple):
    """A reply taken apart. What its class does not repeat is None; `data` is the image of a dump, else empty."""

    command: Command
    motor: int
    project: int | None
    step: int | None
    port: int | None
    level: int | None
    data: bytes


def checksum(data: bytes) -> int:
    """The low byte of the sum of the first ten bytes of a request."""
    return sum(data[: REQUEST_LENGTH - 1]) & 0xFF


def encode(name: str, /, *, motor: int = MOTOR, **values: int) -> bytes:
    """A request, by the command's name and its numbers: `encode("set_step_delay", delay=1000, step=1)`.

    Raises RequestError for an unknown command, a number that is missing, one that the command does not carry, one
    that does not fit its bytes, or an impossible motor number.
    """
    command = named(name)
    _check_names(command, values)
    body = bytearray(REQUEST_LENGTH - 1)
    body[:2] = HEADER
    if command.kind == SYSTEM:
        body[2] = command.code
    else:
        body[2], body[3] = _motor(motor) if command.kind == MOTOR_CLASS else 0, command.code
    for place in command.places:
        body[place.offset : place.offset + place.size] = _bytes(
            name, place.name, values[place.name], place.size
        )
    return bytes(body) + bytes((checksum(bytes(body)),))


def named(name: str) -> Command:
    """The command of this name. Raises RequestError when there is none."""
    try:
        return COMMANDS[name]
    except KeyError:
        raise RequestError(
            f"the controller has no command {name!r}", expected=f"one of {', '.join(COMMANDS)}"
        ) from None


def is_sound(data: bytes) -> bool:
    """Whether these bytes are a whole request with header and checksum, of whatever command."""
    return len(data) == REQUEST_LENGTH and data[:2] == HEADER and data[-1] == checksum(data)


def decode_request(data: bytes) -> RequestParts | None:
    """A request taken apart; None when it is not whole, its checksum is wrong or no command is meant by it.

    Reserved bytes are not looked at and no range is checked.
    """
    command = command_of(data[2], data[3]) if is_sound(data) else None
    if command is None:
        return None
    values = {
        place.name: int.from_bytes(data[place.offset : place.offset + place.size], "little")
        for place in command.places
    }
    return RequestParts(command, values, data[2] if command.kind == MOTOR_CLASS else 0)


def key_of(reply: bytes) -> Key:
    """The key of a reply: its bytes 2 to 5, but for what no request can foretell.

    That is the level of an input, and the selected project in the replies to commands 11 and 12.
    """
    command = command_of(reply[2], reply[3])
    if command is None or (command.echo == "project" and command.place("project") is None):
        return tuple(reply[2:3])
    return tuple(reply[2:5] if command.echo == "level" else reply[2:REPLY_LENGTH])


def key_due(request: bytes) -> Key:
    """The key of the reply that is due to this request. Raises RequestError when it is none."""
    return key_of(next(iter(replies_due(request))))


def replies_due(request: bytes) -> frozenset[bytes]:
    """The first six bytes of each reply in which `difference` finds none: two for an input, four where the selected
    project is repeated, else one. Their keys are all the same. Raises RequestError when `request` is none.
    """
    asked = _asked(request)
    projects = range(1, HIGHEST_PROJECT + 1) if _unnamed(asked) else (0,)
    levels = (0, 1) if asked.command.echo == "level" else (0,)
    return frozenset(_head(asked, request, project, level) for project in projects for level in levels)


def encode_reply(request: bytes, *, project: int = 0, level: int = 0, image: bytes = b"") -> bytes:
    """What a device answers to this request.

    `project` is the selected one, which commands 11 and 12 repeat although their requests do not name it; `level` is
    that of the input asked for; `image` are the 220 bytes of a dump. Raises RequestError when `request` is none, or
    `image` is not what its reply holds.
    """
    asked = _asked(request)
    head = _head(asked, request, project, level)
    if len(image) != (IMAGE_LENGTH if asked.command is DUMP else 0):
        raise RequestError(f"{len(image)} bytes do not follow the reply to {asked.command.name}")
    return head + image


def _asked(request: bytes) -> RequestParts:
    asked = decode_request(request)
    if asked is None:
        raise RequestError("there is no reply to what is no request", sent=request)
    return asked


def _head(asked: RequestParts, request: bytes, project: int, level: int) -> bytes:
    command, values = asked.command, asked.values
    reply = bytearray(HEADER + request[2:4] + b"\0\0")
    if command.kind == SYSTEM:
        reply[3] = values.get("project", project) if command.echo == "project" else 0
    elif command.echo == "step":
        reply[5] = values["step"]
    elif command.echo in ("port", "level"):
        reply[4] = values["port"]
        reply[5] = level if command.echo == "level" else 0
    return bytes(reply)


def _unnamed(asked: RequestParts) -> bool:
    """Its reply repeats a project that the request does not name."""
    return asked.command.echo == "project" and "project" not in asked.values


def reply_fault(data: bytes) -> str:
    """Why these first six bytes cannot be a reply to anything; "" when they can."""
    if data[:2] != HEADER:
        return "a reply begins with FF AA"
    command = command_of(data[2], data[3])
    if command is None:
        return f"there is no command {data[2]:02X} {data[3]:02X}"
    if data[4] > (HIGHEST_PORT if command.kind == IO else 0):
        return f"byte 4 is {data[4]:02X}"
    if data[5] > {"step": HIGHEST_STEP, "level": 1}.get(command.echo, 0):
        return f"byte 5 is {data[5]:02X}"
    if command.kind == SYSTEM and data[3] > (HIGHEST_PROJECT if command.echo == "project" else 0):
        return f"byte 3 is {data[3]:02X}"
    return ""


def decode_reply(data: bytes) -> ReplyParts | None:
    """A reply taken apart; None when it is none, or not as long as its command makes it."""
    if len(data) < REPLY_LENGTH or reply_fault(data):
        return None
    command = command_of(data[2], data[3])
    if command is None or len(data) != reply_length(command):
        return None
    return ReplyParts(
        command,
        data[2] if command.kind == MOTOR_CLASS else 0,
        data[3] if command.echo == "project" else None,
        data[5] if command.echo == "step" else None,
        data[4] if command.echo in ("port", "level") else None,
        data[5] if command.echo == "level" else None,
        data[REPLY_LENGTH:],
    )


def reply_length(command: Command) -> int:
    """How many bytes answer this command, a later notice not counted."""
    return DUMP_LENGTH if command is DUMP else REPLY_LENGTH


def difference(request: bytes, reply: bytes, *, project: int | None = None) -> str:
    """In what the first six bytes of a reply differ from what is due to this request, in words; "" when in nothing.

    Every byte is compared. Only the level of an input is free, 0 or 1, and the selected project that commands 11 and
    12 repeat, 1 to 4, unless `project` says which it must be.
    """
    asked = decode_request(request)
    if asked is None:
        return "what was sent is no request"
    if len(reply) < REPLY_LENGTH:
        return f"{len(reply)} bytes came, {REPLY_LENGTH} are due"
    selected = project if project is not None else reply[3]
    if _unnamed(asked) and not 1 <= selected <= HIGHEST_PROJECT:
        return f"byte 3 is {reply[3]:02X}, a project from 01 to 04 is due"
    level = reply[5] if reply[5] in (0, 1) else 0
    due = _head(asked, request, selected, level)
    names = ("header", "header", "class", "command or project", "port", "step or level")
    wrong = [
        f"byte {at} ({names[at]}) is {reply[at]:02X}, {due[at]:02X} is due"
        for at in range(REPLY_LENGTH)
        if reply[at] != due[at]
    ]
    return "; ".join(wrong)


def _check_names(command: Command, values: Mapping[str, int]) -> None:
    wanted = [place.name for place in command.places]
    for name in wanted:
        if name not in values:
            raise RequestError(f"{command.name}: {name} is missing", expected=", ".join(wanted))
    for name in values.keys() - set(wanted):
        raise RequestError(
            f"{command.name} does not carry {name}", expected=", ".join(wanted) or "no number at all"
        )


def _bytes(command: str, name: str, value: int, size: int) -> bytes:
    if not 0 <= value < 1 << 8 * size:
        raise RequestError(
            f"{command}: {name} {value} does not fit its {size} byte{'s' if size > 1 else ''}",
            expected=f"0 to {(1 << 8 * size) - 1}",
            advice="nothing was sent",
        )
    return value.to_bytes(size, "little")


def _motor(number: int) -> int:
    if number not in MOTORS:
        raise RequestError(
            f"{number} is no motor number",
            expected="1 to 255, without those that end in E in hex; the manual knows 3 only",
        )
    return number
