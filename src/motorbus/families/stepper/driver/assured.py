"""What a stepper controller gives to whoever relies on it, and what not.

Source: stepper controller serial protocol manual, whose 27 commands ask for no position, no state and no error; the
promise is that of the stop itself.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.guarantees import Guarantee, Guarantees, Level
from motorbus.families.stepper.driver.stopping import Promise

ASSURANCE: Final = Guarantees(
    measured=Guarantee(
        Level.NO, "it counts its own steps and tells nothing: where it is, is reckoned by the host"
    ),
    limits=Guarantee(Level.NO, "none but what is wired to its inputs"),
    stop=Guarantee(Level.PARTLY, Promise.STOP_ACCEPTED.value),
    estops={"": Guarantee(Level.PARTLY, Promise.STOP_ACCEPTED.value)},
    alone=Guarantee(
        Level.PARTLY,
        "it goes on to the end of the move that it was told, whatever its length; a jog is such a move",
    ),
    ends=Guarantee(
        Level.PARTLY,
        "homing, the jog commands of the manual and endless projects go on until somebody stops them, also when the "
        "host is gone",
    ),
    torque=Guarantee(Level.NO, "none: whether its motor holds at rest is up to its driver"),
    restart=Guarantee(Level.NO, "nothing tells; a project or a move that was under way ends there"),
    strain=Guarantee(Level.NO, "it feels nothing: a motor that is held loses steps, and nobody learns of it"),
    watchdog=Guarantee(Level.NO, "none: a project that was started runs to its end without any host"),
)
