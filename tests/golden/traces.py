"""The recorded traces: one JSON line each, in the order of the catalogue."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.golden.catalogue import CASES
from tests.golden.recording import trace

FOLDER = Path(__file__).parent


def load(family: str) -> dict[str, dict[str, Any]]:
    """The recorded traces of a family by id."""
    lines = (FOLDER / f"{family}.jsonl").read_text(encoding="utf-8").splitlines()
    return {one["id"]: one for one in map(json.loads, lines)}


def write(family: str) -> int:
    """Record every case of a family; give how many."""
    traces = [trace(case) for case in CASES if case.family == family]
    lines = [json.dumps(one, ensure_ascii=False, separators=(",", ":")) + "\n" for one in traces]
    (FOLDER / f"{family}.jsonl").write_text("".join(lines), encoding="utf-8")
    return len(traces)
