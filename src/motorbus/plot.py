"""Pictures from plain data. The only file that imports matplotlib, and only when a picture is asked for.

It draws with the Agg canvas and no global state, so it needs no display and disturbs nobody's figures.
"""

from __future__ import annotations

from itertools import product
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

KINDS: Final = (".png", ".svg", ".pdf")
"""How the name of a picture may end."""
_INK: Final = "#24292f"
_FAINT: Final = "#8c959f"
_GRID: Final = "#e6e9ec"
_SHADE: Final = "#eceff2"
# Told apart by readers with any colour vision, and on a dark or a light page.
_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_MISSING: Final = "matplotlib is not installed, so no picture can be drawn"


def _saved(figure: Any, path: Path | str) -> None:
    """Write the picture. Raises RequestError for a name that does not say which kind of picture it shall be."""
    if not str(path).lower().endswith(KINDS):
        raise RequestError(
            f"{path}: what kind of picture shall that be?",
            expected=f"a name that ends in {', '.join(KINDS)}",
            advice="nothing was drawn",
        )
    figure.savefig(path)


class Track(NamedTuple):
    """An axis over time: its goals and where it was, in `unit`; None where there was no reading.

    `estimated`: where it was is reckoned, for its device tells no position. `times` (s) are its own moments, () for
    those of the picture.
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
    spans: Sequence[Span] = (),
    title: str = "",
    remark: str = "",
) -> None:
    """Draw each axis of a machine in a panel of its own: goal (dashed) and present (solid), and below it the error.

    `times` in s, and every track has one value for each of them, or for each of its own. Units may differ from axis to
    axis, as an arm has degrees and a slide millimetres. What is estimated has another colour, and says so. `spans` are
    shaded in every panel and named below. The suffix of `path` chooses the format (.png, .svg, .pdf). Raises
    RequestError when the data do not fit together and MotorbusError when matplotlib is not installed.
    """
    moments = {name: track.times or times for name, track in axes.items()}
    if not axes or any(len(row) != len(moments[name]) for name, one in axes.items() for row in one[:2]):
        raise RequestError(
            "the data do not fit together",
            expected="at least one axis, and one goal and one present for each time",
        )
    ends = [at for one in moments.values() for at in (*one[:1], *one[-1:])]
    across = min(3, ceil(sqrt(len(axes))))
    down = -(-len(axes) // across)
    figure = _blank(title, remark, (1.5 + 3.6 * across, 0.9 + 2.35 * down))
    heights = {"height_ratios": [2.6, 1.0] * down}
    cells = figure.subplots(2 * down, across, sharex=True, squeeze=False, gridspec_kw=heights)
    for number in range(down * across):
        row, column = divmod(number, across)
        pair = cells[2 * row][column], cells[2 * row + 1][column]
        if number < len(axes):
            name = list(axes)[number]
            _draw_track(*pair, moments[name], axes[name], name, lowest=number + across >= len(axes))
            for panel, span in product(pair, spans):
                panel.axvspan(span.begin, span.end, facecolor=_SHADE, edgecolor="none", zorder=0)
            if min(ends) < max(ends):
                pair[0].set_xlim(min(ends), max(ends))
        else:
            for empty in pair:
                empty.set_axis_off()
    _draw_key(figure, spans, estimated=any(track.estimated for track in axes.values()))
    _saved(figure, path)


def _draw_track(
    position: Any, error: Any, times: Sequence[float], track: Track, name: str, *, lowest: bool
) -> None:
    present = [float("nan") if value is None else value for value in track.present]
    apart = [was - goal for was, goal in zip(present, track.goal, strict=True)]
    for one in (position, error):
        _style(one)
        one.locator_params(axis="y", nbins=4 if one is position else 2)
        one.margins(y=0.15)
    position.plot(times, present, color=_COLOURS[2 if track.estimated else 0], linewidth=1.8)
    position.plot(times, track.goal, color=_INK, linewidth=1.1, dashes=(3, 2))
    heading = f"{name} ({track.unit})" if track.unit else name
    heading += ", estimated" if track.estimated else ""
    position.set_title(heading, loc="left", fontsize=10, fontweight="bold", color=_INK, pad=4)
    position.tick_params(labelbottom=False)
    error.axhline(0, color=_FAINT, linewidth=0.8)
    error.plot(times, apart, color=_COLOURS[1], linewidth=1.2)
    error.tick_params(labelbottom=lowest)
    if lowest:
        error.set_xlabel("time (s)", fontsize=9, color=_INK)


def _draw_key(figure: Any, spans: Sequence[Span], *, estimated: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    reckoned = [Line2D([], [], color=_COLOURS[2], linewidth=1.8, label="estimated: reckoned, not measured")]
    lines = [
        Line2D([], [], color=_INK, linewidth=1.1, dashes=(3, 2), label="goal"),
        Line2D([], [], color=_COLOURS[0], linewidth=1.8, label="present"),
        *(reckoned if estimated else []),
        Line2D([], [], color=_COLOURS[1], linewidth=1.2, label="error: present − goal"),
        *(
            Patch(facecolor=_SHADE, edgecolor="none", label=name)
            for name in dict.fromkeys(span.name for span in spans)
        ),
    ]
    figure.legend(
        handles=lines,
        loc="outside lower center",
        ncols=len(lines),
        frameon=False,
        fontsize=9,
        labelcolor=_INK,
    )


class Span(NamedTuple):
    """A stretch of time with a name."""

    begin: float
    end: float
    name: str


def _blank(title: str, remark: str, size: tuple[float, float]) -> Any:
    """A page for panels of their own, with the words above them all."""
    figure = _canvas(size)
    figure.get_layout_engine().set(h_pad=0.05, w_pad=0.1, hspace=0.02)
    figure.suptitle(title or " ", x=0.01, ha="left", fontsize=13, fontweight="bold", color=_INK)
    figure.text(0.99, 0.988, remark, ha="right", va="top", fontsize=11, fontstyle="italic", color=_FAINT)
    return figure


def _canvas(size: tuple[float, float]) -> Any:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as missing:
        raise MotorbusError(_MISSING, advice="pip install 'motorbus[plot]'") from missing
    figure = Figure(figsize=size, dpi=160, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _style(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(_FAINT)
    axes.tick_params(colors=_INK, labelsize=9, length=3)
    axes.grid(color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
