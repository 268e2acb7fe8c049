"""The import contracts of pyproject.toml hold, and the graph they judge is the whole package."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "src" / "motorbus"
CONFIGURATION = ROOT / "pyproject.toml"


def test_every_contract_is_kept() -> None:
    with CONFIGURATION.open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    command = [
        str(Path(sys.executable).with_name("lint-imports")),
        "--config",
        str(CONFIGURATION),
        "--no-cache",
    ]
    ended = subprocess.run(
        command, cwd=ROOT / "src", env={**os.environ, "COLUMNS": "200"}, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"{len(contracts)} kept, 0 broken" in ended.stdout


def test_the_contracts_cover_every_module() -> None:
    graph = grimp.build_graph("motorbus", cache_dir=None)
    files = {file.relative_to(SOURCES.parent).with_suffix("") for file in SOURCES.rglob("*.py")}
    assert graph.modules == {".".join(file.parts).removesuffix(".__init__") for file in files}


def test_errors_import_nothing() -> None:
    graph = grimp.build_graph("motorbus", cache_dir=None, include_external_packages=True)
    assert graph.find_modules_directly_imported_by("motorbus.errors") == {"__future__"}
