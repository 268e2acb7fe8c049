"""What nobody has settled about a real KST CAN servo, each as a named switch with a default and its source.

The manual of these servos is five pages, the public drivers disagree with it and with each other, and no hardware
was at hand. A simulator that guesses in silence would teach its users the guess; so each doubt is chosen here, by
name, and a host can be tested with every choice: `kst:sim,ids=0x25,out_of_range=clamp`. "Manual" is the KST CAN
protocol manual; the public drivers are named by what they drive.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch
from motorbus.families.kst.profiles import DEFAULT_RATE, RATES

_BYTE = (0, 255)
_WORD = (-32768, 32767)
_ANY = (-273.0, 1e9)
_POSITIVE = (1e-6, 1e9)
_ASSUMED = "an assumption, no source"


@dataclass(frozen=True, slots=True, kw_only=True)
class Switches:
    """How the simulated servos behave where real ones differ or nobody knows.

    Times are in seconds (those named so in milliseconds), positions in raw counts.
    """

    # -- which bus it is --------------------------------------------------------------------------------------

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
    collision: str = switch(
        "errors",
        "unequal answers of one id end in error frames, or go through one by one once a node turns error passive",
        "errors",
        "passive",
        source="ISO 11898: 16 errors of a transmitter make it error passive; what follows differs by controller",
    )
    turnaround: float = switch(
        0.0001, "s from the end of a request to the beginning of its answer", source=_ASSUMED
    )

    # -- the SDO server ---------------------------------------------------------------------------------------

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
    beyond_limits: str = switch(
        "clamp",
        "a position in the range but beyond the travel limits goes as far as the limit, or is refused",
        "clamp",
        "abort",
        source="not documented",
    )
    broadcast_read: bool = switch(
        True,
        "a read of node 0 is answered by everyone",
        source="a public demo of a newer protocol finds all servos by one broadcast read of 0x3000",
    )
    broadcast_ack: bool = switch(True, "a write to node 0 is answered by everyone", source="not documented")
    pending_id: str = switch(
        "pending",
        "before the restart 0x3000 reads the id that was written, or the one in force",
        "pending",
        "active",
        source="not documented",
    )
    bit_rate_readable: bool = switch(
        False, "the bit-rate code, 0x3001, can be read", source="manual, command 1, shows the write only"
    )
    abort_mux: str = switch(
        "echo",
        "a refusal repeats index and sub-index, the index with sub-index 0, or 0:0",
        "echo",
        "index-only",
        "zero",
        source="manual, command 9: index as in the request; the sub-index is not mentioned",
    )
    abort_order: str = switch(
        "little",
        "the code of a refusal stands with its low byte first, or with its high byte first",
        "little",
        "big",
        source="CiA 301: low byte first; the manual prints the high word first",
    )
    status_6002: str = switch(
        "position",
        "0x6002 tells the position, or the two status bytes x1 and x2",
        "position",
        "x1x2",
        source="manual, commands 6 and 7: one frame, two meanings",
    )
    x1: int = switch(0, "the first status byte", source="manual, command 7: defined as needed", span=_BYTE)
    x2: int = switch(0, "the second status byte", source="manual, command 7: defined as needed", span=_BYTE)
    firmware: str = switch(
        "1.00",
        "the version string of 0x100A; one of more than four characters is told in segments",
        source="manual, command 8: four characters; CiA 301 makes 0x100A a string of any length",
    )
    software: str = switch(
        "1.00", "the version string of 0x100B, where there is one", source="a public demo of a newer protocol"
    )

    # -- what is kept -----------------------------------------------------------------------------------------

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
    flash_reads: str = switch(
        "lost",
        "reads during a save are lost, or told in bytes of erased flash (FF); writes are lost",
        "lost",
        "transitional",
        source="the same driver: lost, or with transitional values",
    )
    flash_cut: str = switch(
        "old",
        "a save cut short by a restart has kept nothing, or everything",
        "old",
        "new",
        source="not documented; nothing is the cruel one",
    )
    position: int = switch(0, "where they stand at first, in raw counts", source=_ASSUMED, span=_WORD)
    default_position: int = switch(
        0,
        "the target after a restart, in raw counts",
        source="manual, command 5: back to the default value, which it does not tell",
        span=_WORD,
    )
    after_restart: str = switch(
        "stay",
        "after a restart they stand where they stand, or go to the default position",
        "stay",
        "move",
        source="manual, command 5, tells of the value and not of the shaft",
    )
    old_target: str = switch(
        "follows",
        "a new mid point or sense leaves the shaft where it is, or the target keeps its number and the shaft sets off",
        "follows",
        "kept",
        source="not documented; kept is the cruel one",
    )
    reversed_limits: str = switch(
        "mirror",
        "in the reversed state a travel limit that is written changes the other one too, or does not",
        "mirror",
        "independent",
        source="a public flight-controller driver: changing one also changes the other; how is not told",
    )
    reverse_rolls_back: bool = switch(
        False,
        "the reverse bit is lost at a restart although it was saved",
        source="a public flight-controller driver: a write can fail or roll back",
    )

    # -- what they say unasked ----------------------------------------------------------------------------------

    nmt: str = switch(
        "profile",
        "which form of start and stop they obey",
        "profile",
        "none",
        "vendor",
        "standard",
        source="newer KST: identifier = node; XQPOWER: NMT of CiA 301; manual: none",
    )
    needs_start: str = switch(
        "profile",
        "positions are acknowledged and ignored until a start; by the profile that is so for XQPOWER",
        "profile",
        "yes",
        "no",
        source="remark in a public XQPOWER module",
    )
    report_form: str = switch(
        "sdo",
        "positions are reported on 0x580 + id, on 0x180 + id, or on both",
        "sdo",
        "pdo",
        "both",
        source="newer KST: 0x580 + id; XQPOWER: seen on both",
    )
    reports_ms: float = switch(
        0.0,
        "report from power-up on every so many milliseconds; 0: only when started, as 0x2200 says",
        source="made for tests of reports that collide with answers",
    )
    boot_notice: bool = switch(
        False,
        "they say that they start, as CiA 301 has it, whenever their supply comes back",
        source="CiA 301: a heartbeat of state 0; the manual has none, and neither has any public driver",
    )
    voltage: float = switch(7.4, "their supply in V", source=_ASSUMED)
    low_voltage: float = switch(6.0, "the supply in V below which the alarm comes", source=_ASSUMED)

    # -- how they move --------------------------------------------------------------------------------------------

    speed: float = switch(
        7.0, "top speed in rad/s", source=f"{_ASSUMED}; 0.15 s for 60 degrees is usual", span=_POSITIVE
    )
    acceleration: float = switch(100.0, "acceleration in rad/s²", source=_ASSUMED, span=_POSITIVE)
    temperature: float = switch(25.0, "temperature of the surroundings in °C", source=_ASSUMED, span=_ANY)
