"""Tries every small fault in the modules of scripts/mutants.toml, and says which of them no fast test notices.

    python -m scripts.mutants                        every module
    python -m scripts.mutants kst-wire journal       some
    python -m scripts.mutants stop --only stop.py    only faults with this text in their name
    python -m scripts.mutants kst-wire --tables 0.1  of the faults in tables a tenth, always the same one
    python -m scripts.mutants kst-wire --json x.json, then --again x.json   what survived, once more
    python -m scripts.mutants --keep                 all, and docs/reference/mutants.* made of it
    python -m scripts.mutants --write | --check      the page of what is kept: make it, or see that it is current

The exit code is 1 when a fault survives that mutants.toml has no reason for, when fewer than 95 % of a module are
noticed, or when a reason is for none. `--anew` imports the module anew for every fault, which is slower.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from scripts import pages
from scripts.mutants.record import PAGE, complaints, keep, kept, outcome, page, share
from scripts.mutants.subjects import Subject, Verdict, Wish, faults, subjects
from scripts.mutants.trial import trial


def main() -> int:
    """Run what is asked for. Gives the exit code."""
    told = _asked()
    known = subjects()
    if told.write or told.check:
        status = pages.kept({PAGE: page(known, kept())})
        wrong = [line for name, one in kept().items() for line in _say(known[name], one)]
        return status or int(bool(wrong))
    failed, found = False, {}
    for name in told.modules or known:
        found[name] = verdicts = _tried(known[name], told)
        result = outcome(verdicts, len(faults(known[name], Wish())))
        failed |= bool(_say(known[name], result, whole=not told.only))
        if told.keep and not told.only:
            keep(name, result)
    if told.json:
        Path(told.json).write_text(json.dumps(found, indent=1, ensure_ascii=False), encoding="utf-8")
    if told.keep:
        PAGE.write_text(page(known, kept()), encoding="utf-8")
    return int(failed)


def _tried(subject: Subject, told: argparse.Namespace) -> list[Verdict]:
    begun, voice = time.monotonic(), os.dup(sys.stderr.fileno())  # what forks is silent but for this

    def tell(text: str) -> None:
        if text:
            os.write(voice, f"  {time.monotonic() - begun:5.0f} s  {text}\n".encode())

    print(subject.name, file=sys.stderr)
    wish = Wish(
        only=told.only,
        anew=told.anew,
        tables=told.tables,
        swapped=told.swapped,
        at_once=told.jobs,
        known=_known(subject, told),
        tell=tell,
    )
    verdicts = trial(subject, wish)
    os.close(voice)
    result = outcome(verdicts, len(verdicts))
    took = time.monotonic() - begun
    print(
        f"{subject.name}: {result['noticed']} of {result['faults']} faults noticed ({share(result)}) in {took:.0f} s"
    )
    return verdicts


def _known(subject: Subject, told: argparse.Namespace) -> dict[str, str]:
    """What an earlier run has seen noticed."""
    before = json.loads(Path(told.again).read_text(encoding="utf-8")) if told.again else {}
    return {fault: by for fault, by in before.get(subject.name, ()) if by}


def _say(subject: Subject, told: dict[str, Any], *, whole: bool = True) -> list[str]:
    """Print what is wrong; of a part only what survives without a reason."""
    wrong = [line for line in complaints(subject, told) if whole or "nobody says why" in line]
    for line in wrong:
        print(line)
    return wrong


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m scripts.mutants", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("modules", nargs="*", help="names of scripts/mutants.toml; all when left out")
    parser.add_argument("--only", default="", help="a text that the name of a fault must have")
    parser.add_argument(
        "--tables", type=float, default=1.0, help="share of what happens at import, which is slow"
    )
    parser.add_argument("--anew", action="store_true", help="import the module anew for every fault")
    parser.add_argument(
        "--swapped", action="store_true", help="count what survives without a trial by a new import"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--json", default="", help="a file for every verdict")
    parser.add_argument("--again", default="", help="such a file: only what survived there is tried")
    parser.add_argument("--keep", action="store_true", help="keep the result and make the page")
    parser.add_argument("--write", action="store_true", help="make the page of what is kept")
    parser.add_argument("--check", action="store_true", help="see that the page is made of what is kept")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
