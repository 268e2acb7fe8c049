"""The machine file `motorbus.toml`: what a person has, in words and units of their own, read once and exactly.

    machine = Machine.load("motorbus.toml")
    shoulder = machine.axes["shoulder"]
    shoulder.to_device(0.5)            # rad of the axis -> rad of its device, by zero, sign, gear and travel

Nothing here opens a bus. `edited` changes a file and leaves its comments and its order to the person who
wrote them; `Machine.text` writes a fresh one.
"""

from __future__ import annotations

import os
import stat
from os import PathLike
from pathlib import Path
from typing import Final

from msgspec import structs

from motorbus.errors import RequestError
from motorbus.motion.machine import reading, writing
from motorbus.motion.machine.edits import edited
from motorbus.motion.machine.model import FORMAT, AxisSpec, BusSpec, Description, GroupSpec
from motorbus.motion.machine.reading import CheckAddress
from motorbus.motion.machine.refusal import listed, nearest, of_file
from motorbus.motion.machine.schema import schema

NAME: Final = "motorbus.toml"
"""What the file is called where nobody says otherwise."""
PIPED: Final = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")
"""Where what others write for us is read: pipes that are open already."""


class Machine(Description, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """A machine: `name`, and by their names `buses`, `axes`, `groups` and `poses`, in the order of the file.

    One that was read fits together; one that is made of parts by hand is judged by `text`.
    """

    @property
    def file(self) -> str:
        """The path that it was loaded from, "" where there is none; machines that differ in it only are equal."""
        return str(self.__dict__.get("file", ""))

    # -- from what it is made ----------------------------------------------------------------------------------------

    @classmethod
    def parse(cls, text: str, *, check_address: CheckAddress | None = None) -> Machine:
        """From the text of a file. Raises RequestError, naming the place in the file, for what cannot be.

        `check_address` is called with the address of each bus and raises RequestError for one it cannot take; without
        it only the form FAMILY:PORT is checked.
        """
        return cls(**structs.asdict(reading.read(text, check_address)))

    @classmethod
    def load(cls, path: str | PathLike[str], *, check_address: CheckAddress | None = None) -> Machine:
        """From a file. Raises RequestError, beginning with its path, when it cannot be read or for what it says."""
        with of_file(path):
            found = cls.parse(source(path), check_address=check_address)
        found.__dict__["file"] = str(path)
        return found

    # -- what it becomes -----------------------------------------------------------------------------------------------

    def text(self) -> str:
        """A fresh file that describes it, with a comment on each key where it first stands.

        What it is read as is this machine again, to the last digit. Raises RequestError for a machine that no file may
        describe, as one with an axis on a bus that it does not have.
        """
        return writing.write(self)

    # -- what is in it -------------------------------------------------------------------------------------------------

    def axes_of(self, name: str) -> tuple[str, ...]:
        """The axes that a name stands for: an axis, those of a group, those on a bus. Raises RequestError for none."""
        if name in self.axes:
            return (name,)
        if name in self.groups:
            return self.groups[name].axes
        if name in self.buses:
            return tuple(axis for axis, spec in self.axes.items() if spec.bus == name)
        known = [*self.axes, *self.groups, *self.buses]
        raise RequestError(
            f"there is no axis, group or bus {name!r}", expected=listed(known), advice=nearest(name, known)
        )

    def pose(self, name: str) -> dict[str, float]:
        """The positions (rad, m) of a pose by the names of axes. Raises RequestError when there is none of it."""
        if name not in self.poses:
            raise RequestError(
                f"there is no pose {name!r}",
                expected=listed(self.poses, "a pose of the file, as [pose.ready]"),
                advice=nearest(name, self.poses),
            )
        return dict(self.poses[name])


def source(
    path: str | PathLike[str],
    *,
    longest: int = reading.LONGEST,
    kind: str = "TOML",
    expected: str = f"a machine file, as {NAME}",
) -> str:
    """The text of a file as it is on disk, with its ends of lines.

    Raises RequestError when it cannot be read, is no text, or is no file: a pipe is read as /dev/stdin only. No more
    than one character above `longest` is read; `kind` and `expected` are words for what it should be.
    """
    try:
        if other := kind_of_no_file(path):
            raise OSError(f"it is {other}, and no file")
        with Path(path).open(encoding="utf-8", newline="") as file:
            text = file.read(longest + 1)
    except UnicodeDecodeError as error:
        raise _no_text(kind, error.reason) from None
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        raise RequestError(
            f"it cannot be read: {why}",
            expected=expected,
            advice="see that the path is right; nothing was opened",
        ) from error
    if "\0" in text:  # as UTF-16 without its mark has beside each letter
        raise _no_text(kind, "there are zero bytes in it")
    return text


def kind_of_no_file(path: str | PathLike[str]) -> str:
    """What a path leads to where reading might never end, for nobody writes there; "" for anything else.

    Whatever is piped in by a descriptor of ours has somebody who writes it. Raises OSError where there is nothing.
    """
    mode = os.stat(path).st_mode
    if os.path.abspath(path).startswith(PIPED):
        return ""
    if stat.S_ISFIFO(mode):
        return "a named pipe"
    return "a device" if stat.S_ISCHR(mode) or stat.S_ISBLK(mode) else ""


def _no_text(kind: str, why: str) -> RequestError:
    return RequestError(
        f"it is no text: {why}",
        expected=f"{kind} in UTF-8",
        advice="save it as UTF-8, or see that it is the right file; nothing was opened",
    )


__all__ = [
    "FORMAT",
    "NAME",
    "AxisSpec",
    "BusSpec",
    "GroupSpec",
    "Machine",
    "edited",
    "kind_of_no_file",
    "schema",
    "source",
]
