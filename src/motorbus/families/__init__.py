"""Discovery of families: packages in this folder, and packages named in the entry point group `motorbus.families`.

The `__init__` of a family holds `FAMILY`, see `motorbus.core.family.Family`. Its `driver` and `simulator` never
import each other. No module but the commands of a family (`families/F/cli.py`) names it.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from motorbus.core.family import Family
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "motorbus.families"


def names() -> list[str]:
    """Every family that can be loaded, built in or installed, sorted."""
    return sorted(_inside() | {point.name for point in _outside(tuple(sys.path))})


def load(name: str) -> Family:
    """The family of this name. Raises RequestError when there is none."""
    if name in _inside():
        built_in: Family = import_module(f"{__name__}.{name}").FAMILY
        return built_in
    for point in _outside(tuple(sys.path)):
        if point.name == name:
            installed: Family = point.load()
            return installed
    _outside.cache_clear()  # for a family that is installed meanwhile
    raise RequestError(
        f"there is no family {name!r}",
        expected=f"one of {', '.join(names())}",
        advice="write the bus as FAMILY:PORT, for example feetech:/dev/ttyACM0",
    )


def _inside() -> set[str]:
    return {module.name for module in iter_modules(__path__) if module.ispkg}


@cache
def _outside(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """The entry points of families that are installed in these folders, which are `sys.path`."""
    from importlib.metadata import entry_points  # 20 ms that a built-in family need not pay

    return tuple(entry_points(group=GROUP))
