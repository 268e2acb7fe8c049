"""The pages and what they show: fenced blocks and command lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("changelog.d/*.md")])
TUTORIALS = sorted(ROOT.glob("docs/tutorial/*.md"))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Command(NamedTuple):
    """A command line of a page, the output shown under it, and the exit code after `# exit code`."""

    line: str
    output: tuple[str, ...]
    code: int


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[str]:
    """The texts of the fenced blocks of this language."""
    return [text for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")) if kind == language]


def shown(text: str) -> Iterator[Command]:
    """The commands of a console block with their output."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        first, *output = part.splitlines()
        line, _, comment = first.partition("  #")
        code = re.search(r"exit code (\d+)", comment)
        yield Command(line.strip(), tuple(output), int(code[1]) if code else 0)


def masked(lines: list[str] | tuple[str, ...]) -> list[str]:
    """Lines without what differs between two runs: numbers, the width of columns, frames of tables."""
    found = (re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "0", line) for line in lines)
    found = (re.sub(r"[\s─━═-]{2,}", " ", line).strip(" ─━") for line in found)
    return [line for line in found if line]


def missing(wanted: tuple[str, ...], got: str) -> list[str]:
    """Shown lines that the output does not have, in their order. `…` stands for any text, alone for any lines."""
    rest = iter(masked(got.splitlines()))
    lines = [line for line in masked(wanted) if line != "…"]
    patterns = [re.sub(r"(\\ )?…", ".*", re.escape(line)) for line in lines]
    found = [any(re.fullmatch(pattern, other) for other in rest) for pattern in patterns]
    return [line for line, there in zip(lines, found, strict=True) if not there]
