"""The 27 commands as a table: how each is told apart, and where in its request and its reply a number stands.

Byte 2 is the class. A system command has its own code there, 1E to AE; a motor command has the motor's number and its
code in byte 3; an I/O command has 00 and its code in byte 3. So byte 3 alone tells nothing: 03 0B is jog in reverse and
00 0B reads an input. Numbers of more than one byte begin with the lowest.

The manual is titled "26 items" and uses the number 17 twice; the numbers here are its own, with 17a and 17b.
Source of every row: stepper controller serial protocol manual, the item of that number.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

SYSTEM: Final = "system"
MOTOR_CLASS: Final = "motor"
IO: Final = "io"


class Place(NamedTuple):
    """Where one number stands in a request: its offset from the first header byte, and its size in bytes."""

    name: str
    offset: int
    size: int = 1


class Command(NamedTuple):
    """One command.

    `number`  the manual's, as text: "1" to "26", with "17a" and "17b"
    `kind`    "system", "motor" or "io"
    `code`    byte 2 of a system command, byte 3 of the others
    `places`  the numbers its request carries; every other byte of it is 00
    `echo`    what the reply repeats: "project" in byte 3, "step" in byte 5, "port" in byte 4, "level" (a port in byte
              4 and the level of an input in byte 5), or nothing, ""
    """

    number: str
    name: str
    kind: str
    code: int
    places: tuple[Place, ...] = ()
    echo: str = ""

    def place(self, name: str) -> Place | None:
        """Where this number stands, or None when the request does not carry it."""
        return next((place for place in self.places if place.name == name), None)


_PROJECT: Final = Place("project", 3)
_STEP: Final = Place("step", 9)


def _step(number: str, name: str, code: int, *places: Place) -> Command:
    return Command(number, name, MOTOR_CLASS, code, (*places, _STEP), "step")


_ALL: Final = (
    Command("1", "select_project", SYSTEM, 0x6E, (_PROJECT, Place("total_steps", 4)), "project"),
    Command(
        "2",
        "set_microstep_and_angle",
        MOTOR_CLASS,
        0x01,
        (Place("microsteps", 4, 2), Place("step_angle", 6)),
    ),
    Command("3", "set_turn_distance", MOTOR_CLASS, 0x02, (Place("turn_distance", 4, 3),)),
    _step("4", "set_step_distance", 0x03, Place("distance", 4, 3)),
    _step("5", "set_step_direction_start", 0x04, Place("direction", 4), Place("start_frequency", 5, 2)),
    _step("6", "set_step_accel_speed", 0x05, Place("acceleration", 4, 2), Place("speed", 6, 2)),
    _step("7", "set_step_output", 0x06, Place("output", 4)),
    _step("8", "set_step_delay", 0x07, Place("delay", 4, 3)),
    _step("9", "set_step_start_input", 0x08, Place("start_input", 4)),
    _step("10", "set_step_stop_input", 0x09, Place("stop_input", 4)),
    Command(
        "11",
        "set_segment_loop",
        SYSTEM,
        0x7E,
        (Place("loop_first", 3), Place("loop_last", 4), Place("loop_count", 5)),
        "project",
    ),
    Command("12", "set_project_loop", SYSTEM, 0x8E, (Place("project_loop", 3),), "project"),
    Command("13", "start_project", SYSTEM, 0x4E, (_PROJECT,), "project"),
    Command("14", "stop_project", SYSTEM, 0x5E),
    Command("15", "read_project", SYSTEM, 0x3E, (_PROJECT,), "project"),
    Command("16", "save_project", SYSTEM, 0x2E, (_PROJECT,), "project"),
    Command("17a", "clear_project", SYSTEM, 0x1E, (_PROJECT,), "project"),
    Command("18", "jog_forward", MOTOR_CLASS, 0x0A),
    Command("17b", "jog_reverse", MOTOR_CLASS, 0x0B),
    Command("19", "run_once", MOTOR_CLASS, 0x0C),
    Command("20", "stop_motor", MOTOR_CLASS, 0x0D),
    Command("21", "set_stop_mode", MOTOR_CLASS, 0x0E, (Place("stop_mode", 4),)),
    Command("22", "home", MOTOR_CLASS, 0x0F),
    Command("23", "set_output", IO, 0x0C, (Place("port", 4), Place("level", 5)), "port"),
    Command("24", "read_input", IO, 0x0B, (Place("port", 4),), "level"),
    Command("25", "set_mode4", SYSTEM, 0x9E, (Place("mode4", 3),)),
    Command("26", "set_power_on_home", SYSTEM, 0xAE, (Place("power_on_home", 3),)),
)

COMMANDS: Final[Mapping[str, Command]] = MappingProxyType({command.name: command for command in _ALL})
"""Every command by its name, in the order of the manual."""
_SYSTEM: Final = {command.code: command for command in _ALL if command.kind == SYSTEM}
_MOTOR: Final = {command.code: command for command in _ALL if command.kind == MOTOR_CLASS}
_IO: Final = {command.code: command for command in _ALL if command.kind == IO}


def command_of(byte2: int, byte3: int) -> Command | None:
    """The command that bytes 2 and 3 of a request or a reply stand for; None when there is none.

    A low nibble E is a system command and 00 is I/O; anything else is taken for a motor's number, an assumption, for
    only motor 3 is documented.
    """
    if byte2 & 0x0F == 0x0E:
        return _SYSTEM.get(byte2)
    return _IO.get(byte3) if byte2 == 0 else _MOTOR.get(byte3)
