"""What a FEETECH servo gives to whoever relies on it, and what not.

Source: FEETECH serial bus servo protocol manual V1.01, which knows no time after which a silent host is noticed;
STS3215 memory table V3.6 for limits and protection; the promises are those of the stops themselves.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.guarantees import Guarantee, Guarantees, Level
from motorbus.families.feetech.driver.holding import PROMISE as HELD
from motorbus.families.feetech.driver.motion import Promise

ASSURANCE: Final = Guarantees(
    measured=Guarantee(
        Level.YES, "it tells it when it is asked; over one turn, unless it is set to count more"
    ),
    limits=Guarantee(
        Level.YES, "least and greatest position are kept in its EEPROM, and read before the first goal"
    ),
    stop=Guarantee(Level.PARTLY, Promise.HOLD_ACCEPTED.value),
    estops={
        "torque_off": Guarantee(Level.PARTLY, Promise.TORQUE_OFF_ACCEPTED.value),
        "hold": Guarantee(Level.PARTLY, HELD),
    },
    alone=Guarantee(
        Level.PARTLY,
        "led, it goes on to the last small goal, one cycle ahead of its course, makes up what it lags behind, and "
        "holds; moved by itself, it goes on to its goal",
    ),
    ends=Guarantee(
        Level.PARTLY,
        "set_velocity, set_duty and set_current turn it until something else is said, also when the host is gone",
    ),
    torque=Guarantee(
        Level.YES, "torque off is said up to three times and read back; then an arm sags or falls"
    ),
    restart=Guarantee(
        Level.PARTLY,
        "looked at while it is led: torque that is off, or registers as power-up leaves them, are a fault; what comes "
        "and goes between two looks is not seen",
    ),
    strain=Guarantee(
        Level.PARTLY,
        "it tells load and temperature, most tell current; its own protection comes later and lets it drop its load",
    ),
    watchdog=Guarantee(Level.NO, "none: it goes on doing the last thing it was told"),
    led=True,
)
