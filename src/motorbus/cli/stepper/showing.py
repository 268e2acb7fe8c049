"""What `motorbus demo` shows of a stepper controller: a project written, verified, run, and its end heard."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from motorbus.cli.plain import plain
from motorbus.cli.stepper.runs import heard
from motorbus.cli.target import face
from motorbus.core.steps import Progress
from motorbus.families.stepper import Program
from motorbus.families.stepper.driver import running, writing

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Bar, Output

PROJECT: Final = 2
_PROGRAM: Final = """format = 1
name = "Feed"
project = 2
repeat = {passes}
[motor]
microsteps = 8
step_angle = "1.8 deg"
unit = "pulse"
[outputs]
gripper = 1
[[step]]
move = "2 turns"
speed = "120 rpm"
start = "200 Hz"
acceleration = "20 Hz"
output = "gripper on"
delay = "200 ms"
[[step]]
move = "-2 turns"
speed = "240 rpm"
start = "200 Hz"
acceleration = "20 Hz"
output = "gripper off"
delay = "100 ms"
"""


def program(seconds: float) -> Program:
    """There and back with a gripper, as often as fits into so many seconds, at least once."""
    once = Program.parse(_PROGRAM.format(passes=1))
    return Program.parse(_PROGRAM.format(passes=max(1, int(seconds / once.estimate().seconds))))


def demo(bus: Bus, seconds: float, output: Output) -> None:
    """Write a program that takes so long, and run it to its end."""
    one, feed = face(bus, 1), program(seconds)
    identity = one.identify()
    output.text(f"found: {identity.model}, known by {identity.details['known_by']}")
    with output.progress("writing") as bar:
        written = bus.run(writing.write_project(one, feed), report=partial(_heard, output, bar))
    output.text(str(written))
    output.text(f"predicted: {feed.estimate()}")
    with output.progress("running") as bar:
        ran = bus.run(running.run(one, PROJECT), report=partial(_heard, output, bar))
    took = "" if ran.seconds is None else f" in {ran.seconds:.2f} s"
    output.text(f"project {PROJECT} {ran.outcome.value}{took}: {ran.why}")
    facts = {"identity": plain(identity), "written": str(written), "outcome": ran.outcome.value}
    facts |= {"seconds": ran.seconds, "predicted": plain(feed.estimate().data())}
    output.document("motorbus.stepper.demo/1", facts)


def _heard(output: Output, bar: Bar, event: object) -> None:
    if isinstance(event, Progress):
        bar.advance(event.done, event.total, event.what)
    heard(False, output, event, bar)
