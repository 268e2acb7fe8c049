"""The kinds of faults that are known to strike motors on a bus, and what motorbus promises of each: one row, one test.

They were gathered from reports about other programs for such buses. L is what lines and hosts do, D what devices do.
"""

from __future__ import annotations

from typing import Final

ROWS: Final = {
    "L1": "one byte of a reply changed: no wrong value",
    "L2": "one byte lost, inserted or doubled: no wrong value",
    "L3": "bytes changed by chance, 1 % of them: wrong values within the bound that is computed for an 8-bit sum, none"
    " where a reading is confirmed; nothing hangs",
    "L4": "bits turned over by chance: likewise",
    "L5": "a command that is changed and still passes the device's sum: settings are read back",
    "L6": "replies as late as allowed, coarse timers: no false time-out, and each call returns by its deadline",
    "L7": "the late reply to a question that was given up: never taken for the next one",
    "L8": "an echo, whole, partial or damaged, from the start or suddenly: never taken for an answer",
    "L9": "garbage without end: each call ends at its deadline, buffers stay small",
    "L10": "replies in any pieces: the same as in one",
    "L11": "several replies in one piece, noise between them: each is taken once",
    "L12": "the adapter is pulled and comes back, perhaps under another name: an error at once, found again by what it"
    " is, no other one is taken, and no order is given again",
    "L13": "a port that a second program opens: refused, with the process that has it",
    "L14": "a port that does not take what is written: the call ends at its deadline, a stop has a way of its own",
    "L15": "the clock is set, the machine sleeps: nothing ends early or late, a lease is over, nothing moves on",
    "L16": "many threads and tasks on one bus: no mixed frames, no lost or doubled answers",
    "L17": "interrupted at any line: the next exchange is right, nothing stays locked, what was cut is not called done",
    "L18": "only the answer to an order is lost: what must not be done twice is not sent twice",
    "D1": "two FEETECH servos with one id: noticed as far as listening can tell, and no id is written then",
    "D2": "two CAN nodes with one id: noticed, and no id is written then",
    "D3": "a device restarts on the way: noticed, its torque stays off, its goal is forgotten",
    "D4": "an alarm in a reply: the reply still counts, and a stop visits everyone",
    "D5": "a servo that does not acknowledge writes: read back, or the outcome is unknown",
    "D6": "the lock of an EEPROM left open or closed: closed after every change, and seen to be",
    "D7": "the acknowledgement of a new id comes from the old or the new one: right either way",
    "D8": "a template that spoils servos: reserved, read-only and factory registers are refused",
    "D9": "wear of an EEPROM: what is so already is not written again",
    "D10": "power lost during a write, a save or a change of id: old or new in the end, reachable and locked; where a"
    " project of a stepper controller is left with neither, its host is told",
    "D11": "a save that nobody acknowledges and that counts after a restart: never called saved before it is seen",
    "D12": "scanning a running CAN bus at a wrong bit rate: nothing is sent before the rate is known",
    "D13": "bus off, adapter down, nobody acknowledges: told within a second, and what waited is not sent later",
    "D14": "text protocols for CAN without a checksum: damaged frames are refused where that can be seen",
    "D15": "the program dies with torque on, and connects again: nothing moves by that",
}
