"""Options of the simulated KST servos: behaviour in which sources differ, and faults that users meet.

`kst:sim,ids=0x25,out_of_range=clamp` sets one. "Manual" is the KST CAN protocol manual; the public drivers are named
by what they drive.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.kst.profiles import DEFAULT_RATE, RATES

_BYTE = (0, 255)
_COUNTS = (-32768, 32767)


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Behaviour of the simulated servos. Times are in s, in ms where the name says so; positions in raw counts."""

    # fmt: off
    bit_rate: int = switch(DEFAULT_RATE, "their rate, bit/s", *RATES,
        source="manual, defaults: 500k (provisional)")
    id_format: str = switch("asked",
        "identifiers that they take: 11 and 29 bits, answered in the form of the request, or one form",
        "asked", "std", "ext",
        source="manual prints four bytes and says standard frame; four public drivers use 11 bits, one 29")
    duplicate: str = switch("",
        "ids with a second servo, as 0x25 or 0x25+0x26; its key is 1000 + its number",
        source="two servos as shipped share 0x25")
    duplicate_delay: float = switch(0.0,
        "s by which the second servo replies later; 0: at once, so unequal replies collide",
        source="replies never take equally long")
    accept_sized: bool = switch(True,
        "writes with a length (23, 27, 2B, 2F) are taken, or refused with 05040001",
        source="manual: 22 only; XQPOWER tool: 2F and 23")
    accept_unsized: bool = switch(True,
        "writes without a length (22) are taken, or refused with 06070010 unless 4 bytes",
        source="manual: 22 only; some CANopen servers refuse it")
    out_of_range: str = switch("abort",
        "a position beyond the range is refused with 06090031/32, or taken as the nearest allowed",
        "abort", "clamp",
        source="both codes are in the manual's list; it does not say when they come")
    broadcast_read: bool = switch(True, "every servo replies to a read of node 0",
        source="a public demo driver finds all servos so")
    pending_id: str = switch("pending",
        "before the restart 0x3000 reads the id that was written, or the one in force",
        "pending", "active",
        source="not documented; the driver takes either")
    status_6002: str = switch("position",
        "0x6002 reads the position, or the two status bytes x1 and x2",
        "position", "x1x2",
        source="manual, commands 6 and 7: one frame, two meanings")
    x1: int = switch(0, "the first status byte", source="manual, command 7: defined as needed", span=_BYTE)
    x2: int = switch(0, "the second status byte", source="manual, command 7: defined as needed", span=_BYTE)
    firmware: str = switch("1.00",
        "version in 0x100A; more than four characters are announced in segments, which are not sent",
        source="manual, command 8: four characters; CiA 301: any length")
    save_reply: str = switch("none",
        "a save is not answered, acknowledged, or refused (and then nothing is saved)",
        "none", "ack", "abort",
        source="manual, command 3: no reply; CiA 301 demands one")
    flash_time: float = switch(0.15, "s that a save takes",
        source="a public flight-controller driver leaves 150 ms")
    flash_cut: str = switch("old",
        "a save cut short by a restart has kept nothing, or everything",
        "old", "new",
        source="not documented; the driver takes either")
    nmt: str = switch("profile",
        "which form of start and stop they obey",
        "profile", "none", "vendor", "standard",
        source="newer KST: identifier = node; XQPOWER: NMT of CiA 301; manual: none")
    reports_ms: float = switch(0.0,
        "ms between reports from power-up on; 0: only when started, as 0x2200 says",
        source="a servo may have been started before")
    boot_notice: bool = switch(False,
        "a heartbeat of state 0 whenever their supply comes back",
        source="CiA 301; manual and drivers: none")
    position: int = switch(0, "their first position, raw counts", source="an assumption", span=_COUNTS)
    speed: float = switch(7.0, "top speed in rad/s",
        source="an assumption; 0.15 s for 60 degrees is usual", span=(1e-6, 1e9))
    # fmt: on
