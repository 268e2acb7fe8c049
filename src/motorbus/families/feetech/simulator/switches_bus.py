"""What nobody has settled about how a FEETECH servo answers: who, from which id, when, and to which instructions.

These are the first part of `switches.Switches`, which is the one that is used. "By map" means: as is known of the
servos of that register map, and where nothing is known, as the help text says.
"""

from __future__ import annotations

from dataclasses import dataclass

from motorbus.core.switches import switch


@dataclass(frozen=True, kw_only=True)
class BusSwitches:
    """Which servos there are, and how they answer."""

    firmware: str = switch(
        "",
        "the firmware that the servos tell, as 3.9, or one for each joined by +; left out: one that has their map."
        " It also chooses between the maps of a model that has several; an unknown one changes only what is told",
        source="firmware and byte order tell the map: FD 1.9.8.5",
    )
    duplicate: str = switch(
        "",
        "ids that a second servo has as well, as 3 or 3+5; unless reply_jitter is set the second one replies up to"
        " 20 bits later by chance",
        source="new servos all have the id 1, and no servo knows of another",
    )
    servo_baud: int = switch(
        0,
        "the rate the servos are set to, in bit/s; 0: as shipped, or 1000000 where models are mixed that ship unlike",
        0, 1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400, 19_200, 14_400, 9_600, 4_800,
        source="STS and HLS ship with 1000000, SMS with 115200, SCS with 1000000 or 500000 (vendor memory tables)",
    )  # fmt: skip
    baud_codes: str = switch(
        "all",
        "a code of register 6 that its map does not allow (8 to 11 on most) is a rate all the same, or makes it deaf",
        "all",
        "by_map",
        source="twelve codes in public headers; FD 1.9.8.5 allows 0 to 7, 0 to 10 on SCS, all on SMBL",
    )
    echo: bool = switch(
        False,
        "the adapter hears itself: whatever the host sends comes back before any answer",
        source="boards with RX and TX on one wire echo every byte: waveshareteam/ugv_rpi#27",
    )
    broadcast_ping: str = switch(
        "collide",
        "several servos answer a broadcast PING at once and garble each other, or one after the other;"
        " SCS servos never answer one",
        "collide",
        "in_turn",
        source="manual V1.01, 1.1 forbids it with several servos; lerobot and rustypot use it on STS, not on SCS0009",
    )
    sync_read: str = switch(
        "by_map",
        "who answers SYNC READ: all but SCS servos, everyone, or nobody",
        "by_map",
        "yes",
        "no",
        source="lerobot and rustypot: an SCS0009 does not; of other SCS servos nobody has said",
    )
    sync_read_missing: str = switch(
        "wait",
        "when a listed servo is missing the next ones leave its time free, close up, or stay silent",
        "wait",
        "close_up",
        "silent",
        source="open question: order and timing of SYNC READ replies when one is missing",
    )
    second_id: str = switch(
        "silent",
        "a write to the second id of an HLS servo is obeyed and not answered, or answered from its main id",
        "silent",
        "answer",
        source="HLS memory table: accepted for write instructions only; whether it is answered is not documented",
    )
    return_delay: str = switch(
        "heed",
        "register 7 delays the reply by 2 µs each, or is reserved and does nothing; on HLS it is no delay in any case",
        "heed",
        "ignore",
        source="STS3215 memory table V3.6 and SCS memory table: a delay; FD and newer pages: reserved",
    )
    reply_jitter: float = switch(
        0.0,
        "how much later at most a servo begins its reply than its return delay says, by chance (s)",
        source="not measured; `seed` makes the same chances again",
    )
    seed: int = switch(
        0, "where chance begins: the same seed and the same traffic give the same bytes", source="none needed"
    )
    id_ack: str = switch(
        "old",
        "a WRITE of the id is acknowledged from the old id or from the new one",
        "old",
        "new",
        source="lerobot (setup_motor), rustypot (change_id) and sts-suite accept the old id only;"
        " fanhao375/microduck-replica#28: the reply may come from the new id",
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
    clear_turns: str = switch(
        "by_model",
        "instruction 0x0A clears the turn count on HLS and brushless ..BL models, on all, or on none; else silence",
        "by_model",
        "accept",
        "ignore",
        source='FTServo_Python, hls/reset.py; a public STS3215 table ("STBL"); servolab: ignored by firmware 3.10',
    )
    calibrate: str = switch(
        "by_map",
        "instruction 0x0B sets the present position: on HLS and STS, on all that have an offset, or on none",
        "by_map",
        "accept",
        "ignore",
        source="FTServo_Python for HLS; in the dispatcher of STS3215 firmware 3.10 (kuterd/feetech-fw-util)",
    )
    bootloader: str = switch(
        "silent",
        "instruction 0x08 is not answered, or acknowledged before it goes",
        "silent",
        "ack",
        source="not documented",
    )
    bootloader_time: float = switch(
        0.8, "how long it is deaf after instruction 0x08 (s)", source="kuterd/feetech-fw-util: about 800 ms"
    )
    frame_gap: float = switch(
        0.005,
        "a pause after which half a frame is forgotten (s); 0: never, and one wrong length byte swallows what follows",
        source="not documented; without one a wrong length byte makes it deaf for up to 258 bytes",
    )
