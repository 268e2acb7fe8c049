"""What the registers of a servo hold when its supply comes, or when its controller starts anew.

The EEPROM is as it was stored, the RAM as it begins (STS3215 memory table V3.6; users of STS servos), and some
registers of the RAM are loaded from the EEPROM.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from motorbus.families.feetech.simulator.memory import Memory
from motorbus.families.feetech.simulator.switches import Switches

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


def begin(memory: Memory, switches: Switches, *, cut: bool) -> None:
    """Make every register what it is at first. With `cut` the supply was away: what was being stored is lost."""
    if cut:
        memory.power_up(mend=switches.torn_identity == "default")
    else:
        memory.restart()
    for row, source in LOADED.items():
        if row in memory.layout.table:
            memory[row] = memory[source]
    memory["lock"] = int(switches.lock_at_power_up)
    memory["torque_enable"] = int(switches.torque_at_power_up)
