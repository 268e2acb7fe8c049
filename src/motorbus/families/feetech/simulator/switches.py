"""What nobody has settled about a real FEETECH servo, each as a named switch with a default and its source.

A simulator that guesses in silence teaches its users the guess. So where sources conflict or say nothing, the
behaviour is chosen here, by name, and a test of a host can run with every choice. Each switch may also be given
as an option of a bus string: `feetech:sim,ids=1-3,broadcast_ping=in_turn`. Those of the bus, of the movement and of
faults have files of their own; here are those of memory and power.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.feetech.simulator.switches_faults import FaultSwitches


@dataclass(frozen=True, kw_only=True)
class Switches(FaultSwitches):
    """How the simulated servos behave where real ones differ or nobody knows. Times are in seconds."""

    out_of_range: str = switch(
        "store",
        "a value outside its register's range is stored or dropped; the write is acknowledged either way",
        "store",
        "drop",
        source="not documented; no error code for it exists",
    )
    restore_id: str = switch(
        "keep",
        "a factory restore keeps the id or sets it to 1",
        "keep",
        "default",
        source="servolab, firmware 3.10: kept; feetech-cli documents id 1 at 1 Mbaud",
    )
    restore_time: float = switch(
        0.5,
        "how long it is deaf after a factory restore (s)",
        source="servolab polls for at most 1 s after it, measured on firmware 3.10: the time is shorter than that",
    )
    calibration_store: str = switch(
        "lock",
        "a homing offset found by calibration is stored when the lock is open, or always",
        "lock",
        "always",
        source="not documented; both ways of calibrating write register 31",
    )
    goal_at_power_up: str = switch(
        "zero",
        "after power-up the goal position reads 0, or the present position",
        "zero",
        "present",
        source="not documented; 0 is the cruel one: torque on without a goal makes it jump",
    )
    torque_at_power_up: bool = switch(
        False,
        "torque is on after power-up",
        source="STS3215 memory table V3.6: off; PickNikRobotics/moveit_pro_example_ws#930: found stiff",
    )
    lock_at_power_up: bool = switch(
        True,
        "the EEPROM lock is closed after power-up",
        source="memory table V3.6: open; FD 1.9.8.5 and current parts: closed",
    )
    store_time: float = switch(
        0.02,
        "how much later a write is acknowledged that goes to the EEPROM (s)",
        source="public recovery tool for STS3215, measured: can exceed 21 ms",
    )
    startup_time: float = switch(
        0.0, "how long it is deaf after power-up (s)", source="st3215-bus: the first ping may be missed"
    )
