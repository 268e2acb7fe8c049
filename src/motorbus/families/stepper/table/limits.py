"""Whether a number may be sent, told with the name of the field, the step, and what is allowed.

The controller has no word for "no": what it does not like it leaves unanswered, or so it is assumed. So it must be
said before anything is sent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from motorbus.core.register import Register
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.table.codes import INPUTS
from motorbus.families.stepper.table.project import Project
from motorbus.families.stepper.table.rows import BASE_NAMES, PARAMETERS, STEP_NAMES

UNITS: Final[Mapping[str, str]] = {
    "microsteps": "microsteps per full step",
    "step_angle": "hundredths of a degree (2.55° at most)",
    "turn_distance": "units per turn",
    "distance": "units",
    "start_frequency": "Hz",
    "acceleration": "Hz",
    "speed": "RPM",
    "delay": "ms (4 h 39 min 37.215 s at most)",
}
"""What a raw value counts, where that is not plain."""
_ONE_OF: Final = frozenset({"start_input", "stop_input"})


def allowed(name: str, *, expert: bool = False) -> str:
    """What a parameter may be, in words."""
    row = PARAMETERS[name]
    if name in _ONE_OF:
        numbers = range(INPUTS + 1) if expert else sorted(row.choices)
        return f"{', '.join(str(number) for number in numbers if number)}, or 0 for none"
    unit = f" {UNITS[name]}" if name in UNITS else ""
    extra = "".join(f"; {raw} is {text}" for raw, text in row.choices.items() if _is_told(row, raw))
    return f"{row.low} to {row.high}{unit}{extra}"


def _is_told(row: Register, raw: int) -> bool:
    return row.name in ("project_loop", "direction", "stop_mode", "loop_first", "loop_last", "loop_count")


def is_allowed(name: str, raw: int, *, expert: bool = False) -> bool:
    """Whether this number may be sent; `expert` lets a step use inputs 3 and 4, which start and stop projects."""
    row = PARAMETERS[name]
    if name in _ONE_OF and not expert:
        return raw in row.choices
    return row.low <= raw <= row.high


def refusal(name: str, raw: int, *, step: int = 0, expert: bool = False) -> RequestError | None:
    """The error for a number that may not be sent, or None; with `step` it names the step."""
    if is_allowed(name, raw, expert=expert):
        return None
    where = f"step {step}, " if step else ""
    why = ""
    if name in _ONE_OF and 0 < raw <= INPUTS:
        why = "inputs 3 and 4 start and stop projects"
    return RequestError(
        f"{where}{name}: {raw} is not possible",
        expected=allowed(name, expert=expert),
        cause=why,
        advice="nothing was sent",
    )


def check(command: str, values: Mapping[str, int], *, expert: bool = False) -> None:
    """Raise RequestError, naming step, field and allowed range, unless a request may carry these numbers."""
    step = values.get("step", 0)
    for place in wire.named(command).places:
        if place.name in values:
            at = 0 if place.name == "step" else step
            if (error := refusal(place.name, values[place.name], step=at, expert=expert)) is not None:
                raise error
    first, last = values.get("loop_first", 0), values.get("loop_last", 0)
    if (first or last) and not 1 <= first <= last:
        raise RequestError(
            f"loop_first, loop_last: {first} to {last} is no range",
            expected="the first step, then the last, or 0 for both",
            advice="nothing was sent",
        )


def refusals(project: Project, *, expert: bool = False) -> Iterator[RequestError]:
    """An error for each number of a project, and of the steps it carries out, that may not be sent."""
    for name in BASE_NAMES:
        if (error := refusal(name, getattr(project, name), expert=expert)) is not None:
            yield error
    for number in range(1, min(project.total_steps, len(project.steps)) + 1):
        for name in STEP_NAMES:
            raw = getattr(project.step(number), name)
            if (error := refusal(name, raw, step=number, expert=expert)) is not None:
                yield error
