"""The parameters of a project: one row each, and the project as numbers, as names and as its 220-byte image.

A project is 11 rows of 20 bytes in the reply to "read project": row 0 is the project, rows 1 to 10 are its steps. The
`address` of a parameter is its offset in these 220 bytes. Numbers are raw, as the controller stores them; a register
row gives their unit. "Save project" stores them, until then they are edited in a copy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from math import pi
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from motorbus.core.register import Access, Register, RegisterMap, Storage, changed, shown
from motorbus.core.request import Effect
from motorbus.errors import RequestError

MANUAL: Final = "stepper controller serial protocol manual"
PROJECTS: Final = 4
STEPS: Final = 10
ROW_LENGTH: Final = 20
IMAGE_LENGTH: Final = (1 + STEPS) * ROW_LENGTH

REVERSE: Final = 1  # of a direction; homing always runs in reverse
IMMEDIATE: Final = 1  # of a stop mode
ENDLESS: Final = 255  # of a project loop
OUTPUTS: Final = 3
ALL_OUTPUTS: Final = 4  # port of the command that sets an output
LEDS: Final = 5  # port, as above
INPUTS: Final = 5
START_INPUT: Final = 3  # starts a project
STOP_INPUT: Final = 4  # stops the project
HOME_INPUT: Final = 5
STEP_INPUTS: Final = (1, 2, 5)  # that a step may wait for or be ended by

Order: TypeAlias = Literal["little", "big"]
"""The byte of a number that is first in a dump: the lowest or the highest."""


def _row(
    name: str, address: int, size: int, low: int, high: int, items: str, note: str = "", **more: Any
) -> Register:
    """`items` are those of the manual; in its item 15 a place is [row][byte], x for the row of a step."""
    more = {"access": Access.READ_WRITE, "effect": Effect.PERSISTENT} | more
    place = f"{address}..{address + size - 1}" if size > 1 else f"{address}"
    source = f"{MANUAL}, {items.replace('@', place)}"
    return Register(
        name=name, address=address, size=size, low=low, high=high, storage=Storage.EEPROM, source=source,
        note=note, **more,
    )  # fmt: skip


_INPUTS: Final = {0: "none", **{number: f"input {number}" for number in STEP_INPUTS}}
_OUTPUTS: Final = ("none", "output 1 on", "output 2 on", "output 3 on", "all on",
                   "output 1 off", "output 2 off", "output 3 off", "all off")  # fmt: skip
_OFF: Final = {0: "off"}

# fmt: off
BASE: Final = (
    _row("number", 0, 1, 0, PROJECTS, "item 15 [0][@]",
         "repeats the project that was asked for; 0 after it has been cleared is an assumption",
         access=Access.READ, effect=Effect.NONE),
    _row("total_steps", 1, 1, 1, STEPS, "item 1; item 15 [0][@]",
         "set together with the selection of the project, so selecting one is a write; steps beyond it keep their "
         "values and are not carried out, an assumption"),
    _row("loop_first", 2, 1, 0, STEPS, "item 11; item 15 [0][@]", "one range of steps per project is repeated",
         choices=_OFF),
    _row("loop_last", 3, 1, 0, STEPS, "item 11; item 15 [0][@]",
         "a range that is not 1 <= first <= last <= total steps is ignored, an assumption", choices=_OFF),
    _row("loop_count", 4, 1, 0, ENDLESS - 1, "item 11; item 15 [0][@]",
         "how often the range runs in all: its worked example runs 1 2, then 3 to 5 twice, then 6 to 8", choices=_OFF),
    _row("project_loop", 5, 1, 0, ENDLESS, "item 12; item 15 [0][@]",
         "that 0 and 1 both run it once is an assumption", choices={ENDLESS: "endless"}),
    _row("microsteps", 6, 2, 1, 0xFFFF, "item 2; item 15 [0][@]",
         "per full step; pulses per turn = 36000 * microsteps / step angle"),
    _row("step_angle", 8, 1, 1, 255, "item 2; item 15 [0][@]",
         "hundredths of a degree, 1.8 degrees are 180; 2.55 degrees at most", unit="rad", scale=pi / 18000),
    _row("turn_distance", 9, 3, 1, 0xFFFFFF, "item 3; item 15 [0][@]",
         "user units for one turn of the motor: this defines the unit of all distances"),
    _row("stop_mode", 14, 1, 0, 1, "item 21; item 15 [0][@]",
         "of one project or of the device: not known; it is in the dump of each project",
         choices={0: "slow", 1: "immediate"}),
    _row("mode4", 15, 1, 0, 2, "item 25; item 15 [0][@]",
         "the manual explains neither mode 4 nor its three variants", protected=True),
    _row("power_on_home", 16, 1, 0, 1, "item 26; item 15 [0][@]", "moves the motor at power-on",
         choices={0: "off", 1: "home at power-on"}, protected=True),
)
"""The rows of the project itself. The manual does not name the bytes 12, 13 and 17 to 19."""

STEP: Final = (
    _row("distance", 0, 3, 0, 0xFFFFFF, "item 4; item 15 [x][@]",
         "user units, without a sign; turns = distance / turn_distance, relative to the present position"),
    _row("direction", 3, 1, 0, 1, "item 5; item 15 [x][@]", choices={0: "forward", 1: "reverse"}),
    _row("start_frequency", 4, 2, 0, 0xFFFF, "item 5; item 15 [x][@]",
         "Hz, pulses per second; 0 is taken for 1, an assumption"),
    _row("acceleration", 6, 2, 0, 0xFFFF, "item 6; item 15 [x][@]",
         "Hz, by how much the frequency grows and falls; the manual does not say per what"),
    _row("speed", 8, 2, 0, 0xFFFF, "item 6; item 15 [x][@]",
         "RPM; frequency = RPM * pulses per turn / 60. Speed of jog, single move and homing is that of step 1 of "
         "project 1", unit="rad/s", scale=2 * pi / 60),
    _row("output", 10, 1, 0, 8, "item 7; item 15 [x][@]",
         "when the motor starts; coded otherwise than in the command that sets an output",
         choices=dict(enumerate(_OUTPUTS))),
    _row("delay", 11, 3, 0, 0xFFFFFF, "item 8; item 15 [x][@]",
         "ms after the motion has ended, 4 h 39 min 37.215 s at most; the example sends 1000 ms, its annotation "
         "says 2000", unit="s", scale=0.001),
    _row("start_input", 14, 1, 0, INPUTS, "item 9; item 15 [x][@]",
         "the step waits for it; inputs 3 and 4 start and stop projects", choices=_INPUTS),
    _row("stop_input", 15, 1, 0, INPUTS, "item 10; item 15 [x][@]",
         "ends the motion of this step at once; inputs 3 and 4 start and stop projects", choices=_INPUTS),
)
"""The rows of one step; `address` is the offset in its 20 bytes, of which the manual does not name the last four."""

REQUEST_ONLY: Final = (
    _row("project", 3, 1, 1, PROJECTS, "items 1, 13, 15, 16 and 17a"),
    _row("step", 9, 1, 1, STEPS, "items 4 to 10"),
    _row("port", 4, 1, 1, 5, "items 23 and 24", "inputs 1 to 5; outputs 1 to 3, 4 all three, 5 both LEDs. Its "
         "annotations to both examples say port 00"),
    _row("level", 5, 1, 0, 1, "item 23", choices={0: "inactive", 1: "active"}),
)
"""Numbers that requests carry and no dump holds; `address` is the offset in the request."""
# fmt: on

PARAMETERS: Final[Mapping[str, Register]] = {row.name: row for row in (*BASE, *STEP, *REQUEST_ONLY)}
"""Every number of a request or a dump, by name."""
BASE_NAMES: Final = tuple(row.name for row in BASE)
STEP_NAMES: Final = tuple(row.name for row in STEP)


def of_step(number: int, name: str) -> str:
    """The name of a parameter of one step in the project table: `step_3_delay`."""
    return f"step_{number}_{name}"


def _rows_of_step(number: int) -> list[Register]:
    start = number * ROW_LENGTH
    return [changed(row, name=of_step(number, row.name), address=start + row.address) for row in STEP]


TABLE: Final = RegisterMap(
    "project",
    (*BASE, *(row for number in range(1, STEPS + 1) for row in _rows_of_step(number))),
    title="one project of the stepper controller",
)
TABLES: Final[Mapping[str, RegisterMap]] = {TABLE.name: TABLE}


# -- a project -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step. Distance in user units, frequencies in Hz (pulses per second), speed in RPM, delay in ms."""

    distance: int = 0
    direction: int = 0
    start_frequency: int = 0
    acceleration: int = 0
    speed: int = 0
    output: int = 0
    delay: int = 0
    start_input: int = 0
    stop_input: int = 0

    @property
    def sign(self) -> int:
        """1 forward, -1 in reverse."""
        return -1 if self.direction == REVERSE else 1


EMPTY: Final = Step()


class Place(NamedTuple):
    """A place in one pass of a project: the step, 1 to 10, and the pass of the step loop, from 1."""

    step: int
    lap: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Project:
    """One project: 12 numbers and always ten steps, of which the first `total_steps` are carried out.

    Any numbers that fit their bytes are possible, as in a device. All zero is a project that has been cleared.
    """

    number: int = 0
    total_steps: int = 0
    loop_first: int = 0
    loop_last: int = 0
    loop_count: int = 0
    project_loop: int = 0
    microsteps: int = 0
    step_angle: int = 0
    turn_distance: int = 0
    stop_mode: int = 0
    mode4: int = 0
    power_on_home: int = 0
    steps: tuple[Step, ...] = (EMPTY,) * STEPS

    def step(self, number: int) -> Step:
        """Step 1 to 10."""
        return self.steps[number - 1]

    def with_step(self, number: int, **values: int) -> Project:
        """The same project with some numbers of step 1 to 10 replaced."""
        steps = list(self.steps)
        steps[number - 1] = replace(steps[number - 1], **values)
        return replace(self, steps=tuple(steps))

    @property
    def used(self) -> tuple[Step, ...]:
        """The steps that are carried out."""
        return () if self.is_cleared else self.steps[: self.total_steps]

    @property
    def pulses_per_turn(self) -> Fraction | None:
        """36000 * microsteps / step angle, exact; None if one of them is 0."""
        if not (self.microsteps and self.step_angle):
            return None
        return Fraction(36000 * self.microsteps, self.step_angle)

    @property
    def pulses_per_unit(self) -> Fraction | None:
        """Pulses of one user unit, exact; None if a number that it needs is 0."""
        turn = self.pulses_per_turn
        return turn / self.turn_distance if turn and self.turn_distance else None

    @property
    def has_loop(self) -> bool:
        """The step loop is carried out: 1 <= first <= last <= total, and a count. Else it is ignored."""
        return 1 <= self.loop_first <= self.loop_last <= self.total_steps and self.loop_count >= 1

    @property
    def passes(self) -> int | None:
        """How often it runs; None: until it is stopped."""
        return (
            None if self.is_endless else max(1, self.project_loop)
        )  # counts are totals, 0 is 1 # assumption

    def following(self, place: Place) -> Place | None:
        """The next place in the same pass; None at its end. The first step of the loop follows its last."""
        step, lap = place
        if self.has_loop and step == self.loop_last and lap < self.loop_count:
            return Place(self.loop_first, lap + 1)  # the loop begins again in each pass # assumption
        if step >= len(self.used):
            return None
        return Place(step + 1, lap if step + 1 <= self.loop_last else 1)

    def one_pass(self) -> Iterator[Place]:
        """Every place of one pass, in order."""
        place = Place(1) if self.used else None
        while place:
            yield place
            place = self.following(place)

    def times(self, step: int) -> int:
        """How often a step is carried out in one pass."""
        return sum(place.step == step for place in self.one_pass())

    @property
    def is_endless(self) -> bool:
        """Only a stop ends it."""
        return self.project_loop == ENDLESS

    @property
    def is_cleared(self) -> bool:
        """It has no steps to carry out: it was cleared, or its memory was erased and reads FF."""
        return not 1 <= self.total_steps <= STEPS


def with_steps(project: Project, steps: tuple[Step, ...]) -> Project:
    """The project with these steps, at most ten, and no others."""
    return replace(project, total_steps=len(steps), steps=steps + (EMPTY,) * (STEPS - len(steps)))


def values_of(project: Project) -> dict[str, int]:
    """All numbers of a project, by the names of the table."""
    found = {name: getattr(project, name) for name in BASE_NAMES}
    for number, step in enumerate(project.steps, 1):
        found |= {of_step(number, name): getattr(step, name) for name in STEP_NAMES}
    return found


def project_of(values: Mapping[str, int]) -> Project:
    """The project with these numbers, which are all of the table."""
    base: dict[str, Any] = {name: values[name] for name in BASE_NAMES}
    steps = [
        Step(**{name: values[of_step(number, name)] for name in STEP_NAMES}) for number in range(1, STEPS + 1)
    ]
    return Project(**base, steps=tuple(steps))


def amended(project: Project, values: Mapping[str, int]) -> Project:
    """The project with some numbers replaced, by the names of the table. Raises RequestError for other names."""
    for name in values:
        TABLE[name]  # raises
    return project_of(values_of(project) | dict(values))


def differences(one: Project, other: Project) -> dict[str, tuple[int, int]]:
    """The numbers in which two projects differ, by the names of the table: both values."""
    mine, theirs = values_of(one), values_of(other)
    return {name: (mine[name], theirs[name]) for name in TABLE if mine[name] != theirs[name]}


# -- its image -------------------------------------------------------------------------------------------------------


def decode_image(image: bytes, order: Order = "little") -> Project:
    """The numbers in an image; a device may hold any. Raises RequestError for another length than 220 bytes."""
    if len(image) != IMAGE_LENGTH:
        raise RequestError(f"an image of {len(image)} bytes", expected=f"{IMAGE_LENGTH} bytes")
    return project_of(
        {
            name: int.from_bytes(image[row.address : row.address + row.size], order)
            for name, row in TABLE.items()
        }
    )


def encode_image(project: Project, order: Order = "little") -> bytes:
    """The image of a project; 0 in bytes that the manual does not name.

    Raises OverflowError for a number that does not fit its bytes.
    """
    image = bytearray(IMAGE_LENGTH)
    for name, raw in values_of(project).items():
        row = TABLE[name]
        image[row.address : row.address + row.size] = raw.to_bytes(row.size, order)
    return bytes(image)


def checked_order(order: object) -> Order:
    """The order of the bytes in a dump. Raises RequestError unless it is little or big."""
    if order == "little" or order == "big":
        return order
    raise RequestError(f"dump_order={shown(order)} is not possible", expected="little or big")


# -- ranges ----------------------------------------------------------------------------------------------------------

UNITS: Final[Mapping[str, str]] = {
    "microsteps": "per full step",
    "step_angle": "hundredths of a degree",
    "turn_distance": "units per turn",
    "distance": "units",
    "start_frequency": "Hz",
    "acceleration": "Hz",
    "speed": "RPM",
    "delay": "ms",
}
"""Unit of a raw value."""
_ONE_OF: Final = ("start_input", "stop_input")


def allowed(name: str, *, expert: bool = False) -> str:
    """The valid values of a parameter, as text."""
    row = PARAMETERS[name]
    if name in _ONE_OF:
        numbers = range(INPUTS + 1) if expert else sorted(row.choices)
        return f"{', '.join(str(number) for number in numbers if number)}, or 0 for none"
    unit = f" {UNITS[name]}" if name in UNITS else ""
    words = "" if name == "output" else "".join(f"; {raw} is {text}" for raw, text in row.choices.items())
    return f"{row.low} to {row.high}{unit}{words}"


def check_value(name: str, raw: object, *, step: int = 0, expert: bool = False) -> None:
    """Raise RequestError, which names `step`, unless a request may carry this raw value.

    `expert` lets a step use inputs 3 and 4, which start and stop projects.
    """
    row = PARAMETERS[name]
    is_free = expert or name not in _ONE_OF or raw in row.choices
    if isinstance(raw, int) and not isinstance(raw, bool) and is_free and row.low <= raw <= row.high:
        return
    taken = name in _ONE_OF and raw in (START_INPUT, STOP_INPUT)
    raise RequestError(
        f"{f'step {step}, ' if step else ''}{name}: {shown(raw)} is not possible",
        expected=allowed(name, expert=expert),
        cause="inputs 3 and 4 start and stop projects" if taken else "",
    )


def check_loop(first: int, last: int) -> None:
    """Raise RequestError unless these steps are a range, or both 0."""
    if (first or last) and not 1 <= first <= last:
        raise RequestError(
            f"loop_first, loop_last: {first} to {last} is no range",
            expected="the first step, then the last, or 0 for both",
        )


def check_project(project: Project, *, expert: bool = False) -> list[RequestError]:
    """An error for each number of a project, and of the steps that it carries out, that no request may carry."""
    pairs = [(0, row.name, getattr(project, row.name)) for row in BASE if row.name != "number"]
    for number, step in enumerate(project.used, 1):
        pairs += [(number, field.name, getattr(step, field.name)) for field in fields(step)]
    errors = []
    for number, name, raw in pairs:
        try:
            check_value(name, raw, step=number, expert=expert)
        except RequestError as error:
            errors.append(error)
    try:
        check_loop(project.loop_first, project.loop_last)
    except RequestError as error:
        errors.append(error)
    return errors


# -- outputs ---------------------------------------------------------------------------------------------------------


def outputs_after_step(outputs: int, action: int) -> int:
    """The three outputs as bits (bit 0 is output 1) after the output action of a step, 0 to 8; 0 changes nothing."""
    if action in (4, 8):
        return (1 << OUTPUTS) - 1 if action == 4 else 0
    if not 1 <= action <= 7:
        return outputs
    return outputs | 1 << action - 1 if action < 4 else outputs & ~(1 << action - 5)


def outputs_after_port(outputs: int, port: int, level: int) -> int:
    """The three outputs as bits after the command that sets an output; the LEDs are none of them."""
    bits = {1: 1, 2: 2, 3: 4, ALL_OUTPUTS: 7}.get(port, 0)
    return outputs | bits if level else outputs & ~bits
