"""What has been found out about one controller: a file that says how it reads what its manual leaves open.

A simulator and an estimate choose a reading for every open question. This is where a real device has answered some of
them: each answer with the experiment it rests on, what was measured besides, and what is still open and why. An answer
that no experiment has separated from all others is not in it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from math import isfinite
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from motorbus.core.register import shown
from motorbus.families.stepper.execution import USUAL, Behaviour
from motorbus.families.stepper.program.quantities import refuse
from motorbus.families.stepper.program.source import FORMAT, check_format, read, toml

"""Characters a file may have."""
Setting: TypeAlias = str | bool | float
MEMORY: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "select": ("load", "relabel"),
        "read_view": ("working", "stored"),
        "save_cross": ("warn", "refuse", "allow"),
        "dump_order": ("little", "big"),
        "save_cut": ("old", "empty"),
    }
)
"""Open questions about its memory, by the names that the simulator has for them, and what may be."""
MEASURED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "tick_ms": "ms in which the frequency grows by the acceleration",
        "overhead": "s from the acknowledgement of a start to the notice of the end, beyond what the project takes",
        "turnaround": "s from the end of a request to the beginning of its reply",
        "clock": "s on this host for each second of the controller",
    }
)
"""What may have been measured, and what it is."""
_TABLES: Final = ("settled", "evidence", "measured", "open")
_EXECUTION: Final = {one.name: one for one in fields(Behaviour)}
KNOWN: Final = (*_EXECUTION, *MEMORY)
"""Every open question that a profile may answer."""
_NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """How one controller reads what is left open.

    `settled`   the reading, by the name of the question
    `evidence`  what each of these answers rests on, in words
    `measured`  figures by their names in `MEASURED`
    `open`      why a question has no answer, by its name
    """

    settled: Mapping[str, Setting] = field(default_factory=lambda: _NOTHING)
    evidence: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    measured: Mapping[str, float] = field(default_factory=lambda: _NOTHING)
    open: Mapping[str, str] = field(default_factory=lambda: _NOTHING)

    @classmethod
    def parse(cls, source: str) -> Profile:
        """From the text of a file. Raises RequestError, naming the field, for what cannot be."""
        data = toml(source, "TOML, as `characterise` writes it")
        check_format(data)
        _only(data, ("format", *_TABLES), "the file")
        settled, evidence, measured, unsettled = (_table(data, name) for name in _TABLES)
        made = cls(
            settled={name: _setting(name, value) for name, value in settled.items()},
            evidence={name: _words("evidence", name, value) for name, value in evidence.items()},
            measured={name: _figure(name, value) for name, value in measured.items()},
            open={name: _words("open", name, value) for name, value in unsettled.items()},
        )
        made._check()
        return made

    @classmethod
    def load(cls, path: str) -> Profile:
        """From a file. Raises RequestError when it cannot be read, and for what it says."""
        return cls.parse(read(path))

    def text(self) -> str:
        """The file: what `parse` makes the same profile of."""
        lines = [f"format = {FORMAT}"]
        for name in _TABLES:
            table: Mapping[str, Any] = getattr(self, name)
            if table:
                lines += ["", f"[{name}]", *(f"{key} = {_written(value)}" for key, value in table.items())]
        return "\n".join(lines) + "\n"

    def behaviour(self, base: Behaviour = USUAL) -> Behaviour:
        """How it carries projects out: what is settled, and for the rest `base`."""
        found: dict[str, Any] = {name: value for name, value in self.settled.items() if name in _EXECUTION}
        return replace(base, **found)

    @property
    def settles_acceleration(self) -> bool:
        """Whether it says per what the frequency grows, so that an estimate has no other readings."""
        ramp = self.settled.get("ramp")
        return ramp == "pulse" or (ramp == "time" and "ramp_tick_ms" in self.settled)

    def options(self) -> dict[str, Setting]:
        """The settled questions as options of a simulated controller that reads them alike."""
        return dict(self.settled)

    def _check(self) -> None:
        for name in self.settled:
            if name in self.open:
                raise refuse(f"open, {name}: it is settled too", "a question in one of the two tables")
        for name in self.evidence:
            if name not in self.settled:
                raise refuse(f"evidence, {name}: it is not settled", "evidence for what is settled")


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = data.get(name, {})
    if not isinstance(found, dict):
        raise refuse(f"{name}: {shown(found)} is no table", f"[{name}], then one line for each field")
    _only(found, tuple(MEASURED) if name == "measured" else KNOWN, name)
    return found


def _only(table: Mapping[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in keys:
            near = get_close_matches(key, keys, n=1)
            hint = f"perhaps {near[0]}; " if near else ""
            raise refuse(f"{where}: there is no field {shown(key)}", f"{hint}one of {', '.join(keys)}")


def _setting(name: str, value: object) -> Setting:
    where = f"settled, {name}"
    if name in _EXECUTION and isinstance(_EXECUTION[name].default, bool):
        if isinstance(value, bool):
            return value
        raise refuse(f"{where}: {shown(value)} is neither", "true or false")
    if name in _EXECUTION and not _EXECUTION[name].metadata["choices"]:
        low, high = _EXECUTION[name].metadata["span"]
        number = _number(where, value)
        if low <= number <= high:
            return number
        raise refuse(f"{where}: {shown(value)} is not possible", f"{low:g} to {high:g}")
    choices = MEMORY[name] if name in MEMORY else _EXECUTION[name].metadata["choices"]
    if isinstance(value, str) and value in choices:
        return value
    raise refuse(f"{where}: {shown(value)} is not possible", f"one of {', '.join(choices)}")


def _figure(name: str, value: object) -> float:
    return _number(f"measured, {name}", value)


def _number(where: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise refuse(f"{where}: {shown(value)} is no number", "a finite number")
    return float(value)


def _words(table: str, name: str, value: object) -> str:
    if isinstance(value, str):
        return value
    raise refuse(f"{table}, {name}: {shown(value)} is no text", "text in quotes")


def _written(value: Setting) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))
