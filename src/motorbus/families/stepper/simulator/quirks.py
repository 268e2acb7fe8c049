"""Options of the simulated stepper controller: faults that users meet, and open questions that the driver must bear.

`stepper:sim,select=relabel` sets one. No such controller was ever seen, so none of them has a second source. "Manual"
is the stepper controller serial protocol manual.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch

_ASSUMED = "an assumption, no source"
_FAULT = "made for tests of hosts"


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Behaviour of the simulated controller. Times are in s, in ms where the name says so; positions in pulses."""

    # fmt: off
    motor: int = switch(3, "its motor number; it does not reply to others", source="manual", span=(1, 255))
    dump_order: str = switch("little", "the byte of a number that is first in a dump", "little", "big",
        source="manual has the lowest first in requests and does not say it of the dump")
    shipped: str = switch("example",
        "when new, project 1 holds the values of the manual's examples, or all four are cleared",
        "example", "cleared", source=_ASSUMED)
    echo: bool = switch(False, "the line returns what the host sends", source=_FAULT)
    turnaround: float = switch(0.002, "s from a request to its reply", source=_ASSUMED)
    home_switch: str = switch("free",
        "input 5 follows set-input, closes at the place home_at, is stuck active, or never becomes active",
        "free", "wired", "stuck", "never", source=_FAULT)
    home_at: int = switch(-1600,
        "that place, in pulses from the position at power-on; it is closed there and behind it",
        source=_FAULT, span=(-1e9, 1e9))
    save_cut: str = switch("old",
        "a save that is cut short by power-off has stored nothing, or cleared the project",
        "old", "empty", source=_ASSUMED)
    read_view: str = switch("working",
        "reading the selected project shows its edits, or what is stored",
        "working", "stored", source=_ASSUMED)
    select: str = switch("load",
        "selecting a project loads what is stored, or renames what is edited",
        "load", "relabel", source=_ASSUMED)
    ramp_tick_ms: float = switch(1.0,
        "ms in which the frequency grows by the acceleration", source="manual, item 6: no time", span=(1e-3, 1e4))
    # fmt: on
