"""Guided procedures in a terminal: questions on stderr, answers by Enter, live tables in place."""

from __future__ import annotations

import queue
import sys
import threading
from typing import Final

from motorbus.errors import RequestError
from motorbus.setup.engine import Live, Note, Prompt, Step

UP: Final = "\x1b[{}A\x1b[J"


class Terminal:
    """A `Face` on stdin and stderr. One thread reads the lines of the user, so that a live table can go on."""

    def __init__(self) -> None:
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        self._drawn = 0  # lines of the live table on the screen

    def show(self, step: Step) -> str | None:
        """Show a step; waits for the answer of a prompt. Raises RequestError at the end of the input."""
        if isinstance(step, Live):
            return self._show_live(step)
        self._drawn = 0
        if isinstance(step, Note):
            _print(f"{'warning: ' * step.warning}{step.text}\n")
            return None
        return self._ask(step)

    def _ask(self, prompt: Prompt) -> str:
        first, *others = prompt.choices or ("",)
        enter = f"Enter: {first}" if others else "Enter"
        _print(f"{prompt.text} [{' / '.join([enter, *others])}] ")
        line = self._read_line(wait=True)
        assert line is not None
        return line

    def _show_live(self, live: Live) -> str | None:
        if sys.stderr.isatty():
            lines = _table(live)
            _print((UP.format(self._drawn) if self._drawn else "") + "\n".join(lines) + "\n")
            self._drawn = len(lines)
        elif not self._drawn:
            _print(f"{live.text}\n")
            self._drawn = 1
        return self._read_line(wait=False)

    def _read_line(self, *, wait: bool) -> str | None:
        if self._reader is None:
            self._reader = threading.Thread(target=self._read_lines, name="motorbus stdin", daemon=True)
            self._reader.start()
        while True:
            try:
                line = self._lines.get(timeout=0.2) if wait else self._lines.get_nowait()
            except queue.Empty:
                if not wait:
                    return None
                continue
            if not line:
                self._lines.put("")  # the end stays the end
                raise RequestError(
                    "the input ended before the procedure", advice="run it again: it continues"
                )
            return line.strip()

    def _read_lines(self) -> None:
        while line := sys.stdin.readline():
            self._lines.put(line)
        self._lines.put("")


def _table(live: Live) -> list[str]:
    cells = [live.columns, *((row.name, *row.values) for row in live.rows)]
    widths = [max(len(line[column]) for line in cells) for column in range(len(live.columns))]
    marks = ["", *(row.mark for row in live.rows)]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        + (f"  {mark}" if mark else "")
        for line, mark in zip(cells, marks, strict=True)
    ]
    return [live.text, *lines]


def _print(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)
