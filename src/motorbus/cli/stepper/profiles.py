"""What was found out about one controller, from a file: how it carries out what its manual leaves open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour
from motorbus.families.stepper.program.profile import Profile

ProfileFile = Annotated[
    Path | None,
    Parameter(name="--profile", help="What was found out about this controller: a file of `characterise`."),
]


def how_of(path: Path | None) -> Behaviour:
    """How the controller of this profile runs projects; without one, as is assumed of all.

    Raises RequestError, with the name of the file, for what cannot be.
    """
    if path is None:
        return Behaviour()
    try:
        return Profile.load(str(path)).behaviour()
    except RequestError as error:
        error.summary = error.summary if str(path) in error.summary else f"{path}: {error.summary}"
        raise
