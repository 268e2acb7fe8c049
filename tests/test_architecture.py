"""The rules of docs/explanation/architecture.md run with the tests, and each of them is shown to bite.

import-linter reads the contracts from pyproject.toml. A contract that cannot fail is a wish, so every one of them
is also run over a copy of the sources into which one offence has been written.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "src" / "motorbus"
CONFIGURATION = ROOT / "pyproject.toml"
FLOORS_0_TO_2 = ("errors.py", "core", "link", "bus", "families")
# The one foreign package that each of these files below floor 3 may import; no other file any.
FOREIGN_BELOW_FLOOR_3 = {"link/serial.py": {"serialx"}, "link/can.py": {"can"}}

# contract -> offences; an offence is a set of files (below motorbus/) and the line each of them gains
OFFENCES: dict[str, list[dict[str, str]]] = {
    "floors": [
        {"core/offence.py": "import motorbus.link.base"},
        {"errors.py": "import motorbus.core.operation"},
        {"link/offence.py": "import motorbus.families"},
        {"families/offence.py": "import motorbus.bus"},
        {"bus/offence.py": "import motorbus.families"},
        {"families/feetech/offence.py": "import motorbus.cli"},
        {"plot.py": "import motorbus.cli.output"},
        {"attic.py": "import motorbus.errors"},
        {"diagnose/offence.py": "import motorbus.cli.output"},
        {"bus/offence.py": "import motorbus.diagnose.budget"},
    ],
    "families-import-core-and-errors": [
        {"families/feetech/offence.py": "from motorbus.link.base import PerfectLine"},
        {"families/offence.py": "from motorbus.bus import trace"},
    ],
    "families-are-independent": [
        {"families/other/__init__.py": "import motorbus.families.feetech.wire"},
        {"families/other/__init__.py": "", "families/feetech/offence.py": "import motorbus.families.other"},
    ],
    "driver-and-simulator": [
        {"families/feetech/driver/offence.py": "import motorbus.families.feetech.simulator"},
        {"families/feetech/simulator/offence.py": "import motorbus.families.feetech.driver"},
        {
            "families/feetech/driver/offence.py": "import motorbus.families.feetech.third",
            "families/feetech/third.py": "import motorbus.families.feetech.simulator",
        },
        {
            "families/feetech/simulator/offence.py": "import motorbus.families.feetech.third",
            "families/feetech/third.py": "import motorbus.families.feetech.driver",
        },
    ],
    "no-io-no-clock": [
        {"families/feetech/offence.py": "import time"},
        {"families/feetech/offence.py": "def late() -> None:\n    import asyncio"},
        {"core/offence.py": "from threading import Lock"},
    ],
    "standard-library-below-floor-3": [
        {"bus/offence.py": "import msgspec"},
        {"core/offence.py": "import numpy"},
        {"link/offence.py": "import serialx"},
        {"bus/offence.py": "import can"},
        {"core/offence.py": "import tomlkit"},
    ],
    "serialx-in-one-file": [{"cli/offence.py": "import serialx"}],
    "python-can-in-one-file": [
        {"link/can_config.py": "import can"},
        {"cli/offence.py": "from can import Message"},
    ],
    "matplotlib-in-one-file": [{"cli/offence.py": "from matplotlib import pyplot"}],
    "numpy-in-one-file": [{"recorder/decoder.py": "import numpy"}, {"plot.py": "import numpy"}],
    "tomlkit-in-one-file": [{"motion/machine/reading.py": "import tomlkit"}],
    "ruckig-in-one-file": [{"motion/profile/following.py": "import ruckig"}],
    "nothing-names-a-family": [
        {"cli/offence.py": "from motorbus.families import feetech"},
        {"cli/offence.py": "from motorbus.families.feetech.table import TABLES"},
    ],
}


def contracts() -> list[str]:
    with CONFIGURATION.open("rb") as file:
        return [contract["id"] for contract in tomllib.load(file)["tool"]["importlinter"]["contracts"]]


def lint(sources: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the contracts over the package below `sources`."""
    command = [
        str(Path(sys.executable).with_name("lint-imports")),
        "--config",
        str(CONFIGURATION),
        "--no-cache",
    ]
    return subprocess.run(
        [*command, *arguments],
        cwd=sources,
        env={**os.environ, "PYTHONPATH": str(sources), "COLUMNS": "200"},
        capture_output=True,
        text=True,
    )


def offend(folder: Path, offence: dict[str, str]) -> Path:
    """A copy of the sources with these lines added."""
    sources = folder / "src"
    shutil.copytree(SOURCES, sources / "motorbus", ignore=shutil.ignore_patterns("__pycache__"))
    for name, line in offence.items():
        file = sources / "motorbus" / name
        file.parent.mkdir(exist_ok=True, parents=True)
        before = file.read_text(encoding="utf-8") if file.exists() else ""
        file.write_text(f"{before}\n{line}\n", encoding="utf-8")
    return sources


def test_every_contract_is_kept() -> None:
    ended = lint(ROOT / "src")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"{len(contracts())} kept, 0 broken" in ended.stdout


def test_every_contract_has_an_offence() -> None:
    assert sorted(OFFENCES) == sorted(contracts())


@pytest.mark.parametrize(
    ("contract", "offence"),
    [
        pytest.param(contract, offence, id=f"{contract}-{number}")
        for contract, offences in OFFENCES.items()
        for number, offence in enumerate(offences)
    ],
)
def test_a_contract_bites(contract: str, offence: dict[str, str], tmp_path: Path) -> None:
    ended = lint(offend(tmp_path, offence), "--contract", contract)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert "0 kept, 1 broken" in ended.stdout


def files_of_the_lower_floors() -> list[Path]:
    found = [SOURCES / name for name in FLOORS_0_TO_2]
    return sorted(file for path in found for file in ([path] if path.is_file() else path.rglob("*.py")))


def imported(file: Path) -> set[str]:
    """Top-level names of every package a file imports, at any depth of its code."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
    return names


def test_nothing_foreign_is_imported_below_floor_3() -> None:
    known = {*sys.stdlib_module_names, "motorbus"}
    foreign = {
        str(file.relative_to(SOURCES)): names
        for file in files_of_the_lower_floors()
        if (names := imported(file) - known)
    }
    assert foreign == {name: names for name, names in FOREIGN_BELOW_FLOOR_3.items() if name in foreign}


def test_errors_import_nothing() -> None:
    assert imported(SOURCES / "errors.py") == {"__future__"}


def test_only_faces_import_the_package_itself() -> None:
    graph = grimp.build_graph("motorbus", cache_dir=None)
    importers = graph.find_modules_that_directly_import("motorbus")
    assert {name.split(".")[1] for name in importers} <= {"cli", "web", "gateway"}


def test_the_graph_that_is_judged_is_the_whole_package() -> None:
    graph = grimp.build_graph("motorbus", cache_dir=None)
    files = {file.relative_to(SOURCES.parent).with_suffix("") for file in SOURCES.rglob("*.py")}
    expected = {".".join(file.parts).removesuffix(".__init__") for file in files}
    assert graph.modules == expected
