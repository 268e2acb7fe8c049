"""Pictures from plain data. The only file that imports matplotlib, and only when a picture is asked for.

It draws with the Agg canvas and no global state, so it needs no display and disturbs nobody's figures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_INK: Final = "#24292f"
_FAINT: Final = "#8c959f"
_GRID: Final = "#e6e9ec"
# Told apart by readers with any colour vision, and on a dark or a light page.
_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_MISSING: Final = "matplotlib is not installed, so no picture can be drawn"


def trajectory(
    path: Path | str,
    times: Sequence[float],
    goals: Sequence[Sequence[float]],
    presents: Sequence[Sequence[float | None]],
    names: Sequence[str],
    *,
    title: str = "",
    simulated: bool = False,
) -> None:
    """Draw goal (dashed) and present (solid) positions of some axes over time, and how far they are apart.

    `times` in s; `goals` and `presents` in rad, one sequence for each name and one value for each time, None
    where there was no reading. The suffix of `path` chooses the format (.png, .svg, .pdf). Raises RequestError
    when the data do not fit together and MotorbusError when matplotlib is not installed.
    """
    if not len(goals) == len(presents) == len(names) or any(
        len(row) != len(times) for row in (*goals, *presents)
    ):
        raise RequestError(
            "the data do not fit together",
            expected="one sequence of goals and of presents for each name, one value for each time",
        )
    figure, (position, error) = _sheet(title, simulated)
    for index, name in enumerate(names):
        colour = _COLOURS[index % len(_COLOURS)]
        present = [float("nan") if value is None else value for value in presents[index]]
        position.plot(times, goals[index], color=colour, linewidth=1.1, dashes=(3, 2), alpha=0.9)
        position.plot(times, present, color=colour, linewidth=1.8, label=name)
        apart = [was - goal for was, goal in zip(present, goals[index], strict=True)]
        error.plot(times, apart, color=colour, linewidth=1.2)
    _finish(position, error, times)
    figure.savefig(path)


def _sheet(title: str, simulated: bool) -> tuple[Any, Any]:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as missing:
        raise MotorbusError(_MISSING, advice="pip install 'motorbus[plot]'") from missing
    figure = Figure(figsize=(9.0, 5.2), dpi=160, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1]})
    for one in axes:
        _style(one)
    axes[0].set_title(title, loc="left", fontsize=13, fontweight="bold", color=_INK, pad=12)
    if simulated:
        axes[0].set_title("simulated", loc="right", fontsize=11, fontstyle="italic", color=_FAINT, pad=12)
    return figure, axes


def _style(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(_FAINT)
    axes.tick_params(colors=_INK, labelsize=9, length=3)
    axes.grid(color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)


def _finish(position: Any, error: Any, times: Sequence[float]) -> None:
    position.set_ylabel("position (rad)", fontsize=10, color=_INK)
    error.set_ylabel("present − goal\n(rad)", fontsize=10, color=_INK)
    error.set_xlabel("time (s)", fontsize=10, color=_INK)
    error.axhline(0, color=_FAINT, linewidth=0.8)
    error.margins(y=0.15)
    if len(times) > 1:
        error.set_xlim(times[0], times[-1])
    present = [line for line in position.lines if not line.get_label().startswith("_")]
    goal = position.plot([], [], color=_INK, linewidth=1.1, dashes=(3, 2), label="goal")
    solid = position.plot([], [], color=_INK, linewidth=1.8, label="present")
    position.legend(
        handles=[*goal, *solid, *present],
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        frameon=False,
        fontsize=9,
        labelcolor=_INK,
    )
