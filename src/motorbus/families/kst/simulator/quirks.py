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

    bit_rate: int = switch(
        DEFAULT_RATE,
        "the rate they are set to, in bit/s",
        *RATES,
        source="manual, defaults: 500k (provisional)",
    )
    id_format: str = switch(
        "asked",
        "they take 11-bit and 29-bit identifiers and answer as they were asked, or take one form only",
        "asked",
        "std",
        "ext",
        source="manual prints four bytes and says standard frame; four public drivers use 11 bits, one 29",
    )
    duplicate: str = switch(
        "",
        "ids of which there is one servo more, as 0x25 or 0x25+0x26; its key is 1000 + its number on the bus",
        source="two servos as shipped share 0x25",
    )
    duplicate_delay: float = switch(
        0.0,
        "how much later those servos answer, in s; 0: at the same moment, so unequal answers collide",
        source="two devices never think equally long, but arbitration lets late ones begin together",
    )
    accept_sized: bool = switch(
        True,
        "writes that state their length (23, 27, 2B, 2F) are taken, or refused with 05040001",
        source="manual shows 22 only; a public XQPOWER tool sends 2F and 23",
    )
    accept_unsized: bool = switch(
        True,
        "writes that do not state their length (22) are taken, or refused with 06070010 where that is not 4 bytes",
        source="manual shows 22 only; some CANopen servers refuse it so",
    )
    out_of_range: str = switch(
        "abort",
        "a position beyond the range is refused with 06090031/32, or taken as the nearest allowed",
        "abort",
        "clamp",
        source="both codes are in the manual's list; it does not say when they come",
    )
    broadcast_read: bool = switch(
        True,
        "a read of node 0 is answered by everyone",
        source="a public demo of a newer protocol finds all servos by one broadcast read of 0x3000",
    )
    pending_id: str = switch(
        "pending",
        "before the restart 0x3000 reads the id that was written, or the one in force",
        "pending",
        "active",
        source="not documented; the driver takes either",
    )
    status_6002: str = switch(
        "position",
        "0x6002 reads the position, or the two status bytes x1 and x2",
        "position",
        "x1x2",
        source="manual, commands 6 and 7: one frame, two meanings",
    )
    x1: int = switch(0, "the first status byte", source="manual, command 7: defined as needed", span=_BYTE)
    x2: int = switch(0, "the second status byte", source="manual, command 7: defined as needed", span=_BYTE)
    firmware: str = switch(
        "1.00",
        "the version string of 0x100A; one of more than four characters is sent in segments",
        source="manual, command 8: four characters; CiA 301 makes 0x100A a string of any length",
    )
    save_reply: str = switch(
        "none",
        "a save is not answered, acknowledged, or refused (and then nothing is saved)",
        "none",
        "ack",
        "abort",
        source="manual, command 3: no reply; CiA 301 demands one",
    )
    flash_time: float = switch(
        0.15, "how long a save takes, in s", source="a public flight-controller driver leaves 150 ms"
    )
    flash_cut: str = switch(
        "old",
        "a save cut short by a restart has kept nothing, or everything",
        "old",
        "new",
        source="not documented; the driver takes either",
    )
    nmt: str = switch(
        "profile",
        "which form of start and stop they obey",
        "profile",
        "none",
        "vendor",
        "standard",
        source="newer KST: identifier = node; XQPOWER: NMT of CiA 301; manual: none",
    )
    reports_ms: float = switch(
        0.0,
        "report from power-up on every so many milliseconds; 0: only when started, as 0x2200 says",
        source="a servo that was set to report before it was connected",
    )
    boot_notice: bool = switch(
        False,
        "they send a heartbeat of state 0 whenever their supply comes back",
        source="CiA 301; the manual has none, and neither has any public driver",
    )
    position: int = switch(
        0, "where they stand at first, in raw counts", source="an assumption, no source", span=_COUNTS
    )
