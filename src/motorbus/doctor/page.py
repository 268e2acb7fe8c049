"""The report as text lines and as one HTML file without other files, light and dark, from 400 px on."""

from __future__ import annotations

from html import escape
from itertools import cycle
from typing import Final

from motorbus import __version__
from motorbus.core.findings import Finding
from motorbus.doctor.findings import Report

PARTS: Final = (("measured", "evidence"), ("why", "cause"), ("fix", "action"), ("because of", "because"))
COLUMNS: Final = {
    "voltage": "V",
    "current": "A",
    "temperature": "°C",
    "lost": "lost %",
    "p50": "p50 ms",
    "p99": "p99 ms",
}
STYLE: Final = """
:root { color-scheme: light dark; --text: #1c2127; --page: #fff; --card: #f4f5f7; --line: #d5d9de;
  --error: #b3261e; --warning: #8a5a00; --info: #355f99; }
@media (prefers-color-scheme: dark) { :root { --text: #e3e6ea; --page: #15181c; --card: #1f242a; --line: #3a424b;
  --error: #ff8a80; --warning: #f3b755; --info: #8fb8f0; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 62rem; font: 16px/1.45 system-ui, sans-serif;
  color: var(--text); background: var(--page); overflow-wrap: anywhere; }
h1 { font-size: 1.4rem; margin: 0 0 .3rem; } h2 { font-size: 1.05rem; margin: 1.6rem 0 .5rem; }
article { background: var(--card); border-left: .3rem solid; border-radius: .3rem;
  padding: .6rem .9rem; margin: .6rem 0; }
.error { border-color: var(--error); } .warning { border-color: var(--warning); } .info { border-color: var(--info); }
.error b { color: var(--error); } .warning b { color: var(--warning); } .info b { color: var(--info); }
dl { display: grid; grid-template-columns: 6.5rem 1fr; gap: .15rem .6rem; margin: .4rem 0 0; } dd { margin: 0; }
dt { opacity: .75; } code { font-size: .95em; }
@media (max-width: 480px) { dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: .35rem; } }
.scroll { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .3rem .7rem .3rem 0; border-bottom: 1px solid var(--line); white-space: nowrap; }
"""


def lines(report: Report) -> list[str]:
    """The findings as text, the first cause first."""
    found = []
    for one in report.findings:
        found.append(f"{one.severity:<8} {one.code}  {short(one.where, report)}")
        found += [f"  {title}: {text}" for title, text in _parts(one, report)]
    return [*found, summary(report)]


def short(text: str, report: Report) -> str:
    """The text with devices of the only bus as #3, but in commands, which can be copied."""
    parts = text.split("`")
    return "`".join(
        part if is_command else part.replace(f"{report.target}#", "#")
        for part, is_command in zip(parts, cycle((False, True)), strict=False)
    )


def _parts(one: Finding, report: Report) -> list[tuple[str, str]]:
    """Title and text of each part."""
    return [(title, short(text, report)) for title, name in PARTS if (text := getattr(one, name))]


def summary(report: Report) -> str:
    """The number of findings in one line."""
    counts = [(report.count(severity), severity) for severity in ("error", "warning")]
    shown = [f"{count} {word}{'s' if count > 1 else ''}" for count, word in counts if count]
    return ", ".join([*shown, f"{len(report.devices)} devices answer"]) if shown else "nothing wrong found"


def html(report: Report, *, made: str) -> str:
    """The report as an HTML document. `made` is its time."""
    title = f"motorbus doctor: {report.target}"
    simulated = ", simulated" if report.simulated else ""
    return "\n".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title><style>{STYLE}</style></head><body>",
            f"<h1>{escape(title)}</h1>",
            f"<p>{escape(summary(report))}{simulated}. {escape(made)}, motorbus {__version__}.</p>",
            *[_article(one, report) for one in report.findings],
            _table(report),
            "</body></html>",
        ]
    )


def _article(one: Finding, report: Report) -> str:
    rows = "".join(f"<dt>{title}</dt><dd>{escape(text)}</dd>" for title, text in _parts(one, report))
    head = f"<b>{one.severity}</b> <code>{one.code}</code> {escape(short(one.where, report))}"
    return f'<article class="{one.severity}">{head}<dl>{rows}</dl></article>'


def _table(report: Report) -> str:
    if not report.devices:
        return ""
    rows = [
        [short(name, report), one.model, one.firmware, *(_number(getattr(one, field)) for field in COLUMNS)]
        for name, one in report.devices.items()
    ]
    head = "".join(f"<th>{title}</th>" for title in ("device", "model", "firmware", *COLUMNS.values()))
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f'<h2>Devices</h2><div class="scroll"><table><tr>{head}</tr>{body}</table></div>'


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
