"""The commands of this family are there as if it were whole: until it has a driver, discovery passes it over."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.cli import faces

EXAMPLE = str(Path(__file__).resolve().parents[3] / "examples" / "pick_and_place.toml")


@pytest.fixture(autouse=True)
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """The face of this family beside the others."""
    names = sorted({*faces.names(), "stepper"})
    monkeypatch.setattr(faces, "names", lambda: names)
