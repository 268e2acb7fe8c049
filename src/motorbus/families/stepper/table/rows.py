"""The parameters of a project row by row: range, unit, where they stand in the dump, and which command sets them.

`address` is the offset in the 220-byte image; in the reply to "read project" it is six more. Row 0 of the manual is the
project, rows 1 to 10 are its steps, 20 bytes each; what it does not name is in `RESERVED`, is kept as it came and
cannot be written. A value is in the unit of the API: a speed of 1 RPM is 0.1047 rad/s. Frequencies and distances have
none: those count pulses per second, these count user units, which the project itself defines.

All parameters are kept by "save project" and edited in a copy until then. Which byte of a number comes first in the
dump is not said by the manual; in requests it is the lowest, and so it is taken here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from math import pi
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.core.register import Access, Register, RegisterMap, Storage, changed
from motorbus.core.request import Effect
from motorbus.families.stepper import wire
from motorbus.families.stepper.table.codes import ENDLESS, STEP_INPUTS
from motorbus.families.stepper.table.project import PROJECTS, STEPS, Step

MANUAL: Final = "stepper controller serial protocol manual"
ASSUMED: Final = "an assumption, no source"

_row = partial(Register, size=1, access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.PERSISTENT)
_INPUTS: Final = {0: "none", **{number: f"input {number}" for number in STEP_INPUTS}}

BASE: Final = (
    _row(
        name="number", address=0, high=PROJECTS, access=Access.READ, effect=Effect.NONE,
        source=f"{MANUAL}, item 15 [0][0]",
        note="repeats the project that was asked for; 0 after it has been cleared is an assumption",
    ),
    _row(
        name="total_steps", address=1, low=1, high=STEPS, source=f"{MANUAL}, item 1; item 15 [0][1]",
        note="set together with the selection of the project, so selecting one is a write; steps beyond it keep what "
        "they hold and are not carried out, an assumption",
    ),
    _row(
        name="loop_first", address=2, high=STEPS, choices={0: "off"}, source=f"{MANUAL}, item 11; item 15 [0][2]",
        note="one range of steps per project is repeated",
    ),
    _row(
        name="loop_last", address=3, high=STEPS, choices={0: "off"}, source=f"{MANUAL}, item 11; item 15 [0][3]",
        note="a range that is not 1 <= first <= last <= total steps is ignored, an assumption",
    ),
    _row(
        name="loop_count", address=4, high=ENDLESS - 1, choices={0: "off"},
        source=f"{MANUAL}, item 11; item 15 [0][4]",
        note="how often the range runs in all: its worked example runs 1 2, then 3 to 5 twice, then 6 to 8",
    ),
    _row(
        name="project_loop", address=5, high=ENDLESS, choices={ENDLESS: "endless"},
        source=f"{MANUAL}, item 12; item 15 [0][5]", note="that 0 and 1 both run it once is an assumption",
    ),
    _row(
        name="microsteps", address=6, size=2, low=1, high=0xFFFF, source=f"{MANUAL}, item 2; item 15 [0][6..7]",
        note="per full step; pulses per turn = 36000 * microsteps / step angle",
    ),
    _row(
        name="step_angle", address=8, low=1, high=255, unit="rad", scale=pi / 18000,
        source=f"{MANUAL}, item 2; item 15 [0][8]",
        note="hundredths of a degree, 1.8 degrees are 180; larger angles than 2.55 degrees cannot be said",
    ),
    _row(
        name="turn_distance", address=9, size=3, low=1, high=0xFFFFFF,
        source=f"{MANUAL}, item 3; item 15 [0][9..11]",
        note="user units for one turn of the motor: this defines the unit of all distances",
    ),
    _row(
        name="stop_mode", address=14, high=1, choices={0: "slow", 1: "immediate"},
        source=f"{MANUAL}, item 21; item 15 [0][14]",
        note="whether it holds for one project or for the device is not known: it stands in each project's dump",
    ),
    _row(
        name="mode4", address=15, high=2, protected=True, source=f"{MANUAL}, item 25; item 15 [0][15]",
        note="what mode 4 and its three variants do is nowhere explained",
    ),
    _row(
        name="power_on_home", address=16, high=1, choices={0: "off", 1: "home at power-on"}, protected=True,
        source=f"{MANUAL}, item 26; item 15 [0][16]", note="moves the motor when the supply comes",
    ),
)  # fmt: skip
"""The rows of the project itself."""

STEP: Final = (
    _row(
        name="distance", address=0, size=3, high=0xFFFFFF, source=f"{MANUAL}, item 4; item 15 [x][0..2]",
        note="user units, without a sign; turns = distance / turn_distance, counted from where the motor stands",
    ),
    _row(
        name="direction", address=3, high=1, choices={0: "forward", 1: "reverse"},
        source=f"{MANUAL}, item 5; item 15 [x][3]",
    ),
    _row(
        name="start_frequency", address=4, size=2, high=0xFFFF, source=f"{MANUAL}, item 5; item 15 [x][4..5]",
        note="Hz, pulses per second; 0 is taken for 1, an assumption",
    ),
    _row(
        name="acceleration", address=6, size=2, high=0xFFFF, source=f"{MANUAL}, item 6; item 15 [x][6..7]",
        note="Hz, by how much the frequency grows and falls; the manual does not say per what",
    ),
    _row(
        name="speed", address=8, size=2, high=0xFFFF, unit="rad/s", scale=2 * pi / 60,
        source=f"{MANUAL}, item 6; item 15 [x][8..9]",
        note="RPM; frequency = RPM * pulses per turn / 60. Speed of jog, single move and homing is that of step 1 of "
        "project 1",
    ),
    _row(
        name="output", address=10, high=8,
        choices={
            0: "none", 1: "output 1 on", 2: "output 2 on", 3: "output 3 on", 4: "all on",
            5: "output 1 off", 6: "output 2 off", 7: "output 3 off", 8: "all off",
        },
        source=f"{MANUAL}, item 7; item 15 [x][10]",
        note="when the motor starts; coded otherwise than in the command that sets an output",
    ),
    _row(
        name="delay", address=11, size=3, high=0xFFFFFF, unit="s", scale=0.001,
        source=f"{MANUAL}, item 8; item 15 [x][11..13]",
        note="ms after the motion has ended, 4 h 39 min 37.215 s at most; the example sends 1000 ms, its annotation "
        "says 2000",
    ),
    _row(
        name="start_input", address=14, high=5, choices=_INPUTS, source=f"{MANUAL}, item 9; item 15 [x][14]",
        note="the step waits for it; inputs 3 and 4 start and stop projects",
    ),
    _row(
        name="stop_input", address=15, high=5, choices=_INPUTS, source=f"{MANUAL}, item 10; item 15 [x][15]",
        note="ends the motion of this step at once; inputs 3 and 4 start and stop projects",
    ),
)  # fmt: skip
"""The rows of one step; `address` counts from the beginning of its 20 bytes."""

REQUEST_ONLY: Final = (
    _row(name="project", address=3, low=1, high=PROJECTS, source=f"{MANUAL}, items 1, 13, 15, 16 and 17a"),
    _row(name="step", address=9, low=1, high=STEPS, source=f"{MANUAL}, items 4 to 10"),
    _row(
        name="port", address=4, low=1, high=5, source=f"{MANUAL}, items 23 and 24",
        note="inputs 1 to 5; outputs 1 to 3, 4 all three, 5 both LEDs. Its annotations to both examples say port 00",
    ),
    _row(name="level", address=5, high=1, choices={0: "inactive", 1: "active"}, source=f"{MANUAL}, item 23"),
)  # fmt: skip
"""Numbers that requests carry and no dump holds; `address` is the offset in the request."""

RESERVED: Final = tuple(
    range(start, end)
    for start, end in (
        (12, 14),
        (17, 20),
        *((wire.ROW_LENGTH * x + 16, wire.ROW_LENGTH * (x + 1)) for x in range(1, STEPS + 1)),
    )
)
"""Runs of bytes of the image that the manual does not name: 45 in all. Kept as they are, never interpreted."""


def step_row(number: int, name: str) -> Register:
    """The row of one step of the project table: `step_row(3, "delay")` is `step_3_delay`."""
    return TABLE[f"step_{number}_{name}"]


def _of_step(number: int) -> list[Register]:
    start = wire.ROW_LENGTH * number
    return [changed(row, name=f"step_{number}_{row.name}", address=start + row.address) for row in STEP]


TABLE: Final = RegisterMap(
    "project",
    (*BASE, *(row for number in range(1, STEPS + 1) for row in _of_step(number))),
    title="one project of the stepper controller",
)
TABLES: Final[Mapping[str, RegisterMap]] = MappingProxyType({TABLE.name: TABLE})
PARAMETERS: Final[Mapping[str, Register]] = MappingProxyType(
    {row.name: row for row in (*BASE, *STEP, *REQUEST_ONLY)}
)
"""Every number that a request carries or a dump holds, by its name there."""
BASE_NAMES: Final = tuple(row.name for row in BASE)
STEP_NAMES: Final = tuple(field.name for field in fields(Step))


class Setter(NamedTuple):
    """Which command sets a parameter, and where in its request the number stands."""

    command: wire.Command
    place: wire.Place


SET_BY: Final[Mapping[str, Setter]] = MappingProxyType(
    {
        place.name: Setter(command, place)
        for command in wire.COMMANDS.values()
        for place in command.places
        if place.name in (*BASE_NAMES, *STEP_NAMES)
    }
)
"""By the name of a parameter; all but `number`, which is set by selecting the project."""


def dump_offset(row: Register) -> int:
    """Where a row of the project table stands in the 226 bytes of a dump."""
    return wire.REPLY_LENGTH + row.address
