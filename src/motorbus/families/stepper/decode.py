"""Frames of the stepper controller as text, field by field, with the reason why a frame is invalid."""

from __future__ import annotations

from motorbus.core.decode import Fields, counted
from motorbus.core.family import Explanation
from motorbus.core.recording import RecordedFrame
from motorbus.errors import RequestError
from motorbus.families.stepper import parameters, protocol
from motorbus.families.stepper.parameters import ALL_OUTPUTS, PARAMETERS, ROW_LENGTH, TABLE, UNITS, Order
from motorbus.families.stepper.protocol import REPLY_LENGTH, Command, Recording


def explain(data: bytes, order: Order = "little") -> list[Explanation]:
    """All frames in these bytes, in both directions, and the bytes that are no frame. Never raises."""
    recording = Recording()
    found = []
    for event in recording.feed(data) + recording.flush():
        if isinstance(event, RecordedFrame) and event.kind == "notice":
            title = "notice: the project has ended"
            fields = Fields(event.data)
            fields.take_rest("notice", "a project that was started has ended")
            found.append(Explanation(event.data, title, tuple(fields.parts)))
        elif isinstance(event, RecordedFrame) and event.kind == "reply":
            found.append(_reply(event.data, order))
        elif isinstance(event, RecordedFrame) or event.fault == "checksum":
            found.append(_request(event.data))
        else:
            fields, fault = Fields(event.data), f"{counted(len(event.data))} of no frame"
            fields.take_rest("bytes", fault)
            found.append(Explanation(event.data, "no frame", tuple(fields.parts), fault))
    return found


def _take_head(fields: Fields, data: bytes, command: Command | None) -> str:
    """Take header and command; return the title of the command."""
    fields.take(2, "header", "FF AA")
    if command is None:
        fields.take(2, "command", f"no command {data[2:4].hex(' ').upper()}")
        return "unknown command"
    if len(command.code) > 1:
        fields.take(1, "class", f"motor {data[2]}" if data[2] else "inputs and outputs")
    fields.take(1, "command", f"{command.title} (item {command.number})")
    return command.title


def _request(data: bytes) -> Explanation:
    command = protocol.command_at(data)
    fields, values, faults = Fields(data), {}, []
    title = f"request: {_take_head(fields, data, command)}"
    for name, at in command.fields.items() if command else ():
        _take_unused(fields, data, at)
        size = PARAMETERS[name].size
        values[name] = int.from_bytes(data[at : at + size], "little")
        meaning = _meaning(name, values[name], command)
        fields.take(size, name, meaning)
        title += f", {name.replace('_', ' ')} {meaning}"
    _take_unused(fields, data, len(data) - 1)
    due = sum(data[:-1]) & 0xFF
    if data[-1] != due:
        faults.append(f"the checksum is {data[-1]:02X}, {due:02X} is correct")
    fields.take_rest("checksum", faults[0] if faults else f"{due:02X}, correct")
    if command is None:
        faults.append(f"no command {data[2:4].hex(' ').upper()}")
    else:
        try:
            protocol.check(command.name, values, expert=True)
        except RequestError as error:
            faults.append(f"{error.summary}: {error.expected}")
    return Explanation(data, title, tuple(fields.parts), "; ".join(faults))


def _take_unused(fields: Fields, data: bytes, until: int) -> None:
    unused = data[len(data) - len(fields.rest) : until]
    fields.take(len(unused), "unused", "not 0" if any(unused) else "0")


def _reply(data: bytes, order: Order) -> Explanation:
    command = protocol.command_at(data)
    assert command is not None, "a reply is one to a command"
    fields, fault = Fields(data), ""
    title = f"reply: {_take_head(fields, data, command)}"
    repeats = command.repeats[1:] if len(command.code) > 1 else command.repeats
    for name, raw in zip(repeats, data[REPLY_LENGTH - len(repeats) : REPLY_LENGTH], strict=True):
        row = "project" if name == "selected" else name
        fields.take(1, row or "unused", _meaning(row, raw, command) if row else "0")
        title += f", {row} {_meaning(row, raw, command)}" if row else ""
    if len(data) > REPLY_LENGTH:
        fault = _image(fields, order, data[3])
    return Explanation(data, title, tuple(fields.parts), fault)


def _image(fields: Fields, order: Order, number: int) -> str:
    """Take the image of a project; return why no controller can have stored it."""
    image, at = fields.rest, 0
    for name, row in TABLE.items():
        if row.address < at:
            continue  # in a step that is all 0
        fields.take(row.address - at, "reserved", _reserved(image[at : row.address]))
        step, offset = divmod(row.address, ROW_LENGTH)
        at = row.address + row.size
        if step and not offset and not any(image[row.address :][:ROW_LENGTH]):
            at = row.address + ROW_LENGTH
            fields.take(ROW_LENGTH, f"step {step}", "all 0")
        else:
            fields.take(row.size, name, _meaning(name, int.from_bytes(image[row.address : at], order)))
    fields.take_rest("reserved", _reserved(image[at:]))
    project = parameters.decode_image(image, order)
    if project.is_cleared:
        return ""
    if project.number != number:
        return f"the reply names project {number} and its image {project.number}"
    faults = parameters.check_project(project, expert=True)
    return f"{faults[0].summary} ({faults[0].expected})" if faults else ""


def _reserved(data: bytes) -> str:
    return f"{data.hex(' ').upper()}, not known" if any(data) else "0"


def _meaning(name: str, raw: int, command: Command | None = None) -> str:
    """A number in words; the ports of outputs differ from those of inputs."""
    if name == "port" and raw >= ALL_OUTPUTS and command and command.name == "set_output":
        return f"{raw} ({'all outputs' if raw == ALL_OUTPUTS else 'both LEDs'})"
    name = name if name in PARAMETERS else name.split("_", 2)[2]
    if raw in PARAMETERS[name].choices:
        return f"{raw} ({PARAMETERS[name].choices[raw]})"
    return f"{raw} {UNITS[name]}" if name in UNITS else str(raw)
