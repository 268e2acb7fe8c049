"""What nobody has settled about a real controller, and what can go wrong with one, each as a named switch.

How a project is carried out is `execution.Behaviour`, and all of its switches are among these. The rest is memory, the
line, and faults: what a cable, an adapter or a worn contact does, for a host has to live with it. A fault is never on
by itself. "Manual" is the stepper controller serial protocol manual.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

from motorbus.core.switches import switch
from motorbus.families.stepper.execution import Behaviour

_MANUAL: Final = "stepper controller serial protocol manual"
_ASSUMED: Final = "an assumption, no source"
_FAULT: Final = "made for tests of hosts"


@dataclass(frozen=True, slots=True, kw_only=True)
class Switches(Behaviour):
    """How the simulated controller behaves. Times are in seconds, those named so in milliseconds."""

    # -- memory -------------------------------------------------------------------------------------------------

    shipped: str = switch(
        "example",
        "project 1 holds the values of the manual's examples when it is new, or all four are empty",
        "example",
        "empty",
        source=_ASSUMED,
    )
    selected_at_boot: int = switch(
        1, "which project is selected when the supply comes", 1, 2, 3, 4, source=_ASSUMED
    )
    select: str = switch(
        "load",
        "selecting a project loads what is stored of it, or only renames what is being edited",
        "load",
        "relabel",
        source=_ASSUMED,
    )
    read_view: str = switch(
        "working",
        "reading the selected project shows what is being edited, or what is stored",
        "working",
        "stored",
        source=_ASSUMED,
    )
    save_cross: str = switch(
        "warn",
        "saving as another project than the selected one is done and noted, refused in silence, or done",
        "warn",
        "refuse",
        "allow",
        source=_ASSUMED,
    )
    dump_order: str = switch(
        "little",
        "which byte of a number comes first in a dump",
        "little",
        "big",
        source=f"{_MANUAL} has the lowest first in requests and says nothing of the dump",
    )
    save_cut: str = switch(
        "old",
        "what a project holds whose saving was cut by the supply: the old values, or nothing",
        "old",
        "empty",
        source=_ASSUMED,
    )

    # -- requests -----------------------------------------------------------------------------------------------

    motor: int = switch(3, "its motor number; it does not answer to others", source=_MANUAL, span=(1, 255))
    bad_frame: str = switch(
        "silent",
        "what it answers to a wrong checksum or an unknown command",
        "silent",
        source=f"{_MANUAL}: a correct command is answered; it has no word for no",
    )
    out_of_range: str = switch(
        "silent",
        "a number that is not possible is not answered, or acknowledged and ignored",
        "silent",
        "ack",
        source=_ASSUMED,
    )
    rx_gap_ms: float = switch(
        100.0, "pause in ms after which the beginning of a request is forgotten", source=_ASSUMED
    )
    in3_project: str = switch("selected", "which project input 3 starts", "selected", "1", source=_ASSUMED)
    input_polarity: str = switch(
        "high",
        "an active input reads 1, or 0",
        "high",
        "low",
        source=f"{_MANUAL}, item 24: 1 is input present",
    )
    turnaround: float = switch(0.002, "s from a request to its reply", source=_ASSUMED)
    save_time: float = switch(
        0.03, "s that saving and clearing take before they are acknowledged", source=_ASSUMED
    )

    # -- faults ---------------------------------------------------------------------------------------------------

    echo: str = switch(
        "no",
        "the line hands back what the host sends: all of it, or the first six bytes of each request, which is how many "
        "an acknowledgement has",
        "no",
        "yes",
        "six",
        source=_FAULT,
    )
    request_errors: float = switch(
        0.0,
        "how probable it is for each byte of a request to arrive as another one; a wrong checksum is not answered",
        source=_FAULT,
        span=(0.0, 1.0),
    )
    byte_errors: float = switch(
        0.0,
        "how probable it is for each byte that the device says to arrive as another one",
        source=_FAULT,
        span=(0.0, 1.0),
    )
    seed: int = switch(
        0, "where chance begins: the same seed and the same traffic give the same errors", source=_FAULT
    )
    reply_fault: str = switch(
        "none",
        "what happens to replies: they are lost though the command is carried out; the command is unheard, neither "
        "carried out nor answered; they are late, come twice, have one bit flipped, are those of another command, come "
        "in two pieces, or noise comes before them",
        "none",
        "lost",
        "unheard",
        "late",
        "doubled",
        "bit",
        "other",
        "split",
        "noise",
        source=_FAULT,
    )
    notice_fault: str = switch(
        "none",
        "what happens to the notice that a project has ended: it is lost, comes twice, is late, waits for the next "
        "request and comes before the reply (early), or waits for the next dump and comes in the middle of it",
        "none",
        "lost",
        "doubled",
        "late",
        "early",
        "inside_dump",
        source=_FAULT,
    )
    dump_fault: str = switch(
        "none", "dumps lack their second half, or one byte", "none", "short", "byte", source=_FAULT
    )
    fault_every: int = switch(
        1,
        "of echo=six and of the faults of replies, notices and dumps: each so-many-th is hit, each kind counted by "
        "itself; errors of bytes come by chance alone",
        source=_FAULT,
        span=(1, 1e9),
    )
    fault_time: float = switch(
        0.5, "s by which late replies and notices are late, and between two pieces", source=_FAULT
    )
    deaf_while_moving: bool = switch(False, "while the motor turns it hears nothing", source=_FAULT)
    bounce: int = switch(
        0, "an input that becomes active opens and closes so often first", source=_FAULT, span=(0, 100)
    )
    bounce_ms: float = switch(1.0, "ms between two of these", source=_FAULT, span=(1e-3, 1e3))
    home_switch: str = switch(
        "free",
        "input 5 goes as it is set, is closed by the load at its place, is stuck active, or never becomes active",
        "free",
        "wired",
        "stuck",
        "never",
        source=_FAULT,
    )
    home_at: int = switch(
        -1600,
        "that place, with home_switch=wired: so many pulses from where the motor was first, and everything behind it",
        source=_FAULT,
        span=(-1e9, 1e9),
    )


CHANGEABLE: Final = frozenset(
    {one.name for one in fields(Switches) if one.metadata["source"] == _FAULT} | {"turnaround", "save_time"}
)
"""What may change while it runs: faults come and go, and so does slowness. How a device is made does not."""
