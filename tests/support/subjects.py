"""Which families are judged here, with which simulated devices, and where their vectors lie.

Every family that discovery finds, and the template, which is out of tree and is loaded from its folder as its own
pyproject says, without being installed. So a family that is installed beside motorbus is tested as well. A family
that has several register maps and a simulated device of each (subjects.toml says which) is a subject once
for each of them: what is true of one map only is not true of the family.
"""

from __future__ import annotations

import json
import sys
import tomllib
from dataclasses import dataclass, fields
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, NamedTuple

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import BusDriver, Family, Simulator
from motorbus.core.register import RegisterMap
from motorbus.core.request import Data

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE = ROOT / "examples" / "family_template"
VECTORS = ROOT / "tests" / "vectors"
KINDS = tomllib.loads(Path(__file__).with_name("subjects.toml").read_text(encoding="utf-8"))


class Vector(NamedTuple):
    """A frame whose meaning is known from outside this project."""

    id: str
    data: Data
    direction: str
    valid: bool
    source: str


def template_entry_points() -> list[EntryPoint]:
    """The families that the template's own pyproject declares."""
    with (TEMPLATE / "pyproject.toml").open("rb") as file:
        declared = tomllib.load(file)["project"]["entry-points"][families.GROUP]
    return [EntryPoint(name, value, families.GROUP) for name, value in declared.items()]


def _found() -> dict[str, tuple[Family, str]]:
    if str(TEMPLATE) not in sys.path:
        sys.path.insert(0, str(TEMPLATE))
    outside = {point.name: point for point in (*template_entry_points(), *entry_points(group=families.GROUP))}
    found = {name: (point.load(), point.module) for name, point in outside.items()}
    for name in set(families.names()) - set(outside):
        found[name] = families.load(name), f"motorbus.families.{name}"
    return found


_FOUND = _found()

FAMILIES: dict[str, Family] = {name: family for name, (family, _) in sorted(_FOUND.items())}
"""Every family that is judged, by name."""
PACKAGES: dict[str, str] = {name: package for name, (_, package) in _FOUND.items()}
"""The package that each comes from."""


class Line(NamedTuple):
    """What is peculiar to the line of a family, as subjects.toml says; else it is as here.

    `devices`   how many a line can hold; 0: as many as there are ids
    `probes`    how many probes there are whose replies differ
    `checksum`  whether a damaged reply can be recognised by itself; where not, its exchange checks the reply
    `writes`    whether its devices are written by name
    """

    devices: int = 0
    probes: int = 16
    checksum: bool = True
    writes: bool = True


def _line(name: str) -> Line:
    return Line(**KINDS.get(name, {}).get("line", {}))


LINES: dict[str, Line] = {name: _line(name) for name in FAMILIES}
"""By the name of the family."""


def line_of(family: Family) -> Line:
    """What is peculiar to the line of this family."""
    return LINES[family.name]


def possible(family: Family, ids: tuple[int, ...]) -> tuple[int, ...]:
    """These ids, or where a line holds fewer devices than that, theirs, which count from 1."""
    most = line_of(family).devices
    return tuple(range(1, most + 1)) if most and len(ids) >= most else ids


@dataclass(frozen=True, kw_only=True, eq=False)
class _Kind(Family):
    """A family whose simulated devices all have one register map; `options` of its simulator say which."""

    options: dict[str, str]

    def open(self, **settings: object) -> BusDriver:
        names = {option.name for option in self.link.settings}
        own = {name: value for name, value in self.options.items() if name in names}
        return super().open(**{**own, **settings})

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        chosen: dict[str, Any] = {**self.options, **options}
        return super().simulator(ids, **(chosen | ({"model": model} if model else {})))


def _kind(family: Family, key: str, options: dict[str, str]) -> Family:
    facts = {one.name: getattr(family, one.name) for one in fields(family)}
    return _Kind(**{**facts, "registers": {key: family.registers[key]}, "options": options})


def _kinds(name: str, family: Family) -> dict[str, Family]:
    """One for each map that simulated devices have; the family itself where options make no difference."""
    maps = KINDS.get(name, {}).get("maps", {})
    if len(maps) < 2:
        return {name: family}
    return {f"{name}-{key}": _kind(family, key, options) for key, options in maps.items()}


SUBJECTS: dict[str, Family] = {
    key: subject for name, family in FAMILIES.items() for key, subject in _kinds(name, family).items()
}
"""Every family with every kind of simulated device it has, by a name for eyes."""


def tables_of(subject: Family) -> list[RegisterMap]:
    """The tables that its simulated devices can have."""
    return list(subject.registers.values())


def vectors(name: str) -> list[Vector]:
    """In tests/vectors/FAMILY, or in a folder `vectors` beside the package of a family from outside."""
    package = import_module(PACKAGES[name])
    beside = Path(str(package.__file__)).parents[1] / "vectors"
    files = [file for folder in (VECTORS / name, beside) for file in sorted(folder.glob("*.json"))]
    return [_vector(one) for file in files for one in json.loads(file.read_text(encoding="utf-8"))]


def _vector(one: dict[str, Any]) -> Vector:
    data = bytes.fromhex(one["hex"])
    if "can_id" in one:
        identifier = int(one["can_id"], 16)
        frame = CanFrame(identifier, data, extended=identifier > 0x7FF)
        return Vector(one["id"], frame, one["direction"], one["verdict"] == "valid", one["source"])
    return Vector(one["id"], data, one["direction"], one["verdict"] == "valid", one["source"])


def payload(data: Data) -> bytes:
    """What a receiver's event holds of it: the whole frame, or the data field of a CAN frame."""
    return data.data if isinstance(data, CanFrame) else data
