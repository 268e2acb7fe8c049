"""Files that a command is told to read or to write: what is wrong with one is said once, and with its name."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING

from motorbus.errors import LinkError, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def usable(file: Path, what: str) -> Iterator[None]:
    """Around reading or writing this file; `what` is "read" or "written". Raises RequestError when it cannot be."""
    try:
        yield
    except LinkError:  # an OSError too, but not one of the file
        raise
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise RequestError(f"{file} cannot be {what}: {why}", advice="see that the path is right") from error


def check_writable(file: Path, kinds: tuple[str, ...] = ()) -> None:
    """Raise RequestError for a file that cannot be written, or is none of these kinds, before anything is begun."""
    if kinds and not file.name.lower().endswith(kinds):
        raise RequestError(
            f"{file}: what kind of file shall that be?",
            expected=f"a name that ends in {', '.join(kinds)}",
            advice="nothing was sent",
        )
    folder = file.parent
    why = ""
    if file.is_dir():
        why = "it is a folder"
    elif not folder.is_dir():
        why = "its folder is not there"
    elif not os.access(file if file.exists() else folder, os.W_OK):
        why = "permission denied"
    if why:
        raise RequestError(
            f"{file} cannot be written: {why}", advice="see that the path is right; nothing was sent"
        )


def replaced(file: Path, text: str) -> None:
    """Give a file that is there another text, all of it or nothing: a cut in the middle leaves the old one.

    A link stays one, and who may read the file stays. Raises RequestError when it cannot be written.
    """
    with usable(file, "written"):
        there = file.resolve()
        beside = there.with_name(f".{there.name}.new")
        try:
            beside.write_text(text, encoding="utf-8", newline="")
            shutil.copymode(there, beside)
            os.replace(beside, there)
        except OSError:
            beside.unlink(missing_ok=True)
            raise
