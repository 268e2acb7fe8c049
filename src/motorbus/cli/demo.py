"""`motorbus demo`: the whole of it without hardware. A machine of nine axes is found, moved together and drawn.

Its devices are those of three families on three buses, each in a process of its own, so that everything between here
and them is as it would be with cables. With --family it is one bus, as fast as that can be; of a family whose devices
no loop controls, its face shows what they do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from motorbus import families, plot
from motorbus.cli import faces
from motorbus.cli.exits import Exit
from motorbus.cli.files import check_writable
from motorbus.cli.nine import LEAST, nine
from motorbus.cli.output import Output
from motorbus.cli.target import opened
from motorbus.cli.wave import served, waved
from motorbus.errors import RequestError

app = App(
    name="demo",
    help_epilogue="""No hardware is needed or touched: everything is simulated, and says so.

Six FEETECH servos, two KST servos on CAN and the linear axis of a stepper
controller are one machine: a file describes it, and all nine axes start and
end together, there and back. What the stepper axis did is reckoned, for it
tells no position: it is called estimated. Takes about 20 s, most of it for the
stepper controller, which is told its movements at 9600 bit/s. --family shows
the devices of one bus instead: servos in a loop as fast as the wire allows, a
stepper controller with a program.

Examples:

    motorbus demo
    motorbus demo --output demo.svg --duration 4
    motorbus demo --family feetech --ids 1-3
    motorbus demo --family kst
    motorbus demo --family stepper
    motorbus demo --json""",
)


@app.default
def demo(
    *,
    output_: Annotated[Path, Parameter(name="--output")] = Path("demo.png"),
    ids: str = "",
    duration: float = 6.0,
    family: str = "",
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Find nine simulated axes of three families, move them together, and draw what they did.

    Parameters
    ----------
    output_
        Where the picture goes; .png, .svg or .pdf.
    ids
        With --family: the ids of the simulated devices.
    duration
        Seconds of motion: 4 to 60; with --family, 1 to 60.
    family
        Only the devices of this one: servos in a loop; of a stepper controller a project is written and run.
    """
    least = 1.0 if family else LEAST
    if not least <= duration <= 60.0:
        why = "" if family else ": the slide needs half of that for each of its ways"
        raise RequestError(
            f"--duration {duration:g}: too short or too long", expected=f"{least:g} to 60 seconds{why}"
        )
    if ids and not family:
        raise RequestError("--ids: the machine of the demo has its own", expected="--family with --ids")
    if family:
        families.load(family)
    check_writable(output_, plot.KINDS)
    output.simulated = True
    if not family:
        nine(duration, output_, output)
    elif (own := faces.offer(family, "demo")) is not None:
        _shown_by_its_face(own, family, duration, output)
    else:
        waved(family, ids or "1-6", duration, output_, output)
    return Exit.OK


def _shown_by_its_face(own: Any, family: str, duration: float, output: Output) -> None:
    with served(family, "1", output) as bus, opened(bus, {}, output) as opening:
        own(opening, duration, output)
