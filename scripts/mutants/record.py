"""What the trials have shown, as data (docs/reference/mutants.json) and as a page (docs/reference/mutants.md)."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from scripts.mutants.subjects import ROOT, Subject, Verdict
from scripts.pages import listed

PAGE: Final = ROOT / "docs" / "reference" / "mutants.md"
KEPT: Final = ROOT / "docs" / "reference" / "mutants.json"
WANTED: Final = 0.95
"""The share of faults that must be noticed."""

RULES: Final = 2
"""Of a trial by others, or of one that does not say, the page says what was amiss with it."""
HEAD = """# Mutants

A test that passes says little until it is known to fail. So small faults are put one at a time into the modules on
which everything else rests: `<` becomes `<=`, `and` becomes `or`, a number changes by one, a statement, an exception
or a bound goes. For each the fast tests of that module are run; at least one has to fail. What no test notices stands
below with the reason, by far most often that the changed program does the same.

Left alone is what no run can show: annotations, docstrings, `assert`, imports, and prose (a string with a space in it
is a sentence for people; a test that repeats it proves nothing).

Of what a module does while it is imported (its tables and constants) a share may be tried by chance, for each such
fault takes a new process; "tried" says how many of all it were. Every fault in a function is tried.

`python -m scripts.mutants --keep` runs all of them anew and makes this page; `python -m scripts.mutants kst-wire` tries
one module and prints what lives.
"""
OLDER: Final = (
    "Tried by an older script, which took a test that was slow to begin for one that had noticed, and statements\n"
    "at the top of a function for tables:\n"
)


def outcome(verdicts: Sequence[Verdict], there_are: int) -> dict[str, Any]:
    """What is kept of the trial of one module, of whose faults `there_are` so many."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "python": platform.python_version(),
        "rules": RULES,
        "there are": there_are,
        "faults": len(verdicts),
        "noticed": sum(bool(one.by) for one in verdicts),
        "without end": sum(one.by == "time" for one in verdicts),
        "survivors": sorted(one.fault for one in verdicts if not one.by),
    }


def kept() -> dict[str, Any]:
    """What is known of each module."""
    found = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    assert isinstance(found, dict)
    return found


def keep(name: str, told: dict[str, Any]) -> None:
    """Put the outcome of this module in place of what was known of it."""
    text = json.dumps({**kept(), name: told}, indent=1, ensure_ascii=False, sort_keys=True)
    KEPT.write_text(f"{text}\n", encoding="utf-8")


def complaints(subject: Subject, told: dict[str, Any]) -> Iterator[str]:
    """What is not as it should be: too few noticed, survivors that nobody has explained, reasons for none."""
    if told["noticed"] < WANTED * told["faults"]:
        yield f"{subject.name}: {share(told)} of the faults are noticed, wanted are {WANTED:.0%}"
    for name in told["survivors"]:
        if name not in subject.reasons:
            yield f"{subject.name}: no test notices, and nobody says why: {name}"
    whole = told["faults"] == told["there are"]  # else one that has a reason may not have been tried
    for name in sorted(set(subject.reasons) - set(told["survivors"])) if whole else ():
        yield f"{subject.name}: there is a reason for what does not survive: {name}"


def share(told: dict[str, Any]) -> str:
    """How much is noticed, rounded down."""
    return f"{int(1000 * told['noticed'] / max(1, told['faults'])) / 10:.1f} %"


def page(subjects: dict[str, Subject], known: dict[str, Any]) -> str:
    """The whole page."""
    both = [(subject, known[name]) for name, subject in subjects.items() if name in known]
    columns = ("module", "files", "faults", "tried", "noticed", "share", "survive", "date", "Python")
    lines = [HEAD, *listed(columns, (_row(*one) for one in both))]
    left = [f"`{name}`" for name in subjects if name not in known]
    lines += [f"Not tried to the end yet: {', '.join(left)}.\n"] if left else []
    older = [f"`{one.name}`" for one, told in both if told.get("rules") != RULES]
    lines += [f"{OLDER}{', '.join(older)}.\n"] if older else []
    for one in both:
        lines += _section(*one)
    return "\n".join(lines)


def _row(subject: Subject, told: dict[str, Any]) -> list[object]:
    counts = [told["there are"], told["faults"], told["noticed"], share(told), len(told["survivors"])]
    return [subject.name, _files(subject), *counts, told["date"], told["python"]]


def _files(subject: Subject) -> str:
    paths = [Path(file).relative_to("src/motorbus") for file in subject.files]
    names = " ".join(path.name for path in paths if path.stem != "__init__")
    return f"`{paths[0].parent.as_posix()}`: {names}" if len(paths) > 1 else f"`{paths[0].as_posix()}`"


def _section(subject: Subject, told: dict[str, Any]) -> Iterator[str]:
    if told["survivors"]:
        yield f"## {subject.name}\n"
        rows = (
            (_code(name), subject.reasons.get(name, "**not explained yet**")) for name in told["survivors"]
        )
        yield from listed(("fault", "why no test notices it"), rows)


def _code(name: str) -> str:
    file, _, rest = name.partition(" ")
    text = rest.replace("|", "\\|")
    return f"{file}: ``{text}``"
