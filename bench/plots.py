"""The two pictures of the page: how cost grows with the number of servos, and every row beside its goal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.growth import MEMORY, WIRE, Point
from bench.row import Row, called, limit, met, shown

INK, FAINT, GRID = "#24292f", "#8c959f", "#e6e9ec"
MET, MISSED = "#0072b2", "#d55e00"
COLOURS = {
    "motorbus": "#0072b2",
    "rustypot": "#d55e00",
    "feetech-servo-sdk": "#009e73",
    "feetech-cli": "#cc79a7",
}
TITLES = {MEMORY: "In process", WIRE: "Processor time on a pseudo-terminal"}


def growth(path: Path, points: Sequence[Point]) -> None:
    """Microseconds against servos, both logarithmic, one panel for each place."""
    figure, axes = _sheet(10.5, 4.4, columns=2)
    for panel, place in zip(axes, (MEMORY, WIRE), strict=True):
        here = [point for point in points if point.place == place]
        for name in dict.fromkeys(point.contender for point in here):
            line = sorted(
                (point for point in here if point.contender == name), key=lambda point: point.servos
            )
            panel.plot(
                [point.servos for point in line],
                [point.seconds.median * 1e6 for point in line],
                color=COLOURS.get(name, INK),
                marker="o",
                markersize=4,
                linewidth=2 if name == "motorbus" else 1.3,
                label=name,
            )
        panel.set_xscale("log", base=2)
        panel.set_yscale("log")
        ticks = (1, 2, 4, 8, 16, 32, 64, 128, 253)
        panel.set_xticks(ticks, [str(tick) for tick in ticks])
        panel.yaxis.set_major_formatter(lambda value, place: f"{value:g}")
        panel.set_xlabel("servos, positions by SYNC READ; above 240 in two packets")
        panel.set_title(TITLES[place], loc="left", color=INK)
        panel.legend(frameon=False)
    axes[0].set_ylabel("processor time, µs")
    figure.savefig(path, dpi=130)


def goals(path: Path, rows: Sequence[Row]) -> None:
    """How far each figure is from its goal, as a factor; left of 1 is better, the line is from least to greatest.

    A row without a goal is not in it.
    """
    rows = [row for row in rows if row.goal]
    figure, axes = _sheet(10.5, 1.2 + 0.3 * len(rows), columns=1)
    panel = axes[0]
    for place, row in enumerate(rows):
        colour = MET if met(row) else MISSED
        low, here, high = (_factor(value, row.goal) for value in (row.least, row.value, row.greatest))
        panel.plot([low, high], [place, place], color=colour, linewidth=1.5, alpha=0.5)
        panel.plot([here], [place], color=colour, marker="o", markersize=6)
        if row.stretch:
            panel.plot(
                [_factor(limit(row.stretch)[1], row.goal)], [place], color=FAINT, marker="|", markersize=11
            )
    panel.axvline(1, color=INK, linewidth=1)
    panel.set_xscale("log")
    panel.set_yticks(range(len(rows)), [_label(row) for row in rows], fontsize=8)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    ticks = (0.1, 0.2, 0.5, 1, 2, 5, 10)
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.minorticks_off()
    low, high = panel.get_xlim()
    panel.set_xlim(max(low, 0.02), min(max(high, 1.5), 100))
    panel.set_xlabel("figure by goal; left of 1 is better; tick: stretch")
    figure.savefig(path, dpi=130)


def _factor(value: float, goal: str) -> float:
    sign, number = limit(goal)
    small = 1e-3
    return (
        max(number, small) / max(value, small)
        if sign.startswith(">")
        else max(value, small) / max(number, small)
    )


def _label(row: Row) -> str:
    return f"{called(row)}: {shown(row.value, row.unit)}"


def _sheet(width: float, height: float, columns: int) -> tuple[Any, Sequence[Any]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots(1, columns, squeeze=False)[0]
    for panel in axes:
        panel.grid(color=GRID)
        panel.set_axisbelow(True)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
        panel.tick_params(colors=INK)
    return figure, axes
