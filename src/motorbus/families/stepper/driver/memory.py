"""What this host has done on this line, and what no controller tells: the only state there is, and it is a memory.

Nothing can be asked whether a project runs or which outputs are on. So what was said is kept, one memory for each open
bus, and it is never called more than that: another host, a button or a power cycle makes it wrong without a word.
"""

from __future__ import annotations

from math import inf

from motorbus.families.stepper.table import OUTPUTS, OutputPort, Project


class Memory:
    """What was said to the controller of one bus since it was opened.

    `wanted`   how many stops somebody has asked for, counted when each begins; not those that end every motion by hand
    `stops`    how many stops it has accepted, these included
    `stopping` how many stops are being said just now, accepted or not yet
    `owed`     a project was started, and neither its notice nor an accepted stop has come since: it may still run
    `turning`  until when (s on the link's clock) a motion may last that nobody waits for; no stop was accepted since
    `outputs`  the level last commanded, by output 1 to 3 and 5, the LEDs; None where that is not known
    `unsaved`  the project that was edited last without being saved, as it was meant to be; None: none was
    `shows_stored` when that was tried last, reading showed what was stored, and not what was being edited
    """

    def __init__(self) -> None:
        self.wanted = 0
        self.stops = 0
        self.stopping = 0
        self.owed = False
        self.turning = -inf
        self.outputs: dict[int, bool | None] = dict.fromkeys((*range(1, OUTPUTS + 1), int(OutputPort.LEDS)))
        self.unsaved: Project | None = None
        self.shows_stored = False

    def commanded(self, ports: tuple[int, ...], active: bool | None) -> None:
        """These outputs were switched; None: something that nobody can see may have switched them."""
        self.outputs.update(dict.fromkeys(ports, active))


def ports_of(port: int) -> tuple[int, ...]:
    """Which outputs the command "set output" switches with this port: one, all three, or the LEDs."""
    return tuple(range(1, OUTPUTS + 1)) if port == OutputPort.ALL else (port,)
