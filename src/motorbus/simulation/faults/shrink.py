"""A smaller script that still fails: half of the faults are left out, then a quarter, then each one by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from motorbus.errors import RequestError
from motorbus.simulation.faults.fault import Fault
from motorbus.simulation.faults.script import Script


def shrink(script: Script, fails: Callable[[Script], bool]) -> Script:
    """The faults without which `fails` is true no more, in their order (delta debugging: Zeller and Hildebrandt, 2002).

    `fails` runs the whole case anew with the script that it is given, and must not depend on anything else; shrink what
    is by position, as `FaultyLine.record` is. Raises RequestError when the whole script does not fail.
    """
    if not fails(script):
        raise RequestError("this script does not fail, so no part of it is the reason")
    faults, size = script.faults, max(1, len(script.faults) // 2)
    while faults:
        kept = _without_some(faults, size, lambda some: fails(replace(script, faults=some)))
        if kept == faults and size == 1:
            break
        faults, size = kept, max(1, min(size // 2, len(kept) // 2))
    return replace(script, faults=faults)


def _without_some(
    faults: tuple[Fault, ...], size: int, fails: Callable[[tuple[Fault, ...]], bool]
) -> tuple[Fault, ...]:
    """Leave out one run of so many after the other, wherever it fails without them."""
    start = 0
    while start < len(faults):
        rest = faults[:start] + faults[start + size :]
        if fails(rest):
            faults = rest
        else:
            start += size
    return faults
