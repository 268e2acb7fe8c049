"""What a stepper controller gives to whoever relies on it, and what not.

Source: stepper controller serial protocol manual, whose 27 commands ask for no position, no state and no error; the
promise is that of the stop itself.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.assurance import Assurance, Given, Point
from motorbus.families.stepper.driver.stopping import Promise

ASSURANCE: Final = Assurance(
    measured=Point(
        Given.NO, "it counts its own steps and tells nothing: where it is, is reckoned by the host"
    ),
    limits=Point(Given.NO, "none but what is wired to its inputs"),
    stop=Point(Given.PARTLY, Promise.STOP_ACCEPTED.value),
    estops={"": Point(Given.PARTLY, Promise.STOP_ACCEPTED.value)},
    alone=Point(
        Given.PARTLY,
        "it goes on to the end of the move that it was told, whatever its length; a jog is such a move",
    ),
    ends=Point(
        Given.PARTLY,
        "homing, the jog commands of the manual and endless projects go on until somebody stops them, also when the "
        "host is gone",
    ),
    torque=Point(Given.NO, "none: whether its motor holds at rest is up to its driver"),
    restart=Point(Given.NO, "nothing tells; a project or a move that was under way ends there"),
    strain=Point(Given.NO, "it feels nothing: a motor that is held loses steps, and nobody learns of it"),
    watchdog=Point(Given.NO, "none: a project that was started runs to its end without any host"),
)
