"""Discovery of families, and the rule they live by.

THE RULE: a family is a folder here, or a package named by an entry point in the group `motorbus.families`. It
has four rooms, each a module or a package of that name: `wire` (what the bytes mean), `table` (what can be
addressed), `driver` (what to say to get a thing done), `simulator` (how a real one behaves). Its `__init__`
holds `FAMILY`, which fulfils `motorbus.core.family.Family`. `driver` and `simulator` never reach each other.
Nothing else in motorbus names a family. A folder here that lacks a room is not finished and passed over.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from motorbus.core.family import Family
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "motorbus.families"
ROOMS = frozenset({"wire", "table", "driver", "simulator"})


def names() -> list[str]:
    """Every family that can be loaded, built in or installed, sorted."""
    return sorted(_inside() | {point.name for point in _outside()})


def load(name: str) -> Family:
    """The family of this name. Raises RequestError when there is none."""
    if name.isidentifier() and _is_whole(name):
        return _family(import_module(f"{__name__}.{name}").FAMILY)
    for point in _outside():
        if point.name == name:
            return _family(point.load())
    raise RequestError(
        f"there is no family {name!r}",
        expected=f"one of {', '.join(names())}",
        advice="write the bus as FAMILY:PORT, for example feetech:/dev/ttyACM0",
    )


def _inside() -> set[str]:
    return {module.name for module in iter_modules(__path__) if module.ispkg and _is_whole(module.name)}


def _is_whole(name: str) -> bool:
    folders = [f"{path}/{name}" for path in __path__]
    return {module.name for module in iter_modules(folders)} >= ROOMS


def _outside() -> list[EntryPoint]:
    from importlib.metadata import entry_points  # 20 ms that a built-in family need not pay

    return list(entry_points(group=GROUP))


def _family(found: Family) -> Family:
    return found
