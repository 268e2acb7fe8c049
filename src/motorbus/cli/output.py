"""Results on stdout, as tables or as JSON; everything else on stderr. rich is imported for a terminal only."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final, TextIO, get_type_hints

from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from motorbus.cli.common import Common, Writing

LONGEST: Final = 300  # characters of one part of a message
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_PARTS: Final = re.compile(r"\n(?=  (?:sent|received|expected|likely cause|what to do): )")
_PLACES: Final = {"rad": 4, "m": 5, "s": 3, "V": 1, "°C": 0, "Hz": 1}  # decimals of a shown value, by unit


def emit(result: Any, common: Common) -> None:
    """Print a Struct, or a list of Structs: one JSON document with --json, else text.

    A mapping of Structs, and a list of them, is a table; other fields are lines `name: value`.
    """
    if common.json:
        print_json(result)
    elif isinstance(result, list | tuple):
        for line in table_lines(_rows(result)):
            print(line)
        sys.stdout.flush()
    else:
        _print_struct(result)


as_json = False  # of the command that runs
_drawn: list[int] = []  # lines of the last table on the terminal
_noted: set[str] = set()  # of `note` in this command


def begin(*, json: bool) -> None:
    """A command begins; `json`: it has --json."""
    global as_json
    as_json = json
    _drawn.clear()
    _noted.clear()


def redraw(lines: Sequence[str]) -> None:
    """Print lines in place of the last ones on a terminal, else below them."""
    if sys.stdout.isatty():
        if _drawn:
            sys.stdout.write(f"\x1b[{_drawn[0]}A\x1b[J")
        _drawn[:] = [len(lines)]
    print("\n".join(lines), flush=True)


def print_json(result: Any, file: TextIO | None = None) -> None:
    """Print one JSON document."""
    import msgspec

    print(msgspec.json.encode(result, enc_hook=str).decode(), file=file, flush=True)


def _print_struct(result: Any) -> None:
    values, tables = [], []
    units = _units(type(result))
    for name in result.__struct_fields__:
        value = getattr(result, name)
        if _is_table(value):
            tables.append(value)
        elif value not in (None, "", (), [], {}):
            values.append([name.replace("_", " ") + ":", show(value, units.get(name, ""))])
    lines = table_lines(values)
    for table in tables:
        rows = _rows(table.values(), list(table)) if isinstance(table, Mapping) else _rows(table)
        lines += [*([""] if lines else []), *table_lines(rows)]
    print("\n".join(lines), flush=True)


def _is_table(value: object) -> bool:
    rows = list(value.values()) if isinstance(value, Mapping) else value
    return isinstance(rows, list | tuple) and bool(rows) and hasattr(rows[0], "__struct_fields__")


def _rows(structs: Any, names: Sequence[str] = ()) -> list[list[str]]:
    """A head and one row for each Struct; a column without a value is left out."""
    structs = list(structs)
    if not structs:
        return []
    units = _units(type(structs[0]))
    fields = [
        field
        for field in structs[0].__struct_fields__
        if any(getattr(one, field) not in (None, "", (), [], {}) for one in structs)
    ]
    heads = [f"{field.replace('_', ' ')}{f' ({units[field]})' if field in units else ''}" for field in fields]
    rows = [
        [show(getattr(one, field), units.get(field, ""), bare=True) for field in fields] for one in structs
    ]
    if names:
        return [["", *heads], *([name, *row] for name, row in zip(names, rows, strict=True))]
    return [heads, *rows]


def _units(kind: type) -> dict[str, str]:
    """The units of the fields of a Struct, from `Meta(extra={"unit": …})`."""
    hints = get_type_hints(kind, include_extras=True)
    found = {}
    for name, hint in hints.items():
        for meta in getattr(hint, "__metadata__", ()):
            if (getattr(meta, "extra", None) or {}).get("unit"):
                found[name] = meta.extra["unit"]
    return found


def show(value: Any, unit: str = "", *, bare: bool = False) -> str:
    """The text of one value, with its unit unless `bare`."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        places = _PLACES.get(unit.partition("/")[0])
        text = f"{value:.6g}" if places is None else f"{value:.{places}f}"
        return text if bare or not unit else f"{text} {unit}"
    if isinstance(value, int) and unit and not bare:
        return f"{value} {unit}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {show(one) or 'unknown'}" for name, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(show(one, unit) for one in value)
    return escape(str(value), None)


def table_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table; the last column is wrapped to the terminal, no other one is cut."""
    import shutil
    import textwrap

    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    indent = sum(widths[:-1]) + 2 * len(widths[:-1])
    room = max(shutil.get_terminal_size().columns - indent, 20) if sys.stdout.isatty() else 10_000
    lines = []
    for row in rows:
        first = "".join(cell.ljust(width + 2) for cell, width in zip(row[:-1], widths[:-1], strict=True))
        wrapped = textwrap.wrap(row[-1], room) or [""]
        lines += [
            f"{first if number == 0 else ' ' * indent}{text}".rstrip() for number, text in enumerate(wrapped)
        ]
    return lines


# -- stderr --------------------------------------------------------------------------------------------------------


def note(text: str, *, once: bool = False) -> None:
    """Print a note on stderr; `once` in a command. A closed stderr is ignored."""
    if once and text in _noted:
        return
    _noted.add(text)
    with suppress(OSError, ValueError):
        parts = [escape(part) for part in _PARTS.split(text)]
        print("\n".join(parts), file=sys.stderr, flush=True)


def escape(text: str, limit: int | None = LONGEST) -> str:
    """The text with control characters as \\xNN; what is longer than `limit` is cut in the middle."""
    if limit is not None and len(text) > limit:
        text = f"{text[: limit * 2 // 3]}…{text[-limit // 3 + 1 :]}"
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


@contextmanager
def progress(what: str) -> Iterator[Callable[..., None]]:
    """A bar on a terminal; gives `advance(done, total, text="")`."""
    if not sys.stderr.isatty():
        yield lambda done, total, text="": None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(file=sys.stderr), transient=True) as bar:
        task = bar.add_task(what, total=None)

        def advance(done: float, total: float, text: str = "") -> None:
            bar.update(task, completed=done, total=total, description=f"{what}: {text}" if text else what)

        yield advance


def confirm(question: str, writing: Writing) -> None:
    """Ask on a terminal unless --yes. Raises NeedsConsent without consent."""
    from motorbus.cli.common import NeedsConsent

    if writing.yes:
        return
    if sys.stdin.isatty() and sys.stderr.isatty():
        print(f"{escape(question)}? [y/N] ", end="", file=sys.stderr, flush=True)
        if sys.stdin.readline().strip().lower() in ("y", "yes"):
            return
        raise NeedsConsent(f"not confirmed: {question}", advice="nothing was changed")
    raise NeedsConsent(f"needs consent: {question}", advice="--yes carries it out; nothing was changed")


def print_error(error: BaseException, code: int, *, as_json: bool) -> None:
    """Print one error on stderr: lines of text, or one JSON object."""
    notes = list(dict.fromkeys(getattr(error, "__notes__", ())))
    summary, parts = "cancelled", []
    if isinstance(error, MotorbusError):
        summary, parts = error.summary, error.parts()
    elif not isinstance(error, KeyboardInterrupt):
        summary = str(error)
    if as_json:
        facts = {
            "type": "error",
            "error": type(error).__name__,
            "exit": int(code),
            "summary": escape(summary),
        }
        facts |= {name.replace(" ", "_"): escape(text) for name, text in parts}
        facts |= {
            name: value
            for name in ("node", "register", "owner", "reason")
            if (value := getattr(error, name, None)) not in (None, "")
        }
        facts |= {"notes": [escape(text) for text in notes]} if notes else {}
        with suppress(OSError, ValueError):
            print_json(facts, sys.stderr)
        return
    note("\n".join([f"error: {summary}", *(f"  {name}: {text}" for name, text in parts)]))
    for text in notes:
        note(f"  note: {text}")
