"""What happens to a servo when its supply comes, or when its controller starts anew.

The EEPROM is as it was stored, the RAM as it begins, the turn count is lost (STS3215 memory table V3.6; users of STS
servos), and some registers of the RAM are loaded from the EEPROM.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from motorbus.families.feetech.simulator.feedback import FEEDBACK

if TYPE_CHECKING:
    from motorbus.families.feetech.simulator.servo import Servo

LOADED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "torque_limit": "max_torque",  # STS3215 memory table V3.6; FD: on SMBL and HLS too
        "goal_torque": "protection_current",  # HLS memory table, and so are the three below
        "live_p": "position_p",
        "live_d": "position_d",
        "live_i": "position_i",
    }
)
"""Row of the RAM -> row of the EEPROM that it is loaded from at power-up."""


def power_up(servo: Servo, at: float, *, cut: bool = True) -> None:
    """Start anew at this moment: limp, at rest, within one turn, and nothing pending.

    With `cut` the supply was away, and what was on its way to the EEPROM is lost.
    """
    memory, switches = servo.memory, servo.switches
    servo.lives += 1
    servo.pending = None
    servo.clear_alarm()
    if cut:
        memory.power_up(mend=switches.torn_identity == "default")
    else:
        memory.restart()
    for row, source in LOADED.items():
        if row in servo.model.table:
            memory[row] = memory[source]
    memory["lock"] = int(switches.lock_at_power_up)
    memory["torque_enable"] = int(switches.torque_at_power_up)
    servo.forget_turns(at)
    if switches.goal_at_power_up == "present" or switches.torque_at_power_up:
        memory["goal_position"] = FEEDBACK["present_position"](servo, at)
    servo.deaf_until = at + switches.startup_time if switches.startup_time else -inf
    servo.renamed()
    servo.move(at)


def brown_out(servo: Servo, at: float) -> None:
    """The supply was too low for a moment, and the torque is off whatever it is after a real power-up.

    A servo that held its load again at once would fall again at once, and for ever; what real ones do is not known.
    """
    power_up(servo, at)
    if servo.memory["torque_enable"]:
        servo.memory["torque_enable"] = 0
        servo.move(at)


def stand(servo: Servo, at: float) -> None:
    """Its supply is gone: what was on its way to the EEPROM is lost, and the shaft is left to itself."""
    servo.memory.flash.cut()
    servo.move(at)
