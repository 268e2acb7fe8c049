"""Frames of the stepper controller: one table of its 27 commands makes requests, replies, keys and texts.

    request   FF AA, 8 bytes, low byte of the sum of the ten bytes before   11 bytes
    reply     FF AA, 4 bytes, no checksum                                    6 bytes; 226 for "read project"
    notice    EE DD: the project that was started has ended                  2 bytes

Byte 2 names the class: xE is a system command, 00 an input or output, anything else the number of a motor. Byte 3 is
the command of a motor, of an input or an output; of a system command it is the first number. Numbers of more than one
byte begin with the lowest.

Source: stepper controller serial protocol manual, items 1 to 26. The manual has two items 17, here 17a and 17b. All 27
example frames carry a correct checksum, so where an annotation differs the frame is right.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.register import shown
from motorbus.core.request import Data, Effect, Event, Noise, Notification, Reply, TimeoutClass
from motorbus.errors import RequestError
from motorbus.families.stepper.parameters import (
    BASE_NAMES,
    IMAGE_LENGTH,
    PARAMETERS,
    STEPS,
    Project,
    check_loop,
    check_value,
)

RATE: Final = 9600  # bit/s; 8 data bits, no parity, 1 stop bit
HEADER: Final = b"\xff\xaa"
NOTICE: Final = b"\xee\xdd"
REQUEST_LENGTH: Final = 11
REPLY_LENGTH: Final = 6
DUMP_LENGTH: Final = REPLY_LENGTH + IMAGE_LENGTH
READ_PROJECT: Final = 0x3E
MOTOR: Final = 3  # in every frame of the manual
ONLY: Final = 1  # id of the one controller of a line; its frames carry no address
COMPLETED: Final = "completed"  # kind of the notice


class Command(NamedTuple):
    """One command.

    `number`      the item of the manual
    `code`        byte 2, and byte 3 unless it is a system command; the motor number of byte 2 is a setting
    `fields`      offset in the request of each number, by name; size and range are those of its parameter row
    `repeats`     bytes 3 to 5 of the reply: the name of a number, "code", "selected" (the selected project, which the
                  request does not name), or "" for 0
    `repeatable`  sending it twice has the same effect as sending it once
    """

    number: str
    name: str
    code: tuple[int, ...]
    fields: Mapping[str, int]
    repeats: tuple[str, ...]
    effect: Effect
    repeatable: bool
    title: str
    note: str

    @property
    def is_edit(self) -> bool:
        """It sets parameters of the project that is selected."""
        return self.effect is Effect.PERSISTENT and self.repeatable

    @property
    def reply_within(self) -> TimeoutClass:
        """STORE if it writes memory that is kept without supply."""
        stores = self.effect is Effect.PERSISTENT and not self.repeatable
        return TimeoutClass.STORE if stores else TimeoutClass.REPLY

    @property
    def reply_length(self) -> int:
        return DUMP_LENGTH if self.code == (READ_PROJECT,) else REPLY_LENGTH


_EDIT: Final = (Effect.PERSISTENT, True)
_STORE: Final = (Effect.PERSISTENT, False)
_MOVE: Final = (Effect.MOTION, False)
_STOP: Final = (Effect.MOTION, True)
_READ: Final = (Effect.NONE, True)
_SWITCH: Final = (Effect.TORQUE, True)


def _row(
    number: str,
    name: str,
    code: tuple[int, ...],
    fields: str,
    repeats: str,
    kind: tuple[Effect, bool],
    title: str,
    note: str = "",
) -> Command:
    """A row; `fields` follow the code, but "step" is byte 9, and `repeats` are the bytes of the reply from byte 3."""
    offsets, at = {}, 2 + len(code)
    for field in fields.split():
        offsets[field] = 9 if field == "step" else at
        at += PARAMETERS[field].size
    last = (*repeats.split(","), "", "")[:3]
    return Command(number, name, code, offsets, last, *kind, title, note)


_ALL: Final = (
    _row("1", "select_project", (0x6E,), "project total_steps", "project", _EDIT,
         "Select a project and set its number of steps",
         "always writes the number of steps; later edits go to this project, an assumption"),
    _row("2", "set_microstep_and_angle", (MOTOR, 0x01), "microsteps step_angle", "code", _EDIT,
         "Set microsteps and step angle", "angles up to 2.55 degrees"),
    _row("3", "set_turn_distance", (MOTOR, 0x02), "turn_distance", "code", _EDIT,
         "Set the distance of one turn", "defines the unit of all distances"),
    _row("4", "set_step_distance", (MOTOR, 0x03), "distance step", "code,,step", _EDIT, "Set the distance of a step"),
    _row("5", "set_step_direction_start", (MOTOR, 0x04), "direction start_frequency step", "code,,step", _EDIT,
         "Set direction and start frequency of a step"),
    _row("6", "set_step_accel_speed", (MOTOR, 0x05), "acceleration speed step", "code,,step", _EDIT,
         "Set acceleration and speed of a step"),
    _row("7", "set_step_output", (MOTOR, 0x06), "output step", "code,,step", _EDIT,
         "Set what a step does to the outputs"),
    _row("8", "set_step_delay", (MOTOR, 0x07), "delay step", "code,,step", _EDIT, "Set the pause after a step"),
    _row("9", "set_step_start_input", (MOTOR, 0x08), "start_input step", "code,,step", _EDIT,
         "Set the input that a step waits for"),
    _row("10", "set_step_stop_input", (MOTOR, 0x09), "stop_input step", "code,,step", _EDIT,
         "Set the input that ends a step"),
    _row("11", "set_segment_loop", (0x7E,), "loop_first loop_last loop_count", "selected", _EDIT,
         "Set the step loop", "one range for each project"),
    _row("12", "set_project_loop", (0x8E,), "project_loop", "selected", _EDIT,
         "Set how often a project runs", "255 is endless: it sends no notice"),
    _row("13", "start_project", (0x4E,), "project", "project", _MOVE,
         "Start a project", "also input 3; EE DD follows when the project has ended"),
    _row("14", "stop_project", (0x5E,), "", "", _STOP, "Stop the project", "also input 4; names no project"),
    _row("15", "read_project", (READ_PROJECT,), "project", "project", _READ,
         "Read a project", "226 bytes, no checksum"),
    _row("16", "save_project", (0x2E,), "project", "project", _STORE,
         "Save a project", "the edits of the selected project are kept without supply"),
    _row("17a", "clear_project", (0x1E,), "project", "project", _STORE,
         "Clear a project", "all to zero; without project 1 there is no speed to jog with"),
    _row("18", "jog_forward", (MOTOR, 0x0A), "", "code", _MOVE,
         "Jog forward", "until stopped; speed of step 1 of project 1"),
    _row("17b", "jog_reverse", (MOTOR, 0x0B), "", "code", _MOVE,
         "Jog in reverse", "until stopped; speed of step 1 of project 1"),
    _row("19", "run_once", (MOTOR, 0x0C), "", "code", _MOVE,
         "Run one move", "distance and speed of step 1 of project 1"),
    _row("20", "stop_motor", (MOTOR, 0x0D), "", "code", _STOP, "Stop the motor"),
    _row("21", "set_stop_mode", (MOTOR, 0x0E), "stop_mode", "code", _EDIT, "Set the stop mode", "slow or immediate"),
    _row("22", "home", (MOTOR, 0x0F), "", "code", _MOVE,
         "Home", "in reverse until input 5; no limit of travel or time, no notice"),
    _row("23", "set_output", (0, 0x0C), "port level", "code,port", _SWITCH,
         "Set an output", "it may switch a brake, a valve or a gripper"),
    _row("24", "read_input", (0, 0x0B), "port", "code,port,level", _READ,
         "Read an input", "the only reply with a live state"),
    _row("25", "set_mode4", (0x9E,), "mode4", "", _EDIT, "Set the variant of mode 4", "the manual does not explain it"),
    _row("26", "set_power_on_home", (0xAE,), "power_on_home", "", _EDIT,
         "Set homing at power-on", "the motor then moves at power-on"),
)  # fmt: skip
COMMANDS: Final[Mapping[str, Command]] = {command.name: command for command in _ALL}
"""Every command by its name, in the order of the manual."""
_BY_CODE: Final = {command.code: command for command in _ALL}


def command_at(data: bytes) -> Command | None:
    """The command that bytes 2 and 3 of a request or a reply name; None if none."""
    if data[2] & 0x0F == 0x0E:
        return _BY_CODE.get((data[2],))
    return _BY_CODE.get((MOTOR if data[2] else 0, data[3]))  # every motor has these commands # assumption


# -- requests --------------------------------------------------------------------------------------------------------


def encode(name: str, /, *, motor: int = MOTOR, **values: int) -> bytes:
    """A request: `encode("set_step_delay", delay=1000, step=1)`.

    `check` compares with the ranges of the manual. Raises KeyError for an unknown command or a missing number,
    OverflowError for a number that does not fit its bytes.
    """
    command = COMMANDS[name]
    body = bytearray(REQUEST_LENGTH - 1)
    body[:2] = HEADER
    code = command.code if command.code[0] != MOTOR else (motor, command.code[1])
    body[2 : 2 + len(code)] = bytes(code)
    for field, at in command.fields.items():
        size = PARAMETERS[field].size
        body[at : at + size] = values[field].to_bytes(size, "little")
    return bytes(body) + bytes((sum(body) & 0xFF,))


def check(name: str, values: Mapping[str, int], *, expert: bool = False) -> None:
    """Raise RequestError, naming step, field and range, unless a request of this command may carry these numbers.

    `expert` lets a step use inputs 3 and 4, which start and stop projects.
    """
    for field in COMMANDS[name].fields:
        step = values.get("step", 0) if field != "step" else 0
        check_value(field, values[field], step=step, expert=expert)
    check_loop(values.get("loop_first", 0), values.get("loop_last", 0))


def checked_motor(number: int) -> int:
    """The number of a motor. Raises RequestError for one that a frame cannot carry."""
    if 1 <= number <= 255 and number & 0x0F != 0x0E:
        return number
    raise RequestError(
        f"motor {shown(number)} is not possible",
        expected="1 to 255, not ending in E in hex; the manual knows 3 only",
    )


def is_request(data: bytes) -> bool:
    """A whole request of any command with a correct checksum."""
    return len(data) == REQUEST_LENGTH and data[:2] == HEADER and sum(data[:10]) & 0xFF == data[10]


def decode_request(data: bytes) -> tuple[Command, dict[str, int]] | None:
    """The command of a request and its numbers; None unless it is whole, correct and of a known command."""
    command = command_at(data) if is_request(data) else None
    if command is None:
        return None
    sizes = {field: PARAMETERS[field].size for field in command.fields}
    return command, {
        field: int.from_bytes(data[at : at + sizes[field]], "little") for field, at in command.fields.items()
    }


# -- replies ---------------------------------------------------------------------------------------------------------


def encode_reply(request: bytes, *, selected: int = 1, level: int = 0, image: bytes = b"") -> bytes:
    """The reply to this request, which must be one.

    `selected` is the selected project, `level` that of the input, `image` that of the project that is read.
    """
    decoded = decode_request(request)
    assert decoded is not None
    command, values = decoded
    known = {**values, "code": request[3], "selected": selected, "level": level, "": 0}
    return HEADER + request[2:3] + bytes(known[name] for name in command.repeats) + image


def is_reply(data: bytes) -> bool:
    """The first six bytes have the form of a reply: a known command, numbers up to their limit, else 0."""
    command = command_at(data) if data[:2] == HEADER else None
    if command is None:
        return False
    return all(byte <= _HIGHEST[name] for name, byte in zip(command.repeats, data[3:6], strict=True))


_HIGHEST: Final = {name: row.high for name, row in PARAMETERS.items()} | {
    "": 0,
    "code": 255,
    "selected": PARAMETERS["project"].high,
}


def key_of(reply: bytes) -> bytes:
    """The key of a reply: bytes 2 to 5, with FF for those that a request cannot foretell (level, selected project)."""
    command = command_at(reply)
    if command is None:
        return reply[2:6]
    repeated = zip(command.repeats, reply[3:6], strict=True)
    return reply[2:3] + bytes(0xFF if name in ("level", "selected") else byte for name, byte in repeated)


def expected_key(request: bytes) -> bytes:
    """The key of the reply to this request."""
    return key_of(encode_reply(request))


# -- edits of a project ----------------------------------------------------------------------------------------------

_EDITS: Final = [command for command in COMMANDS.values() if command.is_edit]


class Edit(NamedTuple):
    """One command that sets parameters, and its numbers."""

    command: str
    values: Mapping[str, int]


def edits(project: Project) -> list[Edit]:
    """The commands that write this project with all ten steps, in order."""
    found = [_edit(project, command) for command in _EDITS if "step" not in command.fields]
    for step in range(1, STEPS + 1):
        found += [_edit(project, command, step) for command in _EDITS if "step" in command.fields]
    return found


def edits_between(before: Project, after: Project) -> list[Edit]:
    """The commands that turn one project into another, the selection first; none if nothing differs."""
    select, *_ = new = edits(after)
    found = [one for old, one in zip(edits(before), new, strict=True) if old != one]
    if found and found[0] != select:
        found.insert(0, select)
    return found


def edited(project: Project, command: str, values: Mapping[str, int]) -> Project:
    """The project after a command that sets parameters; a step that does not exist changes nothing."""
    changes: dict[str, Any] = dict(values)
    if "step" in changes:
        step = changes.pop("step")
        return project.with_step(step, **changes) if 1 <= step <= STEPS else project
    if command == "select_project":
        changes["number"] = changes.pop("project")
    return replace(project, **changes)


def _edit(project: Project, command: Command, step: int = 0) -> Edit:
    known = {"project": project.number, "step": step}
    values = {}
    for name in command.fields:
        source = project if name in BASE_NAMES else project.step(step or 1)
        values[name] = known[name] if name in known else getattr(source, name)
    return Edit(command.name, values)


# -- frames of a line ------------------------------------------------------------------------------------------------


class Recording:
    """Parses recorded frames of a controller, of a host, or of both; see `core.recording.RecordingReceiver`.

    Requests and replies have the same header, and a reply has no checksum. In this order: eleven bytes
    with a correct checksum are a request; the head of a dump starts a dump; eleven bytes with another
    checksum are a damaged request if no frame starts in them, or behind a reply; six bytes in the form of
    a reply are one. A dump is never searched: its 220 bytes may hold EE DD, which would be a false end of a
    project. Nor is a frame that is incomplete at the end.
    """

    def __init__(self, direction: str = "") -> None:
        self._direction: Final = direction
        self.rest = b""

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._split(self.rest + data, at_end=False)

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the frames in the held bytes, and the remainder as noise."""
        return self._split(self.rest, at_end=True)

    def _split(self, data: bytes, *, at_end: bool) -> list[RecordedEvent]:
        events: list[RecordedEvent] = []
        start = noise = 0
        needed = REPLY_LENGTH if at_end or self._direction == "rx" else REQUEST_LENGTH
        while start < len(data):
            head = data[start : start + REQUEST_LENGTH]
            size, kind = self._frame(head)
            end = start + (size or 1)
            if end > len(data) or (len(head) < needed and HEADER.startswith(head[:2])):
                start = len(data) if at_end else start
                break
            if kind:
                _add_noise(events, data[noise:start])
                events.append(_event(data[start:end], kind))
                noise = end
            start = end
        _add_noise(events, data[noise:start])
        self.rest = data[start:]
        return events

    def _frame(self, head: bytes) -> tuple[int, str]:
        """Length and kind of the frame that begins with these eleven bytes, fewer at the end; 0: none."""
        if NOTICE.startswith(head[:2]):
            return (0, "") if self._direction == "tx" else (len(NOTICE), "notice")
        if head[:2] != HEADER:
            return 0, ""
        if self._direction != "rx" and is_request(head):
            return REQUEST_LENGTH, "request"
        found_reply = self._direction != "tx" and len(head) >= REPLY_LENGTH and is_reply(head)
        if found_reply and head[2] == READ_PROJECT:
            return DUMP_LENGTH, "reply"
        rest = head[REPLY_LENGTH:] if found_reply else head[2:]
        if self._direction != "rx" and len(head) == REQUEST_LENGTH and not _starts_in(rest):
            return REQUEST_LENGTH, "damaged"
        return (REPLY_LENGTH, "reply") if found_reply else (0, "")


def _starts_in(data: bytes) -> bool:
    return HEADER in data or NOTICE in data or data[-1:] in (HEADER[:1], NOTICE[:1])


def _event(data: bytes, kind: str) -> RecordedEvent:
    if kind == "damaged":
        return Noise(data, "checksum")
    return RecordedFrame(data, kind, ONLY, int.from_bytes(data[2:4] or data, "big"))


def _add_noise(events: list[RecordedEvent], data: bytes) -> None:
    if data:
        events.append(Noise(data, "framing"))


class Receiver:
    """Parses the bytes of one controller into replies, dumps, notices and noise; see `core.family.Receiver`."""

    def __init__(self) -> None:
        self._frames = Recording("rx")

    @property
    def held(self) -> int:
        return len(self._frames.rest)

    def feed(self, data: Data) -> list[Event]:
        if not isinstance(data, bytes):
            return [Noise(data.data, "foreign")]
        return [_received(one) for one in self._frames.feed(data)]

    def flush(self) -> list[Event]:
        return [_received(one) for one in self._frames.flush()]


def _received(event: RecordedEvent) -> Event:
    if isinstance(event, Noise):
        return event
    if event.kind == "notice":
        return Notification(ONLY, COMPLETED, event.data)
    return Reply(0, key_of(event.data), event.data)
