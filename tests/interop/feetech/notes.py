"""Where a call of a stranger's library and motorbus differ, and why: one note for each name that a step may give.

Facts about servos have the source they have everywhere here; facts about a library were seen while its session ran.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple


class Note(NamedTuple):
    """What they do, what motorbus does, and why."""

    they: str
    we: str


NOTES: Final[Mapping[str, Note]] = MappingProxyType(
    {
        "first-alarm": Note(
            "Of several alarms the text names the first only; the error byte itself is handed on whole.",
            "Every alarm is named, with the reading and the limit it broke; bits nobody defined are shown too.",
        ),
        "bit-4": Note(
            "Bit 4 of the error byte has no text.",
            "It is named: the angle limit (STS3215 memory table V3.6); later tables leave it out.",
        ),
        "error-above-0x7f": Note(
            "A packet whose error byte is above 0x7F counts as noise and is thrown away.",
            "Any error byte is accepted. Bit 7 is undefined and is shown as such; the data of the packet count.",
        ),
        "max-id": Note(
            "The constant MAX_ID is 252, so whoever scans up to it misses 253; the calls themselves take 253.",
            "Ids are 0 to 253 (FEETECH serial bus servo protocol manual V1.01), and `scan` asks them all.",
        ),
        "broadcast-ping-sdk": Note(
            "A PING to everyone is not sent by one of them, and sent but not listened for by the other.",
            "`ping --broadcast` is there for whoever asks for it; nothing sends it by itself.",
        ),
        "ping-reads": Note(
            "PING is followed by a READ of the model number, which it takes for one word of the handler's order.",
            "PING is one packet. `info` reads registers 0 to 4 and finds the byte order by them.",
        ),
        "sticky-port": Note(
            "Between `txPacket` and `rxPacket` the port counts as in use. Whoever is interrupted in between leaves it "
            "so, and every later call gives COMM_PORT_BUSY.",
            "A transaction ends in any case; no flag outlives it.",
        ),
        "frame-of-250": Note(
            "Packets of more than 250 bytes are refused.",
            "The length byte allows 259 bytes in all, which is the bound here.",
        ),
        "four-bytes": Note(
            "There are calls for values of four bytes: two words, the low one first, each in the handler's order.",
            "There are none: a value has at most two bytes (FEETECH serial bus servo protocol manual V1.01, 1.1).",
        ),
        "zero-for-nothing": Note(
            "Where nothing was received the value is 0, and only the second number of the answer says so.",
            "A missing reading is an error or is left out, and never a number.",
        ),
        "unread-answer": Note(
            "`…TxOnly` leaves the acknowledgement in the input buffer, where the next call finds it and may take it "
            "for its own. The bytes still arrive.",
            "Every answer that is due is waited for and consumed.",
        ),
        "no-refusal": Note(
            "A write to a read-only register succeeds.",
            "A servo acknowledges receipt and has no code for a refusal. A read-only row is refused before anything "
            "is sent, and what matters is read back.",
        ),
        "no-answer-to-sync-write": Note(
            "Success of a SYNC WRITE means that it was sent.",
            "So it is here; who needs to know reads back, which the protected writes do by themselves.",
        ),
        "first-silent": Note(
            "SYNC READ gives up at the first servo that is silent, and the data of those behind it are lost; asked "
            "for nevertheless they are 0.",
            "Answers are collected by id, in whatever order; those missing are reported one by one.",
        ),
        "success-though-missing": Note(
            "SYNC READ waits the whole time out when one servo is silent, and its result is that of the last servo "
            "of the list: success here although one is missing. Only `isAvailable` tells.",
            "It ends as soon as nobody can follow any more, and says who is missing.",
        ),
        "no-sync-read": Note(
            "SCS servos do not answer SYNC READ (lerobot and rustypot both say so), and the call times out.",
            "Groups with such servos are read one by one, for the table says which map lacks it.",
        ),
        "clear-flushes-output": Note(
            "`clearPort` waits until everything is sent and does not drop what was received, whatever its name.",
            "What was received late is discarded before the next request.",
        ),
        "no-76800": Note(
            "76800 bit/s, which is baud code 5, cannot be set; 57600 and 38400 can.",
            "All twelve rates can be opened, those without a code of their own in termios too.",
        ),
        "wall-clock": Note(
            "Timeouts follow the wall clock and are fixed: 34 ms more than the wire needs, or 50 ms. In the newer SDK "
            "`syncReadTx` sets none, so `readRx` after it has what the last call has left.",
            "Timeouts follow a clock that never jumps; the deadline is worked out from rate, return delay and store "
            "time, and can be set.",
        ),
        "global-order": Note(
            "The byte order is one for the whole module: a second handler changes it for the first.",
            "The byte order belongs to the register map of each servo; both orders share a bus.",
        ),
        "spill": Note(
            "A magnitude that does not fit spills into the sign bit.",
            "It is refused before anything is sent.",
        ),
        "twos-complement": Note(
            "A negative goal leaves in two's complement: -40 as 0xFFD8, which the servo takes for -32728.",
            "Signed registers are sign-magnitude (FEETECH SDK, SCServo: bit 15 of the goal), and so is what is sent.",
        ),
        "zero-torque": Note(
            "The burst from 41 on has zeros at 44 and 45. On HLS that is the goal torque: 0 mA, and it never moves.",
            "The map of the servo decides what a move writes; in position mode it is never 0 there.",
        ),
        "wrong-class": Note(
            "The class of one family is obeyed to the letter by servos of another: words with the bytes swapped, the "
            "lock at 55 where there is none, or at 48 where the torque limit is (1 of 1000: limp). The checksum sees "
            "nothing of it.",
            "The map is chosen by firmware and byte order, and no other is ever used on that servo.",
        ),
        "number-swapped": Note(
            "The model number is read in the order of the controller and not of the servo.",
            "It is read in the order that registers 0 to 4 tell.",
        ),
        "other-capability": Note(
            "Byte order and SYNC READ are those of the controller's own servo; on another family they are wrong.",
            "Both belong to the map of the servo that is there.",
        ),
        "baud-codes": Note(
            "Codes 5, 6, 7 are taken for 57600, 38400, 19200. Asked for 57600 it sets 76800, and the servo is lost.",
            "5, 6, 7 are 76800, 57600, 38400, as in every source of the vendor (SMS_STS.h, SCSCL.h).",
        ),
        "no-rates": Note("It knows no baud rates for this servo.", "The codes are those of the map."),
        "broadcast-collides": Note(
            "A broadcast PING with several servos: here they answer at once and garble each other.",
            "Forbidden by the manual with several servos; the simulator does either, `broadcast_ping` decides. "
            "Ours scans one id after the other.",
        ),
        "no-broadcast-ping": Note(
            "SCS servos do not answer a broadcast PING (lerobot, rustypot): refused by their controllers, in vain by "
            "that of the STS3215.",
            "Scanning asks one id after the other and needs none.",
        ),
        "scan-without-number": Note(
            "`scan` and `broadcast_scan` can never succeed: they look for a register `model_number`, and this "
            "controller calls it `model`.",
            "A servo is found by PING, whatever its model.",
        ),
        "all-or-nothing": Note(
            "One silent servo makes an exception of the whole SYNC READ.",
            "Those who answered are there, those missing are named.",
        ),
        "id-unlocked": Note(
            "The lock is not opened, so the new id is gone at the next power-up. SYNC WRITE can renumber many at once.",
            "`set_id` opens the lock, checks that nobody has the id, verifies and closes the lock again.",
        ),
        "rate-unlocked": Note(
            "The raw code goes out with the lock closed: the servo is at the new rate until it is switched off.",
            "`set_baud` takes a rate, opens the lock, verifies at the new rate and closes the lock again.",
        ),
        "level-0": Note(
            "At level 0 a WRITE is not answered, the one that sets it neither: it times out and has succeeded.",
            "The level is read at first contact; at level 0 a write is confirmed by reading.",
        ),
        "reboot-is-bootloader": Note(
            "`reboot` sends 0x08, by which a servo enters its bootloader and is deaf for a while; no answer comes.",
            "0x08 is decoded and explained, and never sent.",
        ),
        "reset-keeping": Note(
            "Called as it is, with its own defaults, `factory_reset` is refused: 'not supported'. Only with both "
            "arguments False does anything go out.",
            "`factory_restore` says what it will do and needs consent.",
        ),
        "factory-reset": Note(
            "It sends 0x06 and returns at once; the servo is deaf for about a second (servolab).",
            "`factory_restore` waits for the servo, looks for it under both ids and rates, and reads back.",
        ),
        "lock-follows-torque": Note(
            "Torque off opens the EEPROM lock, torque on closes it: whatever is written while limp is stored.",
            "The lock is opened for a protected write only, and closed by it.",
        ),
        "left-unlocked": Note(
            "Id or rate are stored, and the lock is left open.",
            "The lock is closed again, at the new id and the new rate, and that is verified.",
        ),
        "knows-no-hls": Note("It knows no HLS at all.", "HLS is one of the six maps."),
        "names": Note(
            "521 is called STS3036 and 1290 SCS0043, and STS3032 is not found.",
            "521 is STS3032 and 10.5 STS3045BL (FD 1.9.8.5). Its typed calls for the SCS0043 send the high byte "
            "first while its definition says little: read so, the number is 5.10, which FD does not know.",
        ),
        "no-register": Note(
            "Its table has a register where this map has none: reading gives 0, a write is acknowledged and lost.",
            "Only rows of the servo's own map exist.",
        ),
        "other-register": Note(
            "What it reads and writes is another register in this map, and acknowledged all the same.",
            "An address means nothing without its map.",
        ),
        "other-address": Note(
            "In this map the register of that name is at another address.",
            "The address is that of the map, with its source.",
        ),
        "other-order": Note(
            "The two bytes are swapped for this servo: a valid packet with another number.",
            "The byte order belongs to the row.",
        ),
        "raw-order": Note(
            "What has `raw` in its name, and the model, is not the servo's number but has its bytes swapped: the "
            "high byte comes first on SCS, and the units alone turn it.",
            "A raw value is the number that the register holds, on every servo.",
        ),
        "width-24": Note(
            "Registers 24 and 25 are read and written as one word.",
            "They are two registers of a byte on STS and HLS: least starting force and bound of the integral (FD "
            "1.9.8.5); older tables have one word there.",
        ),
        "factory-register": Note(
            "It has calls that write this register: acknowledged, and nothing changes, but for 85 in the simulator.",
            "It is the factory's (FD 1.9.8.5) and cannot be written.",
        ),
        "unsigned": Note(
            "The sign bit is not known: -100 reads as 1124 (PWM duty, bit 10) or 32868 (current, bit 15).",
            "The sign bit of the row is honoured: bit 10 of 44 (measured by servolab), bit 15 of 69 (FEETECH SDK).",
        ),
        "sign-bit": Note(
            "It takes bit 11 for the sign of the offset.",
            "On HLS that is bit 15 (HLS memory table); bit 11 is right on STS.",
        ),
        "zero-is-middle": Note(
            "Angles are counted from the middle: on STS from 2048, on SCS from 511 of 1024 counts over 300° (270° for "
            "the SCS0043).",
            "Angles are counted from raw 0, so a goal of 0 rad is raw 0.",
        ),
        "turn-of-4095": Note(
            "Velocities are worked out by a turn of 4095 counts, offsets by half a turn of 2047: a step of 0.02 % or "
            "0.05 % too much.",
            "A turn has 4096 counts; the speed unit follows from bit 2 of the phase register, which nobody else asks.",
        ),
        "ten-bits": Note(
            "Only ten bits of a speed are read, and none of its sign is ever written.",
            "The whole magnitude counts.",
        ),
        "whole-percent": Note(
            "Written in whole percent; fractions are cut.", "In steps of 0.1 %, as the register has."
        ),
    }
)
"""Name -> note."""

NOT_RUN: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rustypot: `AxPyController`, `MxPyController`, `Xl320PyController`, `Xl330PyController`, `Xl430PyController`": (
            "servos of another make, with another table and in part another protocol"
        ),
        "rustypot: `Orbita2dFocPyController`, `Orbita2dPoulpePyController`, `Orbita3dFocPyController`, "
        "`Orbita3dPoulpePyController`": "actuators of another make",
        "FEETECH's class `hls`, and `reSet` (0x0A) and `reOfsCal` (0x0B)": (
            "only in the vendor's repository; the wheel of ftservo-python-sdk 2.0.1 has none of the three. HLS servos "
            "are spoken to by `sms_sts` and by the calls of the packet handler"
        ),
    }
)
"""What is theirs and not in any session -> why not."""
