"""Makes docs/reliability.md: what is promised, the figures of the last long runs, and the tests of each kind of fault.

`make soak` measures and calls this with `--take`, which takes over what its runs have told; but nothing at all of it
when some of it was measured with files that differ from their commit, for nobody could measure that again. `--dirty`
takes it all the same. `--check` sees that the page is the one that its figures and the tests there are would make.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from textwrap import fill
from typing import Any, Final

from scripts import soaked, tests_told
from scripts.fault_rows import ROWS
from scripts.pages import kept, listed

PAGE: Final = soaked.ROOT / "docs" / "reliability.md"
FIRST: Final = ("seed", "kinds", "exchanges", "reads", "faults", "wrong")
"""Figures that come first in a table; the others follow in the order in which a run has told them."""
REFUSED: Final = 2
"""How this ends when it takes nothing of what it was given; a long run has not failed for that."""
MANY: Final = 4
"""So many runs of one kind are one row."""
NEITHER: Final = "neither_but_told"
"""The figure of cuts that left a project neither old nor new."""

HEAD: Final = """# Reliability

What the bus survives, measured against the simulators, with faults on the line and in the devices. No hardware was
attached. This page is made by `python -m scripts.reliability` from the figures of the last long runs and from the names
of the tests. To measure all of it again:

```sh
make soak
```

It takes hours; a part of it, as `make soak ARGS=tests/faults/test_chance.py`, renews the figures of that part alone.
`make test` runs the same tests with fewer rounds, in virtual time. A commit with a plus had files that differed; such
figures are taken by `make soak TAKE=--dirty` alone.

**Wrong** is judged by what the simulated devices really held, which they keep a history of. A value is right if the
device held it at some moment between the call and its return. A write that succeeds is right if the device has carried
it out within the call. A call that fails is right if what it says is so: *not sent*, *rejected by the device*, or
*outcome unknown*; a reading that fails gives no value. Every run asserts that its faults have happened. A row without
*wrong* is that of a run that ends at the first one, and tells no figures then.

What no program on the host can tell apart is no fault that a promise covers; it is measured too, and written down as a
[known limit](explanation/taint.md): such are faults *toward the device*, and those in the text of a CAN adapter, that
have something wrong below.

In the tables *faults* is how many happened, and *wrong* how often something false was told. *Expected* is what
arithmetic says that chance brings. *Untouched* are calls that no fault met, *untouched again* those of them that had to
ask twice. *Kinds* is how many runs are added up in one row; *4 of 16*: there are more, [not measured
yet](#not-measured-at-length-yet). *Cuts* is how often the power or the program went, *states* in how many different
states that left a device, *lost* how often the end was not as promised. *Descriptors*, *threads*, *blocks* (of Python's
memory) and *kib* are what was left over. Times are those of the simulation, in s.
"""

PROMISES: Final = {
    1: "Any single byte-level fault in a reply gives no wrong value: all kinds of exchange of all families, and every"
    " fault there is. On CAN that is a frame lost, doubled, late or out of order, for a damaged one does not"
    " arrive. The level of an input of the stepper controller is one bit without a checksum: it is read until two"
    " readings agree.",
    2: "A million reads of two bytes of a FEETECH servo with 1 % of the bytes of its replies changed: at most 8 wrong"
    " where a reading is not confirmed (a sum of 8 bits lets 2.2 pass on average), none where it is. No false"
    " acknowledgement of a stepper controller. No call hangs, the second exchange after the last fault is right, and"
    " what met no fault is right at its first try.",
    3: "A million exchanges of each family with 1 % of the replies late: no stale value. What programs of others make"
    " of the same fault stands beside it; `python -m bench.stale_replies` does that again.",
    4: "**One deviation from what was asked, which is old or new after 100 % of the cuts: a project of a stepper"
    " controller is left neither old nor new after {neither}.** Everything else keeps it. Power or program cut at"
    " every byte and every step of a change of id or rate, of provisioning and of writing a project, and again during"
    " the recovery: old or new, reachable, locked, at most one device with an id. A project is written number by"
    " number and saved at the end, by a controller that forgets which one is selected when its supply goes: so it can"
    " be left with neither. Then its host is told, never of a success, and the next write mends it; how often a cut"
    " has left neither, told to its host or an earlier one, is *neither but told*.",
    5: "A day of jogging, monitoring and reconnecting writes nothing to an EEPROM.",
    6: "Ten minutes of garbage as fast as the line carries it, of five kinds or more: nothing hangs, no buffer has"
    " more than 4 KiB, and four times the garbage is about four times the work. Most calls have garbage in them, and"
    " what a reader holds back is looked at after every piece it is fed. *Core seconds per minute* is what the product"
    " takes of the processor, what the simulated line takes stands beside it; both are told and not judged. The aim"
    " was one core-second a minute. Random bytes, FF, FF AA and digits stay below it; a full line of whole short"
    " frames, of beginnings of long ones, or of empty lines of text does not: each is looked at by itself. A whole one"
    " took about 5 µs on a FEETECH line and 15 µs on CAN, and 14 000 a second fit on a FEETECH line of 1 Mbit/s, 4000"
    " on CAN of 500 kbit/s. *Work* is lines of the product that were executed, and bytes held back that were looked at"
    " again, per byte of garbage; *growth* is for four times the garbage.",
    7: "No test of a fault can pass while its fault is switched off; those that may, and why, stand in"
    " [a table of their own](#what-may-pass-without-its-fault).",
}


def page(runs: Iterable[dict[str, Any]], cases: Iterable[str]) -> str:
    """The whole page. `cases` are all that long runs measure, as pytest names them."""
    told, by_test = list(runs), _by_test(cases)
    parts = _promises(told, by_test), _others(told, by_test), _missing(told, by_test), _exempt(), _rows()
    return "\n".join([HEAD, *(line for part in parts for line in part)]).rstrip() + "\n"


def _by_test(cases: Iterable[str]) -> dict[str, list[str]]:
    """The cases of each test."""
    found: dict[str, list[str]] = {}
    for case in cases:
        found.setdefault(case.partition("[")[0], []).append(case)
    return found


def _promises(runs: list[dict[str, Any]], cases: dict[str, list[str]]) -> Iterator[str]:
    for number, says in PROMISES.items():
        text = says.replace("{neither}", _neither(runs, cases))
        yield f"## Promise {number}\n\n{fill(text, 118, break_on_hyphens=False)}\n"
        yield from _table((run for run in runs if run["promise"] == number), cases)


def _neither(runs: Iterable[dict[str, Any]], cases: dict[str, list[str]]) -> str:
    """How often a cut has left a project neither old nor new, by the runs that count it, and whether those are all."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for run in runs:
        if NEITHER in run["figures"]:
            groups.setdefault(_kind(run["what"]), []).append(run)
    said = []
    for group in groups.values():
        some, cuts = (sum(run["figures"][name] for run in group) for name in (NEITHER, "cuts"))
        share = _share(group, cases)
        said.append(f"{_shown(some)} of {_shown(cuts)} cuts{f' ({share} kinds)' if share else ''}")
    return " and after ".join(said) or "some"


def _share(group: list[dict[str, Any]], cases: dict[str, list[str]]) -> str:
    """`4 of 16` where a test has more cases than these runs of it have measured; "" for all, and where nobody knows.

    Where one case has told several runs, it is not known how many those would be.
    """
    measured = {run["test"] for run in group}
    every = {case for run in group for case in cases.get(_where(run), ())}
    if len(measured) < len(group) or measured >= every:
        return ""
    return f"{len(measured & every)} of {len(every)}"


def _others(runs: list[dict[str, Any]], cases: dict[str, list[str]]) -> Iterator[str]:
    yield "## Other long runs\n"
    yield from _table((run for run in runs if run["promise"] not in PROMISES), cases)


def _missing(runs: list[dict[str, Any]], cases: dict[str, list[str]]) -> Iterator[str]:
    """Cases of long runs that the table has no figures of: they are seen to be absent."""
    measured = {run["test"] for run in runs}
    absent = {test: [case for case in some if case not in measured] for test, some in cases.items()}
    yield "## Not measured at length yet\n"
    count, every = sum(map(len, absent.values())), sum(map(len, cases.values()))
    if count:
        yield f"{count} of the {every} cases of long runs have no figures here; `make soak` measures them.\n"
        yield from listed(
            ("test", "cases", "which"),
            [
                [f"`{test}`", f"{len(some)} of {len(cases[test])}", _which(some, cases[test])]
                for test, some in absent.items()
                if some
            ],
        )
    else:
        yield "None: every case of every long run has figures here.\n"


def _which(some: list[str], every: list[str]) -> str:
    """Those that are not all, by their parameters."""
    parameters = [case.partition("[")[2].removesuffix("]").replace("|", "\\|") for case in some]
    return "<br>".join(f"`{one}`" for one in parameters) if len(some) < len(every) else ""


def _exempt() -> Iterator[str]:
    """What is not judged by promise 7, so that it is not believed of more than it was seen of."""
    yield "## What may pass without its fault\n"
    yield "These are left out of the run of promise 7, each for the reason that stands with it.\n"
    yield from listed(
        ("why", "what is left out"),
        [[why, "<br>".join(f"`{one}`" for one in left)] for why, left in tests_told.exempt().items()],
    )


def _table(runs: Iterable[dict[str, Any]], cases: dict[str, list[str]]) -> Iterator[str]:
    rows = [
        [run["what"], run["family"], _figures(run["figures"]), _run(run)] for run in together(runs, cases)
    ]
    if rows:
        yield from listed(("what", "family", "figures", "run"), rows)
    else:
        yield "Not measured yet.\n"


def together(runs: Iterable[dict[str, Any]], cases: dict[str, list[str]]) -> list[dict[str, Any]]:
    """One row for many of a kind: those of one test that strike toward one side and begin alike up to a comma.

    Counts are added up, and of what begins with `longest` or `most` the largest is kept. Each by itself stands in the
    file of figures. Where they are all that was measured of their test, and that has more `cases`, it is told.
    """
    groups: dict[object, list[dict[str, Any]]] = {}
    for run in runs:
        kind = _kind(run["what"]), run["family"], run["test"].partition("[")[0], *run["figures"]
        groups.setdefault(kind, []).append(run)
    measured: dict[str, set[str]] = {}
    for group in groups.values():
        for run in group:
            measured.setdefault(_where(run), set()).add(run["test"])
    found: list[dict[str, Any]] = []
    for group in groups.values():
        whole = {run["test"] for run in group} == measured[_where(group[0])]
        share = _share(group, cases) if whole else ""
        found += [_summed(group, share)] if len(group) >= MANY else group
    return found


def _kind(what: str) -> str:
    """What stands before the first comma, and toward whom the faults go."""
    first, *others = what.split(", ")
    return ", ".join([first, *(other for other in others if other.startswith("toward "))])


def _summed(group: list[dict[str, Any]], share: str) -> dict[str, Any]:
    """One row of these. `share`: which part of all kinds they are, "" for all."""
    last = max(group, key=lambda run: str(run["date"]))
    figures: dict[str, Any] = {"kinds": share or len(group)}
    for name in group[0]["figures"]:
        values = [run["figures"][name] for run in group]
        if any(isinstance(value, str) for value in values) or name == "seed":
            continue
        figures[name] = max(values) if name.startswith(("longest", "most")) else sum(values)
    what, test = _kind(last["what"]), last["test"].partition("[")[0]
    return {**last, "what": what, "test": test, "figures": figures}


def _figures(figures: dict[str, Any]) -> str:
    names = [name for name in FIRST if name in figures] + [name for name in figures if name not in FIRST]
    return ", ".join(f"{name.replace('_', ' ')} {_shown(figures[name])}" for name in names)


def _shown(value: object) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}".replace(",", " ") if value >= 10_000 else str(value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _run(run: dict[str, Any]) -> str:
    return f"`{_where(run)}` {run['date']} {run['commit']}".strip()


def _where(run: dict[str, Any]) -> str:
    """The test that has measured it, whatever its parameters were."""
    return str(run["test"]).partition("[")[0]


def _rows() -> Iterator[str]:
    """Each kind of fault with its tests."""
    yield "## Kinds of faults, and their tests\n"
    yield "L is what a line and its ends do, D what devices and buses do. Each has tests that bear its name.\n"
    found = tests_told.of_rows()
    rows = [
        [name, says, "<br>".join(f"`{test}`" for test in found.get(name, []))] for name, says in ROWS.items()
    ]
    yield from listed(("", "fault, and what is promised", "tests"), rows)


def _refusal(dirty: list[dict[str, Any]], new: list[dict[str, Any]]) -> str:
    return (
        f"error: {len(dirty)} of {len(new)} figures were measured with files that differ from"
        f" {dirty[0]['commit'][:-1]}, the first of them by {dirty[0]['test']}; nothing is written\n"
        f"  expected: figures of a commit, which can be measured again\n"
        f"  what to do: commit, and measure again; or take them with their plus:"
        f" python -m scripts.reliability --take --dirty"
    )


def main() -> int:
    """Write the page, with --take from new figures as well; or with --check see that the one there is current."""
    new = soaked.fresh() if "--take" in sys.argv[1:] else []
    dirty = [] if "--dirty" in sys.argv[1:] else [run for run in new if run["commit"].endswith("+")]
    if dirty:
        print(_refusal(dirty, new), file=sys.stderr)
        return REFUSED
    runs = soaked.merged(soaked.kept(), new)
    wanted: dict[Path, str] = {PAGE: page(runs, tests_told.cases())}
    return kept({soaked.KEPT: soaked.text(runs), **wanted})


if __name__ == "__main__":
    sys.exit(main())
