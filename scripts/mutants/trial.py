"""The trial of one module: faults in functions first, then those that take a new import and those that survived."""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Callable
from typing import Any

from scripts.mutants.forks import each
from scripts.mutants.inside import Anew, Gathered, Order, Seen, progress
from scripts.mutants.subjects import Fault, Subject, Verdict, Wish, faults

LONG = 36_000.0
"""s that the process may last that forks for each fault."""


def trial(subject: Subject, wish: Wish) -> list[Verdict]:
    """A verdict on every fault. Raises RuntimeError when a test fails without any."""
    everything = faults(subject, wish)
    before = [Verdict(one.name, wish.known[one.name]) for one in everything if one.name in wish.known]
    told = [one for one in everything if one.name not in wish.known]
    with tempfile.TemporaryDirectory(dir=_memory()) as scratch:
        swapped = [one for one in told if one.mutant.swapped and not wish.anew]
        seen, found = _alone(lambda: Gathered(subject, wish, scratch).judge(swapped))
        _import_others(seen)
        noticed = [one for one in found if one.by]
        found = noticed + _anew(subject, told, noticed, seen, wish, scratch)
    order = {one.name: at for at, one in enumerate(everything)}
    return sorted(before + found, key=lambda verdict: order[verdict.fault])


def _anew(
    subject: Subject, told: list[Fault], noticed: list[Verdict], seen: Seen, wish: Wish, scratch: str
) -> list[Verdict]:
    """Those that nobody has noticed yet, each with its module imported anew; one with a reason has had its trial."""
    order = Order(subject, seen)
    file_of = {one.name: one.file for one in told}
    for one in noticed:
        order.noticed(file_of[one.fault], one.by)
    done = {one.fault for one in noticed}
    left = [one for one in told if one.name not in done]
    explained = {
        one.name for one in left if one.mutant.swapped and (wish.swapped or one.name in subject.reasons)
    }
    todo = [one for one in left if order.of(one) and one.name not in explained]
    due = {one.name for one in todo}
    found = [Verdict(one.name, "") for one in left if one.name not in due]
    wish.tell(f"{len(todo)} with a new import, {len(found)} that no fast test runs or that have a reason")

    def work(fault: Fault) -> str:
        return Anew(fault, order, scratch).judge()

    tried: list[Verdict] = []
    for fault, by in each(todo, work, order.limit + 3, wish.at_once):
        tried.append(Verdict(fault.name, "time" if by is None else by))
        order.noticed(fault.file, tried[-1].by)
        wish.tell(progress(tried, len(todo)))
    return found + tried


def _memory() -> str | None:
    """A folder where waiting for the disk costs nothing, where there is one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _alone(work: Callable[[], Any]) -> Any:
    """The result of this, done in a child. Raises RuntimeError for what hindered it."""
    ((_, said),) = each([work], lambda work: work(), LONG, at_once=1)
    if not said or isinstance(said, str):
        raise RuntimeError(said or "the tests could not be run")
    return said


def _import_others(seen: Seen) -> None:
    """What is not of this project is imported once, for all children."""
    for name in seen.others:
        try:
            importlib.import_module(name)
        except Exception:  # a module that was there in passing
            continue
