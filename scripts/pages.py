"""Shared by the scripts that make pages: tables in Markdown, and writing a page or checking that it is current."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path


def listed(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> Iterator[str]:
    """The lines of a table, and an empty one."""
    titles = list(columns)
    yield f"| {' | '.join(titles)} |"
    yield f"|{'---|' * len(titles)}"
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"
    yield ""


def kept(wanted: Mapping[Path, str]) -> int:
    """Write these files, or with --check give 1 when those there are not those that would be written."""
    if "--check" in sys.argv[1:]:
        return int(any(not file.exists() or file.read_text("utf-8") != text for file, text in wanted.items()))
    for file, text in wanted.items():
        file.write_text(text, encoding="utf-8")
    return 0


def assumptions(folder: Path) -> Iterator[tuple[str, str]]:
    """The file and the text of each comment and docstring below this folder that ends with `# assumption`."""
    for file in sorted(folder.rglob("*.py")):
        before = ""
        for line in map(str.strip, file.read_text(encoding="utf-8").splitlines()):
            text, mark, rest = line.partition("# assumption")
            if mark and rest in ("", '"""'):
                code = before
                if not rest:
                    code, _, text = text.rpartition("# ")
                name, constant, value = code.partition(": Final")
                shown = f"`{name}{value.rstrip()}`: " if constant else ""
                yield (
                    f"`{file.relative_to(folder)}`",
                    shown + text.strip('" ').rstrip(".").replace("|", "/") + ".",
                )
            before = line
