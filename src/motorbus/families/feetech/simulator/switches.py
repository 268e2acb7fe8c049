"""What nobody has settled about a real FEETECH servo, each as a named switch with a default and its source.

A simulator that guesses in silence teaches its users the guess. So where sources conflict or say nothing, the
behaviour is chosen here, by name, and a test of a host can run with every choice. Each switch may also be given
as an option of a bus string: `feetech:sim,ids=1-3,broadcast_ping=in_turn`.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch


@dataclass(frozen=True, slots=True, kw_only=True)
class Switches:
    """How the simulated servos behave where real ones differ or nobody knows. Times are in seconds."""

    broadcast_ping: str = switch(
        "collide",
        "several servos answer a broadcast PING at once and garble each other, or one after the other",
        "collide",
        "in_turn",
        source="manual V1.01, 1.1 forbids it with several servos; lerobot and rustypot use it on STS",
    )
    reg_write_again: str = switch(
        "replace",
        "a second REG WRITE before ACTION replaces the first or is dropped",
        "replace",
        "refuse",
        source="not documented",
    )
    empty_write: str = switch(
        "ack",
        "a WRITE of an address without a datum is acknowledged or ignored",
        "ack",
        "silent",
        source="manual V1.01, 1.3 table (one parameter) against 1.3.3 (at least two)",
    )
    out_of_range: str = switch(
        "store",
        "a value outside its register's range is stored or dropped; the write is acknowledged either way",
        "store",
        "drop",
        source="not documented; no error code for it exists",
    )
    beyond_limits: str = switch(
        "clamp",
        "a goal beyond the position limits goes as far as the limit, or nowhere",
        "clamp",
        "stay",
        source="not documented",
    )
    sync_read_missing: str = switch(
        "wait",
        "when a listed servo is missing the next ones leave its time free, close up, or stay silent",
        "wait",
        "close_up",
        "silent",
        source="open question: order and timing of SYNC READ replies when one is missing",
    )
    id_ack: str = switch(
        "new",
        "a WRITE of the id is acknowledged from the new id or from the old one",
        "new",
        "old",
        source="fanhao375/microduck-replica#28 (from the new id)",
    )
    baud_ack: str = switch(
        "old",
        "a WRITE of the baud rate is acknowledged at the old rate, or at the new one and so not heard",
        "old",
        "new",
        source="not documented",
    )
    factory_restore: bool = switch(
        True,
        "instruction 0x06 restores the factory values; without it the servo stays silent",
        source="servolab, measured on an STS3215 with firmware 3.10; manual V1.01: certain models only",
    )
    restore_id: str = switch(
        "keep",
        "a factory restore keeps the id or sets it to 1",
        "keep",
        "default",
        source="servolab, firmware 3.10: kept; feetech-cli documents id 1 at 1 Mbaud",
    )
    restore_time: float = switch(
        1.0,
        "how long it is deaf after a factory restore",
        source="servolab: about 1 s until it answers again",
    )
    calibrate: str = switch(
        "accept",
        "instruction 0x0B sets the present position, or is ignored",
        "accept",
        "ignore",
        source="in the dispatcher of STS3215 firmware 3.10 (kuterd/feetech-fw-util); documented for HLS",
    )
    calibration_store: str = switch(
        "lock",
        "a homing offset found by calibration is stored when the lock is open, or always",
        "lock",
        "always",
        source="not documented; both ways of calibrating write register 31",
    )
    goal_enables_torque: bool = switch(
        True,
        "writing the goal position switches torque on",
        source="feetech-cli, measured on STS3215: 40 reads 1 after a write of 42",
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
    step_from: str = switch(
        "goal",
        "in step mode a write counts from the last goal while it is on its way, or from where it is",
        "goal",
        "present",
        source="not documented",
    )
    bootloader: str = switch(
        "silent",
        "instruction 0x08 is not answered, or acknowledged before it goes",
        "silent",
        "ack",
        source="not documented",
    )
    bootloader_time: float = switch(
        0.8, "how long it is deaf after instruction 0x08", source="kuterd/feetech-fw-util: about 800 ms"
    )
    store_time: float = switch(
        0.02,
        "how much later a write is acknowledged that goes to the EEPROM",
        source="public recovery tool for STS3215, measured: can exceed 21 ms",
    )
    startup_time: float = switch(
        0.0, "how long it is deaf after power-up", source="st3215-bus: the first ping may be missed"
    )
    frame_gap: float = switch(
        0.005,
        "a pause after which half a frame is forgotten; 0: never, and one wrong length byte swallows what follows",
        source="not documented; without one a wrong length byte makes it deaf for up to 258 bytes",
    )
    acceleration_unit: float = switch(
        100.0,
        "counts/s² for each unit of the acceleration register",
        source="memory table V3.6: 100; servolab, firmware 3.10: 104 to 105",
    )
    full_acceleration: float = switch(
        25_400.0,
        "counts/s² when the acceleration register is 0, which means maximum",
        source="not documented; what the greatest register value gives",
    )
