"""What nobody has settled about how a FEETECH servo fails: cut supplies, colliding replies, overload and heat.

These are the third part of `switches.Switches`, which is the one that is used. Where a figure was measured, by users
mostly, the source gives it; the default is then still none of it, so that a simulated shaft is exact until somebody
asks for more.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.feetech.simulator.switches_motion import MotionSwitches


@dataclass(frozen=True, kw_only=True)
class FaultSwitches(MotionSwitches):
    """How the servos fail, and what they then do."""

    eeprom_commit: str = switch(
        "before_ack",
        "a write to the EEPROM is acknowledged when its last cell is committed, or at once, before the first",
        "before_ack",
        "after_ack",
        source="public recovery tool for STS3215, measured: the acknowledgement can take 21 ms, as if it waited",
    )
    while_storing: str = switch(
        "buffer",
        "what is asked while the EEPROM is at work is answered when it is done, all in one burst, or at once",
        "buffer",
        "answer",
        source="feetech-cli: a servo that comes back from flash work answers what was buffered in a burst",
    )
    torn: str = switch(
        "erased",
        "what an EEPROM cell holds whose commit was cut by the supply: its old value, the new one, or 255",
        "erased",
        "old",
        "new",
        source="not documented",
    )
    torn_identity: str = switch(
        "default",
        "a servo that finds an impossible id or baud code at power-up uses the factory one, or cannot be reached",
        "default",
        "unreachable",
        source="not documented; `default` keeps it reachable, at id 1 and the factory's rate",
    )
    framing: str = switch(
        "deliver",
        "the host's port delivers a byte whose stop bit is low, which collisions make, or drops it",
        "deliver",
        "drop",
        source="serial ports deliver it unless a program asks for marks; some adapters drop it",
    )
    overload_clears: str = switch(
        "power_cycle",
        "what ends overload and over-current: a power cut, or torque off as well",
        "power_cycle",
        "torque_off",
        source="not documented; users had to cut the power: physical-ai-studio#955",
    )
    overpowered: str = switch(
        "stays",
        "a shaft on which more torque acts than the motor may use, none at all included, stays or is pushed along",
        "stays",
        "yields",
        source="not documented; a gear of 1:345 is hard to turn by hand, yet arms sag when their torque is off",
    )
    cool_down: float = switch(
        5.0,
        "how far below register 13 it must cool before an alarm by its own heat ends (°C)",
        source="not documented",
        span=(0.1, 100.0),
    )
    ambient: float = switch(
        30.0,
        "the temperature that its register tells when nothing heats it (°C)",
        source="none needed; a servo at rest is a little warmer than a room",
        span=(-40.0, 100.0),
    )
    supply_resistance: float = switch(
        0.0,
        "resistance of supply and cables, which all servos share (ohm); the voltage falls with their current",
        source="SO-ARM100#132: thin daisy-chained cables; a metre of them and its plugs has 0.1 to 0.5 ohm (assumed)",
    )
    brown_out: float = switch(
        0.0,
        "the supply below which a servo starts anew and until which it stays dead (V); 0: none",
        source="orcahand/orca_core#89: random ones of them vanish; at which voltage is not documented",
    )
    brown_out_spread: float = switch(
        0.2,
        "how far that differs from servo to servo at most, up or down, by chance (V); the same with the same `seed`",
        source="assumed; that not all vanish at once was seen (orcahand/orca_core#89)",
    )
