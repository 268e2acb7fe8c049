"""Pictures: they show what they were given, in the format that was asked for, and disturb nobody's figures."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from motorbus import plot
from motorbus.errors import MotorbusError, RequestError

TIMES = [0.0, 0.5, 1.0]
GOALS: list[list[float]] = [[0.0, 0.5, 1.0], [1.0, 0.5, 0.0]]
PRESENTS: list[list[float | None]] = [[0.0, 0.4, 0.9], [1.0, None, 0.1]]


def drawn(monkeypatch: pytest.MonkeyPatch, draw: Callable[[], None]) -> Any:
    """The figure that this saves."""
    from matplotlib.figure import Figure

    figures: list[Any] = []
    save = Figure.savefig

    def kept(figure: Figure, *arguments: Any, **more: Any) -> None:
        save(figure, *arguments, **more)
        figures.append(figure)

    monkeypatch.setattr(Figure, "savefig", kept)
    draw()
    return figures[0]


NINE = {
    f"axis-{number}": plot.Track(GOALS[0], PRESENTS[number % 2], "mm" if number == 8 else "deg")
    for number in range(9)
}


def test_nine_axes_have_a_panel_each_with_its_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib as mpl

    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    plot.tracks(tmp_path / "nine.svg", TIMES, NINE, title="Bench", remark="simulated")
    text = (tmp_path / "nine.svg").read_text(encoding="utf-8")
    for number in range(8):
        assert f"axis-{number} (deg)" in text
    for word in ("axis-8 (mm)", "goal", "present", "error: present − goal", "Bench", "simulated"):
        assert word in text
    assert text.count("time (s)") == 3  # below each column, and nowhere else


def test_what_is_estimated_says_so_in_another_colour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some = {
        "elbow": plot.Track(GOALS[0], PRESENTS[0], "deg"),
        "slide": plot.Track(GOALS[0], PRESENTS[0], "mm", estimated=True),
    }
    figure = drawn(monkeypatch, lambda: plot.tracks(tmp_path / "x.png", TIMES, some))
    elbow, slide, *_ = figure.axes
    assert [one.get_title(loc="left") for one in (elbow, slide)] == ["elbow (deg)", "slide (mm), estimated"]
    assert elbow.lines[0].get_color() != slide.lines[0].get_color()
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert said == ["goal", "present", "estimated: reckoned, not measured", "error: present − goal"]


def test_a_track_may_have_times_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some = {
        "elbow": plot.Track(GOALS[0], PRESENTS[0]),
        "slide": plot.Track([0.0, 1.0], [0.0, 1.0], times=(0.2, 2.5)),
    }
    figure = drawn(monkeypatch, lambda: plot.tracks(tmp_path / "x.png", TIMES, some))
    assert list(figure.axes[1].lines[0].get_xdata()) == [0.2, 2.5]
    assert {one.get_xlim() for one in figure.axes[:4]} == {(0.0, 2.5)}
    with pytest.raises(RequestError, match="do not fit"):
        plot.tracks(tmp_path / "y.png", TIMES, {"slide": plot.Track([0.0], [0.0], times=(0.2, 2.5))})


@pytest.mark.parametrize(("count", "across", "down"), [(1, 1, 1), (2, 2, 1), (4, 2, 2), (5, 3, 2), (9, 3, 3)])
def test_a_picture_grows_with_its_axes(tmp_path: Path, count: int, across: int, down: int) -> None:
    plot.tracks(tmp_path / "some.png", TIMES, dict(list(NINE.items())[:count]))
    data = (tmp_path / "some.png").read_bytes()
    size = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    assert size == (round((1.5 + 3.6 * across) * 160), round((0.9 + 2.35 * down) * 160))


def test_an_axis_that_never_answered_has_its_panel_too(tmp_path: Path) -> None:
    plot.tracks(tmp_path / "mute.png", TIMES, {"mute": plot.Track(GOALS[0], [None, None, None])})
    plot.tracks(tmp_path / "one.png", [0.0], {"one": plot.Track([1.0], [1.0], "")})
    assert (tmp_path / "mute.png").stat().st_size > 1000
    assert (tmp_path / "one.png").stat().st_size > 1000


@pytest.mark.parametrize(
    "tracks", [{}, {"a": plot.Track([0.0], [0.0, 1.0, 2.0])}, {"a": plot.Track([0.0] * 3, [])}]
)
def test_tracks_that_do_not_fit_together_are_refused(tmp_path: Path, tracks: dict[str, plot.Track]) -> None:
    with pytest.raises(RequestError, match="do not fit"):
        plot.tracks(tmp_path / "x.png", TIMES, tracks)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_matplotlib_is_named_with_its_install_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    with pytest.raises(MotorbusError, match=r"pip install 'motorbus\[plot\]'"):
        plot.tracks(tmp_path / "moves.png", TIMES, NINE)
