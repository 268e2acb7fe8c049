"""Parameters that many commands have, each said once, so that all commands say the same of it."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from motorbus.cli.output import Output

Flag = Annotated[bool, Parameter(negative="")]
Silent = Annotated[Output, Parameter(parse=False)]
"""Where the command prints to: given by the program, not by the user."""
DryRun = Annotated[bool, Parameter(negative="", help="Only read; show the frames that it would send.")]
Duration = Annotated[str, Parameter(help="In so long, as 2s; as quick as the axes may when left out.")]
Shape = Annotated[
    Literal["trapezoid", "minimum_jerk"], Parameter(help="How each axis speeds up and slows down on its way.")
]
Speed = Annotated[str, Parameter(help="At this share of what the machine file allows, as 50%.")]
Assume = Annotated[
    tuple[str, ...],
    Parameter(
        negative="",
        help="AXIS=POSITION: an axis that does not know where it is stands there, as lift=0mm. May be repeated.",
    ),
]
First = Annotated[
    bool, Parameter(name="--home", negative="", help="Axes that do not know where they are home first.")
]
