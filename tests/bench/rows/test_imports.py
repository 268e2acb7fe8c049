"""The import is timed alone, heavy modules are named, and no import of ours loads one."""

from __future__ import annotations

import pytest

from bench import apart
from bench.rounds import Failed
from bench.rows import imports
from bench.rows.imports import IMPORTS, OURS, SDK, USED, imported, once_opened


def test_import_motorbus_loads_no_heavy_module() -> None:
    said = imported(IMPORTS[OURS])
    assert said["heavy"] == []
    assert said["seconds"] > 0


def test_a_heavy_module_is_named() -> None:
    assert imported("import argparse")["heavy"] == ["argparse"]


def test_an_import_that_fails_is_told() -> None:
    with pytest.raises(Failed, match="import nobody"):
        imported("import nobody")


def test_a_port_that_is_opened_brings_no_more_than_asyncio() -> None:
    assert set(once_opened()) <= {"asyncio"}


def test_the_rows_are_ours_by_theirs_and_a_count(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = {OURS: 0.5, USED: 2.0, SDK: 1.0}

    def said(job: apart.Job) -> dict[str, object]:
        heavy = ["asyncio"] if job.name != SDK else ["serial"]
        return {"seconds": seconds[job.name], "modules": 60, "heavy": heavy}

    monkeypatch.setattr(imports, "quickest", said)
    monkeypatch.setattr(imports, "once_opened", lambda: ["asyncio"])
    time, used, count = imports.rows(7, lambda text: None)
    assert (time.value, time.samples, time.number) == (0.5, 7, "14")
    assert (used.value, used.goal, used.ours, used.number) == (2.0, "", 2.0, "14")
    assert time.note == "60 modules, theirs 60"
    assert (count.value, count.goal) == (1.0, "<= 0")
