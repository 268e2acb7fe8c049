"""Keeps the figures of long runs: each run tells its own, and docs/reliability.md shows the last ones.

A run appends to a file under build/ while it goes on, so that what was measured is there even when a later run fails.
"""

from __future__ import annotations

import datetime
import json
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parent.parent
FRESH: Final = ROOT / "build" / "soak.jsonl"
KEPT: Final = ROOT / "docs" / "reliability.json"
MADE: Final = ("docs/reliability.json", "docs/reliability.md")
"""What a long run itself writes."""
Figure = int | float | str


def record(
    what: str, *, family: str = "", promise: int = 0, test: str = "", **figures: Figure
) -> dict[str, Any]:
    """Keep the figures of one run: a row of the table, told apart by `what` and `family`.

    `what`     begins with the rows of the fault matrix that it is about, as "L7 late replies"
    `promise`  the number of the promise that it proves, 0 for none
    `test`     who measured it, so that it can be run again
    """
    made = {
        "what": what,
        "family": family,
        "promise": promise,
        "test": test,
        "figures": figures,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "commit": commit(),
    }
    FRESH.parent.mkdir(parents=True, exist_ok=True)
    with FRESH.open("a", encoding="utf-8") as file:
        file.write(json.dumps(made, ensure_ascii=False) + "\n")
    return made


def commit() -> str:
    """What is measured: the commit, with a plus where files differ from it; "" outside a repository.

    The figures themselves and their page may differ: else a second part of the long runs could never follow a first.
    """
    try:
        name = _git("describe", "--always", "--abbrev=10", "--exclude=*")
        differ = _git("diff", "--name-only", "HEAD", "--", ".", *(f":(exclude){file}" for file in MADE))
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{name}+" if differ else name


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def begin(*flags: str) -> str:
    """Forget what the runs before have told; gives what is to be said when the figures will not be taken."""
    FRESH.unlink(missing_ok=True)
    now = commit()
    if not now.endswith("+") or "--dirty" in flags:
        return ""
    return (
        f"files differ from {now[:-1]}: figures are printed and kept in {FRESH.relative_to(ROOT)}, but"
        f" {KEPT.relative_to(ROOT)} and its page do not take them (make soak TAKE=--dirty: they do)"
    )


def fresh() -> list[dict[str, Any]]:
    """What the runs since the last `make soak` have told, in order."""
    return [json.loads(line) for line in FRESH.read_text("utf-8").splitlines()] if FRESH.exists() else []


def kept() -> list[dict[str, Any]]:
    """What the page shows."""
    records: list[dict[str, Any]] = json.loads(KEPT.read_text("utf-8"))["runs"] if KEPT.exists() else []
    return records


def merged(old: Iterable[dict[str, Any]], new: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The last run of each kind, in a fixed order."""
    last = {(one["family"], one["what"]): one for one in (*old, *new)}
    return sorted(
        last.values(), key=lambda one: (one["promise"] or 99, _row(one["what"]), one["what"], one["family"])
    )


def _row(what: str) -> tuple[int, int]:
    """Where the row of the fault matrix stands that a run is about: L before D before whatever is none."""
    match = re.match(r"([LD])(\d+)\b", what)
    return ("LD".index(match[1]), int(match[2])) if match else (2, 0)


def text(runs: Iterable[dict[str, Any]]) -> str:
    """As it stands in the file."""
    return json.dumps({"format": 1, "runs": list(runs)}, ensure_ascii=False, indent=1) + "\n"


if __name__ == "__main__":
    if said := begin(*sys.argv[1:]):
        print(said, file=sys.stderr)
