"""Pictures show the axes that were given, in the format of the file name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from motorbus import plot
from motorbus.errors import MotorbusError, RequestError

TIMES = [0.0, 0.5, 1.0]
NINE = {
    f"axis-{number}": plot.Track(
        [0.0, 0.5, 1.0], [0.0, None, 0.9], "mm" if number == 8 else "deg", estimated=number == 8
    )
    for number in range(9)
}


def test_each_axis_has_a_panel_with_its_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib as mpl

    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    plot.tracks(tmp_path / "nine.svg", TIMES, NINE, title="Bench", remark="simulated")
    text = (tmp_path / "nine.svg").read_text(encoding="utf-8")
    for number in range(8):
        assert f"axis-{number} (deg)" in text
    for word in ("axis-8 (mm), estimated", "goal", "error: present − goal", "Bench", "simulated"):
        assert word in text
    assert text.count("time (s)") == 3  # below each column


def test_a_track_may_have_times_of_its_own_and_no_reading(tmp_path: Path) -> None:
    some = {"mute": plot.Track([0.0, 1.0], [None, None], times=(0.2, 2.5)), "one": NINE["axis-0"]}
    plot.tracks(tmp_path / "some.png", TIMES, some)
    assert (tmp_path / "some.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "tracks"),
    [("x.png", {}), ("x.png", {"a": plot.Track([0.0], [0.0, 1.0, 2.0])}), ("x.jpg", NINE)],
)
def test_tracks_that_do_not_fit_and_other_formats_are_refused(
    tmp_path: Path, name: str, tracks: dict[str, plot.Track]
) -> None:
    with pytest.raises(RequestError):
        plot.tracks(tmp_path / name, TIMES, tracks)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_matplotlib_is_named_with_its_install_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    with pytest.raises(MotorbusError, match=r"pip install 'motorbus\[plot\]'"):
        plot.tracks(tmp_path / "moves.png", TIMES, NINE)
