"""Pictures of axes over time. Only this file imports matplotlib, when a picture is drawn.

The Agg canvas needs no display, and no global state of matplotlib changes.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

KINDS: Final = (".png", ".svg", ".pdf")
"""Endings of the name of a picture."""
_INK: Final = "#24292f"
_FAINT: Final = "#8c959f"
_GRID: Final = "#e6e9ec"
# Distinct for readers with any colour vision, on a dark or a light page.
_PRESENT: Final = "#0072b2"
_ERROR: Final = "#d55e00"
_ESTIMATED: Final = "#009e73"


class Track(NamedTuple):
    """An axis over time: its goals and its positions in `unit`; None where there was no reading.

    `estimated`: the device has no encoder, the positions are computed. `times` (s), () for those of the picture.
    """

    goal: Sequence[float]
    present: Sequence[float | None]
    unit: str = "rad"
    estimated: bool = False
    times: Sequence[float] = ()


def tracks(
    path: Path | str,
    times: Sequence[float],
    axes: Mapping[str, Track],
    *,
    title: str = "",
    remark: str = "",
) -> None:
    """Draw a panel for each axis: goal (dashed) and position (solid), and below it the error.

    `times` in s; a track has one value for each of them, or for each of its own. The ending of `path` chooses the
    format (.png, .svg, .pdf). Raises RequestError for another ending and for data that do not fit together,
    MotorbusError when matplotlib is not installed.
    """
    if not str(path).lower().endswith(KINDS):
        raise RequestError(f"{path}: not a picture", expected=f"a name that ends in {', '.join(KINDS)}")
    moments = {name: track.times or times for name, track in axes.items()}
    if not axes or any(len(row) != len(moments[name]) for name, one in axes.items() for row in one[:2]):
        raise RequestError(
            "the data do not fit together",
            expected="at least one axis, and one goal and one position for each time",
        )
    columns = min(3, ceil(sqrt(len(axes))))
    rows = ceil(len(axes) / columns)
    figure = _figure((1.5 + 3.6 * columns, 0.9 + 2.35 * rows))
    figure.suptitle(title or " ", x=0.01, ha="left", fontsize=13, fontweight="bold", color=_INK)
    figure.text(0.99, 0.988, remark, ha="right", va="top", fontsize=11, fontstyle="italic", color=_FAINT)
    cells = figure.subplots(
        2 * rows, columns, sharex=True, squeeze=False, gridspec_kw={"height_ratios": [2.6, 1.0] * rows}
    )
    for panel in cells.flat:
        panel.set_axis_off()
    for number, (name, track) in enumerate(axes.items()):
        row, column = divmod(number, columns)
        position, error = cells[2 * row][column], cells[2 * row + 1][column]
        _draw_track(position, error, moments[name], track, name)
        if number + columns >= len(axes):
            error.tick_params(labelbottom=True)
            error.set_xlabel("time (s)", fontsize=9, color=_INK)
    _draw_key(figure, estimated=any(track.estimated for track in axes.values()))
    figure.savefig(path)


def _figure(size: tuple[float, float]) -> Any:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as missing:
        raise MotorbusError("matplotlib is not installed", advice="pip install 'motorbus[plot]'") from missing
    figure = Figure(figsize=size, dpi=160, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(h_pad=0.05, w_pad=0.1, hspace=0.02)  # type: ignore[union-attr, call-arg]
    return figure


def _draw_track(position: Any, error: Any, times: Sequence[float], track: Track, name: str) -> None:
    present = [float("nan") if value is None else value for value in track.present]
    differences = [now - goal for now, goal in zip(present, track.goal, strict=True)]
    for panel, ticks in ((position, 4), (error, 2)):
        panel.set_axis_on()
        panel.spines[["top", "right"]].set_visible(False)
        panel.spines[["left", "bottom"]].set_color(_FAINT)
        panel.tick_params(colors=_INK, labelsize=9, length=3, labelbottom=False)
        panel.grid(color=_GRID, linewidth=0.8)
        panel.set_axisbelow(True)
        panel.locator_params(axis="y", nbins=ticks)
        panel.margins(x=0, y=0.15)
    position.plot(times, present, color=_ESTIMATED if track.estimated else _PRESENT, linewidth=1.8)
    position.plot(times, track.goal, color=_INK, linewidth=1.1, dashes=(3, 2))
    heading = f"{name} ({track.unit})" if track.unit else name
    heading += ", estimated" if track.estimated else ""
    position.set_title(heading, loc="left", fontsize=10, fontweight="bold", color=_INK, pad=4)
    error.axhline(0, color=_FAINT, linewidth=0.8)
    error.plot(times, differences, color=_ERROR, linewidth=1.2)


def _draw_key(figure: Any, *, estimated: bool) -> None:
    from matplotlib.lines import Line2D

    lines = [
        Line2D([], [], color=_INK, linewidth=1.1, dashes=(3, 2), label="goal"),
        Line2D([], [], color=_PRESENT, linewidth=1.8, label="present"),
        Line2D([], [], color=_ERROR, linewidth=1.2, label="error: present − goal"),
    ]
    if estimated:
        lines.append(Line2D([], [], color=_ESTIMATED, linewidth=1.8, label="estimated, not measured"))
    figure.legend(
        handles=lines,
        loc="outside lower center",
        ncols=len(lines),
        frameon=False,
        fontsize=9,
        labelcolor=_INK,
    )
