"""Options of the simulated FEETECH servos: behaviour in which sources differ, and faults that users meet.

`feetech:sim,ids=1-3,id_ack=new` sets one. All else that no source settles is a constant in the code, `#
assumption`.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.feetech.registers.codes import BAUD_CODES


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Behaviour of the simulated servos. Times are in s."""

    # fmt: off
    position: int = switch(-1,
        "their first position, raw counts; -1: the middle",
        source="an assumption", span=(-1, 4095))
    firmware: str = switch("",
        "their firmware, as 3.9, or one for each id joined by +; left out: one that has their map; it selects"
        " the map of a model that has several",
        source="firmware and byte order tell the map: FD 1.9.8.5")
    duplicate: str = switch("",
        "ids with a second servo, as 3 or 3+5; it replies 0 to 20 bits later",
        source="new servos all have the id 1")
    servo_baud: int = switch(0,
        "their rate, bit/s; 0: as shipped, or 1000000 where models are mixed that ship with different rates",
        0, *BAUD_CODES.values(),
        source="STS and HLS ship with 1000000, SMS with 115200, SCS with 1000000 or 500000 (memory tables)")
    echo: bool = switch(False,
        "the adapter receives what the host sends, before any reply",
        source="boards with RX and TX on one wire: waveshareteam/ugv_rpi#27")
    broadcast_ping: str = switch("collide",
        "several servos reply to a broadcast PING at once, or one after the other; SCS servos never do",
        "collide", "in_turn",
        source="manual V1.01, 1.1 forbids it with several servos; lerobot and rustypot use it on STS")
    sync_read_missing: str = switch("wait",
        "where a listed servo is missing the next ones leave its time free, close up, or stay silent",
        "wait", "close_up", "silent",
        source="not documented")
    id_ack: str = switch("old",
        "a WRITE of the id is acknowledged from the old id or from the new one",
        "old", "new",
        source="lerobot, rustypot, sts-suite take the old id only; fanhao375/microduck-replica#28: the new")
    baud_ack: str = switch("old",
        "a WRITE of the baud rate is acknowledged at the old rate, or at the new one and so not received",
        "old", "new",
        source="not documented")
    eeprom_commit: str = switch("before_ack",
        "an EEPROM write is acknowledged after its last cell is stored, or before the first",
        "before_ack", "after_ack",
        source="public recovery tool for STS3215, measured: the acknowledgement can take 21 ms")
    store_time: float = switch(0.02,
        "s that an EEPROM write takes",
        source="public recovery tool for STS3215, measured: can exceed 21 ms")
    torn: str = switch("erased",
        "what an EEPROM cell holds whose store was cut: 255, its old value or the new one",
        "erased", "old", "new",
        source="not documented")
    startup_time: float = switch(0.0,
        "s after power-up in which nothing is received",
        source="st3215-bus: the first ping may be missed")
    lock_at_power_up: bool = switch(True,
        "the EEPROM lock is closed after power-up",
        source="memory table V3.6: open; FD 1.9.8.5 and current parts: closed")
    torque_at_power_up: bool = switch(False,
        "torque is on after power-up",
        source="memory table V3.6: off; PickNikRobotics/moveit_pro_example_ws#930: found stiff")
    goal_at_power_up: str = switch("zero",
        "after power-up the goal position reads 0, so torque on moves there, or the present position",
        "zero", "present",
        source="not documented")
    factory_restore: bool = switch(True,
        "instruction 0x06 restores the factory values; otherwise it is not answered",
        source="servolab, STS3215 with firmware 3.10: yes; manual V1.01: certain models only")
    overload_clears: str = switch("power_cycle",
        "what ends an overload: a power cycle, or torque off as well",
        "power_cycle", "torque_off",
        source="not documented; users had to cut the power: physical-ai-studio#955")
    out_of_range: str = switch("store",
        "a value outside the range of its register is stored or dropped, and acknowledged",
        "store", "drop",
        source="not documented; there is no error code for it")
    # fmt: on
