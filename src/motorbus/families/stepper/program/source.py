"""A file that a person wrote, or kept: its text, the TOML in it, and whether it is of a format that is known.

The one place where a family opens a file: one that its caller names, and only to read it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any, Final

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper.program.quantities import refuse

LONGEST: Final = 1 << 20
"""Characters that such a file may have."""
FORMAT: Final = 1


def read(path: str) -> str:
    """The text of a file, and one character of what is too much. Raises RequestError when it cannot be read."""
    try:
        with open(path, encoding="utf-8") as file:
            return file.read(LONGEST + 1)
    except UnicodeDecodeError as error:
        raise RequestError(f"{path} is no text: {error.reason}", expected="TOML in UTF-8") from None
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise RequestError(f"{path} cannot be read: {why}", advice="see that the path is right") from error


def toml(text: str, like: str) -> dict[str, Any]:
    """What TOML says; `like` is which TOML is expected. Raises RequestError for what is none."""
    if len(text) > LONGEST:
        raise refuse(f"the file has {len(text)} characters", f"{LONGEST} at most")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        why = str(error)
    except ValueError:  # Python reads no number of more than 4300 digits
        why = "a number has thousands of digits"
    raise refuse(f"the file is no TOML: {why}", like)


def check_format(data: Mapping[str, Any]) -> None:
    """Raise RequestError for a file that does not say its format, or says one that is not known."""
    found = data.get("format")
    if type(found) is not int or found != FORMAT:
        missing = found is None
        raise RequestError(
            f"format: {'is missing' if missing else f'{shown(found)} is not known'}",
            expected=f"format = {FORMAT}",
            advice=f"{'write that first' if missing else 'a newer motorbus may read it'}; nothing was sent",
        )
