"""Parameters that many commands have, each said once, so that all commands say the same of it."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from motorbus.cli.output import Output

Flag = Annotated[bool, Parameter(negative="")]
Silent = Annotated[Output, Parameter(parse=False)]
"""Where the command prints to: given by the program, not by the user."""
DryRun = Annotated[
    bool,
    Parameter(
        negative="",
        help="Read as usual; show the frames that would change something, and send none of those.",
    ),
]
