"""Options of the simulated KST servos: behaviour in which sources differ, and faults that users meet.

`kst:sim,ids=0x25,out_of_range=clamp` sets one. "Manual" is the KST CAN protocol manual; the public drivers are named
by what they drive.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.kst.profiles import DEFAULT_RATE, RATES


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Behaviour of the simulated servos."""

    # fmt: off
    bit_rate: int = switch(DEFAULT_RATE, "their rate, bit/s", *RATES,
        source="manual, defaults: 500k (provisional)")
    id_format: str = switch("asked",
        "identifiers that they take: 11 and 29 bits, answered in the form of the request, or one form",
        "asked", "std", "ext",
        source="manual prints four bytes and says standard frame; four public drivers use 11 bits, one 29")
    duplicate: str = switch("",
        "ids with a second servo, as 0x25 or 0x25+0x26, that replies a little later; its key is 1000 + its number",
        source="two servos as shipped share 0x25; replies never take equally long")
    sized: str = switch("either",
        "whether writes state their length: either way; no, and 23, 27, 2B, 2F are refused with 05040001; yes, and 22 "
        "is refused with 06070010 unless 4 bytes are written",
        "either", "no", "yes",
        source="manual: 22 only; XQPOWER tool: 2F and 23; some CANopen servers refuse 22")
    out_of_range: str = switch("abort",
        "a position beyond the range is refused with 06090031/32, or taken as the nearest allowed",
        "abort", "clamp",
        source="both codes are in the manual's list; it does not say when they come")
    save_reply: str = switch("none",
        "a save is not answered, acknowledged, or refused (and then nothing is saved)",
        "none", "ack", "abort",
        source="manual, command 3: no reply; CiA 301 demands one")
    flash_cut: str = switch("old",
        "a save cut short by a restart has kept nothing, or everything",
        "old", "new",
        source="not documented; the driver takes either")
    nmt: str = switch("profile",
        "which form of start and stop they obey",
        "profile", "none", "vendor", "standard",
        source="newer KST: identifier = node; XQPOWER: NMT of CiA 301; manual: none")
    # fmt: on
