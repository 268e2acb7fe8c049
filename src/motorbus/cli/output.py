"""Where results go: a table for eyes, JSON for programs; results on stdout and everything else on stderr.

A command says its result once, as plain facts, and once more as a table; which of the two is printed is decided
here. rich is imported when the first table is drawn, so that JSON and help cost nothing.
"""

from __future__ import annotations

import json
import re
import sys
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final, TextIO

from motorbus.cli.exits import NeedsConsent, exit_code
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from rich.console import Console
    from rich.progress import Progress, TaskID
    from rich.table import Table

CUT: Final = 300
"""Characters of an unbroken word in a message: an argument, or a line of a file, may be of any length."""
LONGEST: Final = 1000
"""Characters of one part of a message, so that a list of devices, or the advice behind a long path, is whole."""
_LONG_WORD: Final = re.compile(rf"\S{{{CUT + 1},}}")
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_PART: Final = re.compile(r"\n(?=  (?:sent|received|expected|likely cause|what to do): )")
_NO_WRAP: Final = 10_000  # columns of a "terminal" that is a file or a pipe: never fold a row


class Output:
    """One run of one command. `simulated` is set as soon as it is known that no real device is behind the bus."""

    def __init__(self, *, json: bool = False) -> None:
        self.json = json
        self.simulated = False
        self._said = False

    @property
    def live(self) -> bool:
        """A person is watching stdout, so a table may redraw itself."""
        return not self.json and sys.stdout.isatty()

    def document(self, schema: str, facts: Mapping[str, object]) -> None:
        """The one JSON document of a command, or one line of a stream. Prints nothing without --json."""
        if self.json:
            marked = {"schema": schema, **({"simulated": True} if self.simulated else {}), **facts}
            print(json.dumps(marked, allow_nan=False), flush=True)

    def table(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """The same for eyes; a column whose name begins with `>` is set flush right."""
        if self.json:
            return
        if title:
            self._said = self.simulated
            self.console().print(
                printable(self.marked(title), limit=None), style="bold", markup=False, soft_wrap=True
            )
        self.draw(self.grid(columns, rows))

    def text(self, text: str) -> None:
        """A result that is prose."""
        if not self.json:
            self._said = self._said or "simulated" in text
            self.mark()
            self.console().print(_lines_of(text), markup=False, soft_wrap=True)

    def mark(self) -> None:
        """The first line of what is simulated says so, where nothing before it did."""
        if self.simulated and not self._said and not self.json:
            self._said = True
            print("simulated", flush=True)

    def draw(self, table: Table) -> None:
        """Print a table; in a file or a pipe without the blanks that pad it."""
        self.mark()
        shown = self.console()
        with shown.capture() as drawn:
            shown.print(table)
        lines = drawn.get().splitlines()
        print("\n".join(line if shown.is_terminal else line.rstrip() for line in lines), flush=True)

    def note(self, text: str, *, limit: int | None = LONGEST) -> None:
        """Something worth knowing that is not the result. Nothing else ends because nobody reads that any more."""
        with suppress(OSError):
            print("\n".join(_parts_of(text, limit)), file=sys.stderr, flush=True)

    def console(self) -> Console:
        return console(sys.stdout)

    def grid(self, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
        """A rich table: ruled on a terminal, bare columns in a file or a pipe."""
        from rich import box
        from rich.table import Table

        terminal = sys.stdout.isatty()
        grid = Table(
            box=box.SIMPLE_HEAD if terminal else None,
            show_edge=False,
            pad_edge=False,
            header_style="bold" if terminal else "",
            show_header=any(columns),
        )
        for name in columns:
            grid.add_column(name.removeprefix(">"), justify="right" if name.startswith(">") else "left")
        for row in rows:
            grid.add_row(*(_cell(value) for value in row))
        return grid

    def marked(self, title: str) -> str:
        return f"{title} (simulated)" if self.simulated else title

    @contextmanager
    def progress(self, what: str) -> Iterator[Bar]:
        """A bar on stderr while a person watches it, and nothing at all otherwise."""
        if not sys.stderr.isatty():
            yield Bar()
            return
        from rich.progress import Progress

        with Progress(console=console(sys.stderr), transient=True) as shown:
            yield Bar(shown, shown.add_task(what, total=None))

    def consent(self, what: str, *, yes: bool) -> None:
        """Go on only if a person or `--yes` agrees to `what`, as "move #1 by 200 degrees". Raises NeedsConsent."""
        if yes or (_can_ask() and _asked(f"{what}?")):
            return
        raise NeedsConsent(
            f"nobody agreed to this: {what}", advice="say --yes if that is what you want; nothing was changed"
        )

    def error(self, error: BaseException) -> None:
        """One clear error on stderr: prose, or one JSON object with --json. Does nothing where stderr is closed."""
        with suppress(OSError):
            if self.json:
                print(json.dumps(_error_facts(error)), file=sys.stderr, flush=True)
            else:
                console(sys.stderr).print(_error_text(error), soft_wrap=True)


class Bar:
    """A progress bar, or silence: long work calls it without asking which."""

    def __init__(self, shown: Progress | None = None, task: TaskID | None = None) -> None:
        self._shown = shown
        self._task = task

    @property
    def shown(self) -> bool:
        """Somebody watches it."""
        return self._shown is not None

    def advance(self, done: float, total: float, what: str = "") -> None:
        """`done` of `total` units of work."""
        if self._shown is not None and self._task is not None:
            named = {"description": what} if what else {}
            self._shown.update(self._task, completed=done, total=total, **named)  # type: ignore[arg-type]

    def say(self, text: str) -> None:
        """An early result, above the bar."""
        if self._shown is not None:
            self._shown.console.print(text, markup=False)


def console(file: TextIO) -> Console:
    """A rich console on this stream; rich itself obeys NO_COLOR. Raises BrokenPipeError when nobody reads any more."""
    from rich.console import Console

    class Heard(Console):
        def on_broken_pipe(self) -> None:  # rich would end the program here, with an exit code of its own
            raise

    return Heard(file=file, highlight=False, width=None if file.isatty() else _NO_WRAP)


def printable(text: str, *, limit: int | None = LONGEST) -> str:
    """A text from outside as a terminal may have it: control characters as \\xNN, and what is too long cut."""
    if limit is not None:
        text = _middle_cut(_LONG_WORD.sub(lambda word: _middle_cut(word[0], CUT), text), limit)
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


def _middle_cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else f"{text[: limit * 2 // 3]}…{text[-limit // 3 :]}"


def _lines_of(text: str) -> str:
    """A result of several lines."""
    return "\n".join(printable(line, limit=None) for line in text.split("\n"))


def _parts_of(text: str, limit: int | None = LONGEST) -> list[str]:
    """A message with its parts, each on a line of its own. No other line break is one of ours."""
    return [printable(part, limit=limit) for part in _PART.split(text)]


def _cell(value: object) -> Any:
    from rich.text import Text

    if hasattr(value, "__rich_console__"):
        return value
    return Text("" if value is None else _lines_of(str(value)))


def _can_ask() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _asked(question: str) -> bool:
    print(f"{printable(question)} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _error_text(error: BaseException) -> Any:
    from rich.text import Text

    return Text.assemble(("error: ", "bold red"), _message(error))


def _message(error: BaseException) -> str:
    """All of it; a cause or an advice that several have in common is said once."""
    if isinstance(error, MotorbusError):
        lines = [printable(error.summary), *(f"  {name}: {printable(text)}" for name, text in error.parts())]
    else:
        lines = [printable(_summary(error))]
    for note in _notes(error):
        first, *parts = _parts_of(note)
        lines += [f"  note: {first}", *(part for part in parts if part not in lines)]
    return "\n".join(lines)


def _summary(error: BaseException) -> str:
    return "cancelled" if isinstance(error, KeyboardInterrupt) else str(error) or type(error).__name__


def _notes(error: BaseException) -> list[str]:
    """What was added to it on its way, such as what has become of the device."""
    return list(dict.fromkeys(getattr(error, "__notes__", ())))


def _error_facts(error: BaseException) -> dict[str, object]:
    facts: dict[str, object] = {"schema": "motorbus.error/1", "error": type(error).__name__}
    notes = ["\n".join(_parts_of(note)) for note in _notes(error)]
    facts |= {"exit": exit_code(error), **({"notes": notes} if notes else {})}
    if not hasattr(error, "summary"):
        return {**facts, "summary": printable(_summary(error))}
    parts = (
        "summary",
        "sent",
        "received",
        "expected",
        "cause",
        "advice",
        "node",
        "register",
        "code",
        "owner",
    )
    found = {part: getattr(error, part, None) for part in parts}
    return facts | {part: _plain(value) for part, value in found.items() if value not in (None, "", b"")}


def _plain(value: object) -> object:
    if isinstance(value, int | float):
        return value
    return printable(value.hex(" ").upper() if isinstance(value, bytes | bytearray) else str(value))
