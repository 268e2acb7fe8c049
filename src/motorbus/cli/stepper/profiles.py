"""What was found out about one controller, from a file: how it carries out what its manual leaves open."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour, Estimate
from motorbus.families.stepper.program.profile import Profile

ProfileFile = Annotated[
    Path | None,
    Parameter(name="--profile", help="What was found out about this controller: a file of `characterise`."),
]


def how_of(path: Path | None) -> Behaviour:
    """How the controller of this profile runs projects; without one, as is assumed of all.

    Raises RequestError, with the name of the file, for what cannot be.
    """
    return Behaviour() if path is None else _loaded(path).behaviour()


def settled(estimate: Estimate, path: Path | None) -> Estimate:
    """The estimate, without its band where this profile settles how the acceleration is meant. Raises as `how_of`."""
    if path is None or not _loaded(path).settles_acceleration:
        return estimate
    return estimate.settled(path.name)


def _loaded(path: Path) -> Profile:
    try:
        return Profile.load(str(path))
    except RequestError as error:
        error.summary = error.summary if str(path) in error.summary else f"{path}: {error.summary}"
        raise
