"""A machine file that is half edited must not take the stop away: which device is on which bus is enough for one.

So it is looked at line by line, and a line that is broken costs no other. For `stop` and `estop` alone: whoever moves
something needs the limits, and so the whole file.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from motorbus.cli.exits import Partial
from motorbus.cli.machine import is_address, machine_file
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.machine import AxisSpec, BusSpec, GroupSpec, Machine
from motorbus.motion.machine.model import ADDRESS, DEVICE, NAME

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

WITHOUT: Final = "`motorbus stop FAMILY:PORT` and `motorbus estop FAMILY:PORT` need no file"
_HEAD: Final = re.compile(rf"\s*\[\s*(bus|axis|group)\.[\"']?({NAME})[\"']?\s*\]")
_KEY: Final = re.compile(r"\s*(address|device|axes)\s*=\s*(.*)")
_QUOTED: Final = re.compile(r"[\"']([^\"']+)[\"']")


@contextmanager
def forgiving(words: Collection[str]) -> Iterator[None]:
    """Within it a machine file with faults, where these words need one, is as good as what can be seen in it.

    Adds to an error what needs no file. Raises Partial where all went well: somebody may be missing in the file.
    """
    fault = seen = None
    file = machine_file()
    needed = [word for word in words if not is_address(word)]
    try:
        _ = file.machine if file.path is not None and (needed or not words) else None
    except RequestError as error:
        fault = error
        seen = _seen()
        if seen is not None:
            file.machine = seen
    try:
        yield
    except MotorbusError as error:
        if fault is not None:
            error.advice = f"{error.advice}; {WITHOUT}" if error.advice else WITHOUT
            error.add_note(f"only buses and devices were looked for in the file: {fault.summary}")
        raise
    if fault is not None and seen is not None:
        raise Partial(
            f"only those were stopped who can be seen in a file with an error: {fault.summary}",
            expected=f"all; seen were {', '.join(seen.axes)}",
            advice=WITHOUT,
        )


def _seen() -> Machine | None:
    path = machine_file().path
    assert path is not None
    try:
        found = rough(path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return found if found.axes else None


def rough(text: str) -> Machine:
    """The buses, devices and groups that can be seen in a file, whatever else is in it.

    An axis is there when its bus is, a group with those of its axes that are.
    """
    tables: dict[str, dict[str, str]] = {"bus": {}, "axis": {}, "group": {}}
    kind = name = ""
    for line in text.splitlines():
        if head := _HEAD.match(line):
            kind, name = head[1], head[2]
        elif line.lstrip().startswith("["):
            kind = ""
        elif kind and (key := _KEY.match(line)) and key[1] == _WHAT[kind]:
            tables[kind].setdefault(name, key[2])
    buses = {name: BusSpec(address=one) for name, one in _first(tables["bus"], ADDRESS).items()}
    devices = _first(tables["axis"], DEVICE)
    axes = {
        name: AxisSpec(device=one, unit="rad", max_velocity=1.0, max_acceleration=1.0)
        for name, one in devices.items()
        if one.partition("#")[0] in buses
    }
    groups = {
        name: tuple(one for one in _QUOTED.findall(said) if one in axes)
        for name, said in tables["group"].items()
    }
    return Machine(
        buses=buses, axes=axes, groups={name: GroupSpec(axes=one) for name, one in groups.items() if one}
    )


_WHAT: Final = {"bus": "address", "axis": "device", "group": "axes"}


def _first(said: dict[str, str], form: str) -> dict[str, str]:
    """What stands in quotes, where that has this form."""
    found = {name: _QUOTED.match(text) for name, text in said.items()}
    return {name: one[1] for name, one in found.items() if one is not None and re.fullmatch(form, one[1])}
