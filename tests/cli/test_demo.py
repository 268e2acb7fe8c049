"""The demo: nine axes on three buses move together, and are drawn with goal and present position."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.conftest import Run


def test_nine_axes_move_together_and_are_drawn(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib as mpl

    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    picture = tmp_path / "demo.svg"
    ran = run("demo", "--output", str(picture), "--json")
    assert ran.code == 0, ran.err
    assert ran.document["simulated"] is True
    for movement in ran.document["movements"]:
        assert len(movement["axes"]) == 9
        for one in movement["axes"].values():
            assert one["present"] == pytest.approx(one["goal"], abs=0.02)
    shown = re.findall(r">([^<>]+)</text>", picture.read_text(encoding="utf-8"))
    assert sum(text.endswith("(deg)") for text in shown) == 8
    assert {"slide (mm), estimated", "goal", "present", "simulated"} <= set(shown)


@pytest.mark.parametrize("path", ["no/such/folder.png", "picture.txt", "."])
def test_a_picture_that_cannot_be_written_is_refused(path: str, run: Run) -> None:
    ran = run("demo", "--output", path)
    assert (ran.code, ran.out) == (2, "")
