"""Generates docs/reference/api.md from the docstrings of the public names. `--check` only compares."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import motorbus
from motorbus.bus.aio import AsyncBus
from motorbus.bus.blocking import Bus
from motorbus.core import steps
from motorbus.motion import blocks, commands, loop, profile, state
from motorbus.motion.axis import Axis
from motorbus.motion.trajectory import Trajectory
from motorbus.recorder import Decoder
from motorbus.simulation import Simulation
from scripts.pages import kept

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "api.md"
HEAD: Final = """# Python API

Every name that a program needs, with its docstring. `python -m scripts.api_reference` generates this page.

- Positions are in rad, velocities in rad/s, accelerations in rad/s²; of a linear axis in m. Times are in s, currents in
  A, voltages in V, temperatures in °C.
- `AsyncRobot`, `AsyncBus`, `AsyncServo` and `AsyncController` have the same methods, awaited.
- Failures are [errors](errors.md). A method that a device does not support is absent, or raises RequestError before
  anything is sent.
"""
INTERNAL: Final = """
raw row value refusal note_reply settings traits table carry_out publish program chosen now unsubscribe line link
"""
ONLY: Final = {
    "ControlLoop": "set_target",
    "Bus": "run exchange estop trigger_estop reset latched rate read_only simulated close",
    "AsyncBus": "run close",
}
"""Names of a class that a program needs, where the class has many others."""
FIRST: Final = ("self", "cls", "node", "machine", "servo")
"""Parameters that a caller of the method does not give."""
feetech, kst, stepper = motorbus.feetech, motorbus.kst, motorbus.stepper
SECTIONS: Final[dict[str, tuple[Any, ...]]] = {
    "Open": (motorbus.open, motorbus.open_async, motorbus.simulate),
    "A machine": (
        motorbus.Robot, Axis, blocks.Loop, loop.ControlLoop, commands.MoveResult, commands.StopResult,
        commands.EStopResult, state.AxisState, Trajectory, profile.synchronize, profile.SetpointGenerator,
    ),
    "A bus": (Bus, AsyncBus),
    "FEETECH": (
        feetech.Servo, feetech.ServoGroup, feetech.scan, feetech.sync_read, feetech.sync_write, feetech.reg_write_all,
        feetech.action_all, feetech.prepare_all, feetech.disable_torque_all,
    ),
    "KST": (kst.Servo, kst.scan, kst.broadcast_write),
    "Stepper controller": (stepper.Controller, stepper.Program, stepper.Backup),
    "Simulation": (Simulation,),
    "Recordings": (Decoder,),
    "Procedures": (
        steps.gather, steps.Exclusive, steps.Sleep, steps.WaitFor, steps.SetBitrate, steps.Emit, steps.Guard,
        steps.with_cleanup,
    ),
}  # fmt: skip


class _Bare:
    """An annotation that is shown without quotes."""

    def __init__(self, annotation: Any) -> None:
        self.text = getattr(annotation, "__name__", str(annotation))

    def __repr__(self) -> str:
        return self.text


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    for title, subjects in SECTIONS.items():
        parts.append(f"## {title}\n")
        for subject in subjects:
            parts.extend(_class(subject) if inspect.isclass(subject) else _function(subject, "###"))
    return "\n".join(parts)


def _class(kind: type) -> Iterator[str]:
    yield f"### `{kind.__name__}`\n"
    yield _text(kind)
    fields = getattr(kind, "__struct_fields__", ())
    if fields:
        yield f"Fields: {', '.join(f'`{name}`' for name in fields)}.\n"
    for name in sorted(dir(kind)):
        value = inspect.getattr_static(kind, name)
        wanted = {*ONLY.get(kind.__name__, name).split()} - {*INTERNAL.split(), *fields}
        if name.startswith("_") or name not in wanted:
            continue
        if isinstance(value, property):
            if value.__doc__:
                yield f"#### `{kind.__name__}.{name}`\n"
                yield _text(value)
        elif callable(getattr(kind, name)) and inspect.getdoc(getattr(kind, name)):
            yield from _function(getattr(kind, name), "####", f"{kind.__name__}.{name}")


def _function(function: Callable[..., Any], level: str, method: str = "") -> Iterator[str]:
    name = method or function.__name__
    yield f"{level} `{name}`\n"
    yield f"```text\n{name.rpartition('.')[2]}{_signature(function, bool(method))}\n```\n"
    yield _text(function)


def _signature(function: Callable[..., Any], is_method: bool) -> str:
    """The signature as a caller sees it: without the device, and with the value instead of the request for it."""
    signature = inspect.signature(function)
    given = list(signature.parameters.values())
    if is_method and given and given[0].name in FIRST:
        given = [one.replace(kind=_kind(one)) for one in given[1:]]
    given = [one.replace(annotation=_Bare(one.annotation)) for one in given]
    result = _Bare(signature.return_annotation)
    text = str(signature.replace(parameters=given, return_annotation=result))
    if is_method:
        text = re.sub(r"-> (?:Runnable|Request)\[(.*)\]$", r"-> \1", text)
    return text if len(text) < 90 else _wrapped(text)


def _kind(parameter: inspect.Parameter) -> Any:
    is_positional = parameter.kind is inspect.Parameter.POSITIONAL_ONLY
    return inspect.Parameter.POSITIONAL_OR_KEYWORD if is_positional else parameter.kind


def _wrapped(text: str) -> str:
    """One parameter on each line."""
    inside, arrow, result = text.removeprefix("(").rpartition(") -> ")
    parts = re.split(r", (?![^\[(]*[\])])", inside)
    return "(\n    " + ",\n    ".join(parts) + ",\n" + arrow + result


def _text(subject: Any) -> str:
    """A docstring as Markdown: what is indented is code."""
    text = inspect.getdoc(subject) or ""
    return re.sub(r"^(?!    )(.*)\n(    )", r"\1\n\n\2", text, flags=re.MULTILINE) + "\n"


def main() -> int:
    """Write the page, or with --check compare it."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
