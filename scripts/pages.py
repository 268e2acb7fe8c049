"""What the scripts that make pages share: tables in Markdown, and writing a page or seeing that it is current."""

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
    """The file and the text of each comment below this folder that ends with `# assumption`."""
    for file in sorted(folder.rglob("*.py")):
        for line in file.read_text(encoding="utf-8").splitlines():
            code, mark, rest = line.strip().partition("# assumption")
            if not mark or rest:
                continue
            code, _, text = code.rpartition("# ")
            name, constant, value = code.partition(": Final")
            shown = f"`{name}{value.rstrip()}`: " if constant else ""
            yield f"`{file.relative_to(folder)}`", f"{shown}{text.strip()}."
