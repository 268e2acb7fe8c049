"""What nobody has settled about how a FEETECH servo turns: what makes it move, how fast, which way, and how far.

These are the second part of `switches.Switches`, which is the one that is used. "By map" means: as is known of the
servos of that register map, and where nothing is known, as the help text says.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.feetech.simulator.switches_bus import BusSwitches


@dataclass(frozen=True, kw_only=True)
class MotionSwitches(BusSwitches):
    """How the shaft obeys the registers."""

    goal_enables_torque: str = switch(
        "by_map",
        "writing the goal position switches torque on: on STS where it was measured, on all maps, or on none",
        "by_map",
        "yes",
        "no",
        source="feetech-cli, measured on STS3215: 40 reads 1 after a write of 42; of other maps nobody has said",
    )
    beyond_limits: str = switch(
        "clamp",
        "a goal beyond the position limits, or beyond 7.5 turns, goes as far as the limit, or nowhere",
        "clamp",
        "stay",
        source="not documented",
    )
    goal_time: str = switch(
        "by_map",
        "in position mode register 44 is the time of the way when the velocity is 0: on SCS, on all but HLS, on none",
        "by_map",
        "heed",
        "ignore",
        source="SCS memory table: heeded when the velocity is 0; STS3215 memory table V3.6: only by some firmware",
    )
    zero_velocity: str = switch(
        "by_phase",
        "a velocity of 0 in position mode means what bit 3 of the phase register says (HLS, SMCL: stop), or maximum",
        "by_phase",
        "maximum",
        source="FEETECH notes on special bytes; SCS ship with the phase 0, by which a goal alone moves nothing",
    )
    hls_duty: str = switch(
        "goal_torque",
        "which register of an HLS servo takes the duty in PWM mode, in 0.1 %",
        "goal_torque",
        "goal_velocity",
        source="nobody has published it",
    )
    positive_duty: str = switch(
        "by_map",
        "a positive duty turns towards smaller angles on STS, where it was measured, and to larger ones on the others;"
        " or one of both everywhere",
        "by_map",
        "smaller",
        "larger",
        source="servolab, measured on STS3215: opposite to velocity mode; of other maps nobody has said",
    )
    half_reversed: str = switch(
        "runaway",
        "a servo with only one of the phase bits 0 and 7 set runs away from its goal, as loops with a wrong sign do,"
        " or follows it all the same",
        "runaway",
        "follow",
        source="not measured; an STS is reversed by both bits, which are drive and feedback (FEETECH special bytes)",
    )
    unknown_mode: str = switch(
        "rest",
        "a number in the mode register that no source explains (4 on HLS) makes the motor rest, or works as mode 0",
        "rest",
        "position",
        source="not documented",
    )
    angular_resolution: str = switch(
        "multiply",
        "register 30 multiplies the angle of a count, so that positions reach over so many turns, or does nothing",
        "multiply",
        "ignore",
        source="STS3215 memory table V3.6 and FD have the register; how it acts in single-turn mode nobody has said",
    )
    step_from: str = switch(
        "goal",
        "in step mode a write counts from the last goal while it is on its way, or from where it is",
        "goal",
        "present",
        source="not documented",
    )
    acceleration_unit: float = switch(
        100.0,
        "counts/s² for each unit of the acceleration register",
        source="memory table V3.6: 100; servolab, firmware 3.10: 104 to 105",
    )
    full_acceleration: float = switch(
        25_400.0,
        "counts/s² when the acceleration register is 0, which means maximum, or where there is none",
        source="not documented; what the greatest register value gives",
    )
