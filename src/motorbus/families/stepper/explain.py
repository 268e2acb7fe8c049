"""Every byte of a conversation with a stepper controller in words, and why what is wrong is wrong.

Requests and replies begin alike, and for more than half of the commands a reply is the first six bytes of its request.
What tells them apart is the checksum: eleven bytes with a right one are a request. A dump is told by its length and
each of its 226 bytes has a name, if only "reserved".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from motorbus.core.family import Explanation, Part
from motorbus.core.register import Register
from motorbus.errors import RequestError
from motorbus.families.stepper import table, wire
from motorbus.families.stepper.program.dumps import faults

_HEADERS: Final = (wire.HEADER, wire.NOTICE)
_COUNTS: Final = {
    "step_angle": "hundredths of a degree",
    "turn_distance": "units per turn",
    "distance": "units",
    "start_frequency": "Hz",
    "acceleration": "Hz",
    "speed": "RPM",
    "delay": "ms",
}


class Field(NamedTuple):
    """So many bytes, what they are called and what they say."""

    size: int
    name: str
    meaning: str


def explain(data: bytes, order: table.Order = "little") -> list[Explanation]:
    """Every frame in a run of bytes, in order, in parts that hold all of its bytes; `fault` is "" for a good one.

    What belongs to no frame is a run of its own, and bad. `order` says which byte of a number comes first in dumps; in
    requests it is always the lowest. Never raises.
    """
    told: list[Explanation] = []
    start = noise = 0
    while start < len(data):
        size = _size(data[start : start + wire.DUMP_LENGTH])
        if not size:
            start += 1
            continue
        if noise < start:
            told.append(_stray(data[noise:start]))
        told.append(_explained(data[start : start + size], order))
        start = noise = start + size
    return [*told, _stray(data[noise:])] if noise < len(data) else told


def _size(data: bytes) -> int:
    """How many bytes belong to what begins here; 0: nothing does."""
    if data[:2] == wire.NOTICE:
        return len(wire.NOTICE)
    if data[:2] != wire.HEADER:
        return 0
    if _is_dump(data):
        return min(len(data), wire.DUMP_LENGTH)
    behind = data[wire.REPLY_LENGTH : wire.REQUEST_LENGTH]
    sound = wire.is_sound(data[: wire.REQUEST_LENGTH])
    if sound or (len(data) >= wire.REQUEST_LENGTH and not _begins_in(behind)):
        return wire.REQUEST_LENGTH  # what begins nothing of its own belongs to a request, if a damaged one
    return min(len(data), wire.REPLY_LENGTH)


def _is_dump(data: bytes) -> bool:
    """Longer than a request, with the beginning of a dump, and no request by its checksum."""
    begins = data[2:3] == bytes((wire.COMMANDS["read_project"].code,)) and not wire.reply_fault(
        data[:6].ljust(6, b"\1")
    )
    return begins and not wire.is_sound(data[: wire.REQUEST_LENGTH])


def _begins_in(data: bytes) -> bool:
    return any(header in data for header in _HEADERS) or data[-1:] in (b"\xff", b"\xee")


def _explained(data: bytes, order: table.Order) -> Explanation:
    if data == wire.NOTICE:
        return _made(
            data, "a project has run to its end", [Field(2, "notice", "a project that was started has ended")]
        )
    if wire.is_sound(data) or (len(data) == wire.REQUEST_LENGTH and not _is_dump(data)):
        return _request(data)
    if len(data) < wire.REPLY_LENGTH:
        return _short(data, f"{len(data)} bytes of a reply of {wire.REPLY_LENGTH}")
    return _dump(data, order) if _is_dump(data) else _reply(data)


def _stray(data: bytes) -> Explanation:
    fault = (
        f"{len(data)} bytes that belong to no frame" if len(data) > 1 else "a byte that belongs to no frame"
    )
    return Explanation(data, "no frame", (Part(0, data, "bytes", fault),), fault)


def _short(data: bytes, fault: str) -> Explanation:
    return _made(data, "a beginning", [Field(len(data), "bytes", fault)], fault)


def _made(data: bytes, title: str, fields: list[Field], fault: str = "") -> Explanation:
    parts, start = [], 0
    for size, name, meaning in fields:
        parts.append(Part(start, data[start : start + size], name, meaning))
        start += size
    if start < len(data):
        parts.append(Part(start, data[start:], "bytes", "more than belongs here"))
    return Explanation(data, title, tuple(parts), fault)


# --- requests and replies ---------------------------------------------------------------------------------------------


def _head(data: bytes, command: wire.Command | None) -> list[Field]:
    fields = [Field(2, "header", "FF AA")]
    if command is None:
        return [*fields, Field(2, "command", f"there is no command {data[2:4].hex(' ').upper()}")]
    title = f"{table.ORDERS[command.name].title} (command {command.number})"
    if command.kind == wire.SYSTEM:
        return [*fields, Field(1, "command", title)]
    class_ = (
        Field(1, "motor", f"motor {data[2]}")
        if command.kind == wire.MOTOR_CLASS
        else Field(1, "class", "I/O")
    )
    return [*fields, class_, Field(1, "command", title)]


def _request(data: bytes) -> Explanation:
    command = wire.command_of(data[2], data[3])
    fields, faults, values, raws = _head(data, command), [], [], {}
    for place in command.places if command else ():
        at = sum(field.size for field in fields)
        fields += _unused(data[at : place.offset])
        raw = int.from_bytes(data[place.offset : place.offset + place.size], "little")
        fields.append(Field(place.size, place.name, _value(place.name, raw, command)))
        values.append(f"{place.name.replace('_', ' ')} {_value(place.name, raw, command)}")
        raws[place.name] = raw
        if not table.is_allowed(place.name, raw, expert=True):
            faults.append(f"{place.name} {raw} is not possible: {table.allowed(place.name, expert=True)}")
    if command is not None and not faults:
        faults += _refused(command, raws)
    fields += _unused(data[sum(field.size for field in fields) : -1])
    due = wire.checksum(data)
    right = data[-1] == due
    fields.append(
        Field(1, "checksum", f"{data[-1]:02X}, right" if right else f"{data[-1]:02X}, {due:02X} is right")
    )
    if command is None:
        faults.append(f"there is no command {data[2:4].hex(' ').upper()}")
    if not right:
        faults.insert(0, f"the checksum is {data[-1]:02X}, {due:02X} is right")
    title = table.ORDERS[command.name].title if command else "unknown request"
    return _made(data, f"request: {', '.join([title, *values])}", fields, "; ".join(faults))


def _refused(command: wire.Command, raws: Mapping[str, int]) -> Iterator[str]:
    """Why nobody would send numbers of which each is possible: a loop that ends before it begins."""
    try:
        table.check(command.name, raws, expert=True)
    except RequestError as error:
        yield f"{error.summary}: {error.expected}"


def _unused(data: bytes) -> list[Field]:
    return (
        [Field(len(data), "unused", "0" if not any(data) else f"{data.hex(' ').upper()}, 0 is usual")]
        if data
        else []
    )


def _reply(data: bytes) -> Explanation:
    command = wire.command_of(data[2], data[3])
    fault = wire.reply_fault(data)
    fields = _head(data, command)
    if command is not None:
        names = {"project": (3, "project"), "step": (5, "step"), "port": (4, "port"), "level": (4, "port")}
        named = dict([names[command.echo]] if command.echo else []) | (
            {5: "level"} if command.echo == "level" else {}
        )
        for at in range(sum(field.size for field in fields), wire.REPLY_LENGTH):
            name = named.get(at, "fixed")
            fields.append(
                Field(1, name, _value(name, data[at], command) if at in named else f"{data[at]:02X}")
            )
    said = "; ".join(
        f"{field.name} {field.meaning}"
        for field in fields
        if field.name in ("project", "step", "port", "level")
    )
    title = f"{table.ORDERS[command.name].title}: acknowledged" if command else "unknown reply"
    return _made(data, f"reply: {title}{', ' + said if said else ''}", fields, fault)


def _value(name: str, raw: int, command: wire.Command | None = None) -> str:
    row: Register = table.PARAMETERS[name]
    if name == "port" and command is not None and command.name == "set_output":
        return {4: "4 (all outputs)", 5: "5 (both LEDs)"}.get(raw, str(raw))
    if name == "step_angle":
        return f"{raw / 100:g}° ({raw})"
    if raw in row.choices:
        return f"{raw} ({row.choices[raw]})"
    return f"{raw} {_COUNTS[name]}" if name in _COUNTS else str(raw)


# --- the dump -------------------------------------------------------------------------------------------------------


def _dump(data: bytes, order: table.Order) -> Explanation:
    if fault := wire.dump_fault(data):
        head = [
            *_head(data, wire.COMMANDS["read_project"]),
            Field(1, "project", str(data[3])),
            Field(2, "fixed", "00 00"),
        ]
        rest = Field(len(data) - wire.REPLY_LENGTH, "image", "not all of it")
        return _made(data, f"a dump of project {data[3]} that is not whole", [*head, rest], fault)
    image = data[wire.REPLY_LENGTH :]
    project = table.decode_image(image, order)
    fields = [
        *_head(data, wire.COMMANDS["read_project"]),
        Field(1, "project", str(data[3])),
        Field(2, "fixed", "00 00"),
    ]
    fields += _row(image, table.BASE, 0, order)
    for number in range(1, table.STEPS + 1):
        bare = image[number * wire.ROW_LENGTH : (number + 1) * wire.ROW_LENGTH]
        if any(bare):
            fields += _row(image, table.STEP, number, order)
        else:
            fields.append(Field(wire.ROW_LENGTH, f"step {number}", "all 0"))
    wrong = [f"{what} ({may})" for what, may in faults(project, data[3])]
    count = f"{project.total_steps} step{'' if project.total_steps == 1 else 's'}"
    return _made(data, f"dump of project {data[3]}, {count}", fields, "; ".join(wrong))


def _row(image: bytes, rows: tuple[Register, ...], number: int, order: table.Order) -> Iterator[Field]:
    where = f"step {number}" if number else "project"
    start = at = number * wire.ROW_LENGTH
    for row in rows:
        if at < start + row.address:
            yield _reserved(image[at : start + row.address], where)
            at = start + row.address
        raw = table.row_value(image, row, order, start)
        name = f"step_{number}_{row.name}" if number else row.name  # as it is read by
        yield Field(row.size, name, _value(row.name, raw))
        at += row.size
    yield _reserved(image[at : start + wire.ROW_LENGTH], where)


def _reserved(data: bytes, where: str) -> Field:
    return Field(
        len(data), f"{where}, reserved", "0" if not any(data) else f"{data.hex(' ').upper()}, not known"
    )
