"""Ctrl-C at one certain line of the code that is tested."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeAlias

Line: TypeAlias = "tuple[str, int]"


class _Interrupt:
    """Raises KeyboardInterrupt where the first line of these files is about to be carried out that was not `tried`."""

    def __init__(self, files: tuple[str, ...], tried: set[Line]) -> None:
        self.files = files
        self.tried = tried
        self.where: Line | None = None

    def __call__(self, frame: FrameType, event: str, arg: object) -> Any:
        if self.where is not None or not frame.f_code.co_filename.endswith(self.files):
            return None
        return self.line

    def line(self, frame: FrameType, event: str, arg: object) -> Any:
        """One event of such a file."""
        here = (frame.f_code.co_filename, frame.f_lineno)
        if event == "line" and self.where is None and here not in self.tried:
            self.tried.add(here)
            self.where = here
            raise KeyboardInterrupt
        return self.line


def interrupted(act: Callable[[], object], files: tuple[str, ...], tried: set[Line]) -> Line | None:
    """Do it, with Ctrl-C at the first line of these files that was not `tried`, and tell which; None: there is none."""
    interrupt, before = _Interrupt(files, tried), sys.gettrace()
    sys.settrace(interrupt)
    try:
        act()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
    return interrupt.where
