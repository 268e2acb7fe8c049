"""What a KST servo gives to whoever relies on it, and what not.

Source: the makers' CAN protocol sheets, which have a goal position and neither a stop, a torque switch nor a heartbeat
that a servo would listen to; the promise is that of the stop itself.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.guarantees import Guarantee, Guarantees, Level
from motorbus.families.kst.driver.motion import Promise

ASSURANCE: Final = Guarantees(
    measured=Guarantee(Level.YES, "it tells it when it is asked"),
    limits=Guarantee(
        Level.PARTLY, "the range of its make, as the bus is configured: no servo tells its make"
    ),
    stop=Guarantee(Level.PARTLY, Promise.HOLD_REQUESTED.value),
    estops={"hold": Guarantee(Level.PARTLY, Promise.HOLD_REQUESTED.value)},
    alone=Guarantee(
        Level.PARTLY,
        "led, it goes on to the last small goal, one cycle ahead of its course, makes up what it lags behind, and "
        "holds; moved by itself, it goes on to its goal",
    ),
    ends=Guarantee(Level.YES, "it knows nothing but positions to go to"),
    torque=Guarantee(Level.NO, "none: it holds with all its force as long as it has its supply"),
    restart=Guarantee(
        Level.PARTLY,
        "where it says so, by the boot notice of CANopen, it is a fault; no sheet promises that it does, and a frame "
        "that is lost is not seen",
    ),
    strain=Guarantee(
        Level.PARTLY,
        "current and temperature, where its make tells them; off its goal for too long counts as stalled in any case",
    ),
    watchdog=Guarantee(Level.NO, "none: it goes on to the last position it was told, and holds"),
    led=True,
)
