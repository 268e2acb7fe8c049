"""Why a row misses when it does: what limits that very measure, in words that are true of any run.

A figure that belongs to a reason is measured in the same run and stands in the note of its row; here are none.
"""

from __future__ import annotations

from typing import Final

from bench.row import Row

REASONS: Final[dict[str, dict[str, str]]] = {
    "1": {
        "read1": "one value is asked for, so all that is done for any exchange shows: the bus is taken, what "
        "came unasked is looked for, the servo is in doubt until it has answered, the answer is checked and "
        "counted",
        "sync-read": "each packet is checked by id, length and sum, and each count becomes rad by the settings "
        "that its own servo has at present",
        "cycle": "each goal comes in rad, is rounded, and is judged by the limits of its servo before it leaves; "
        "no peer does that. No machine file is in force here, whose limits would be judged as well",
    },
    "2": {
        "raw": "the bytes are handed over by id once each packet is checked by id, length and sum; all of it is "
        "done in Python, and there is little else to save",
        "6x15": "every quantity of every servo becomes a value in SI units by the settings of that servo, and "
        "its alarms are told; each of these values is an object that Python makes",
    },
    "3": {
        "system calls": "writing, looking for what came unasked, waiting and reading are one call each; an "
        "answer that does not come at one look costs another wait and another reading",
    },
    "4": {
        "sync-read": "writing, waking up and reading are the kernel's and cost both the same; what remains of "
        "ours is in row 1, and theirs is compiled",
        "cycle": "the goals leave in one write with the question, which saves most of the system calls that "
        "rustypot makes; what that saves is spent on judging the goals in an interpreter, as in row 1, while what "
        "rustypot does is compiled, and judges nothing",
    },
    "5": {
        "rustypot": "an answer of one packet leaves nothing to be saved by reading all of it at once, so an "
        "interpreter is compared with compiled code",
        "feetech-servo-sdk": "the SDK waits in a busy loop, which is cheap only here, where the answer is there "
        "at once; writing, waking up and reading cost both the same",
    },
    "6": {
        "in one burst: of the wire limit": "what the kernel takes to wake two processes is not on the wire: that "
        "is what the bare loop of the same round lacks too. The rest is ours, between an answer and the next "
        "request; after each wait that runs with cold caches, and takes longer than in row 1",
        "in pieces: of the wire limit": "what the kernel takes to wake two processes is not on the wire: that is "
        "what the bare loop of the same round lacks too. The rest is ours, between the last piece of an answer and "
        "the next request, and each piece is looked at by itself",
        "cycle rate": "between the last byte of one cycle and the first of the next the answer is checked and "
        "the goals are judged, after a wait, with cold caches, so it takes longer than in row 1; rustypot's is "
        "compiled and judges nothing",
    },
    "7": {
        "in one burst: processor time per cycle, rustypot": "both sleep until the answer is there, and both wake "
        "up with cold caches, which an interpreter needs more of than compiled code: without the waiting the same "
        "cycle is in row 4",
        "in pieces: processor time per cycle, rustypot": "each packet may wake whoever waits, and every waking "
        "and every look at what has come so far takes longer in an interpreter than in compiled code",
        "feetech-servo-sdk": "the SDK waits in a busy loop, so its figure is about the length of a cycle; ours "
        "is what waking up costs on this machine, and what is done after it with cold caches",
    },
    "8": {
        "streaming": "the receiver tries each byte of a damaged packet as the first of the next one, and finds the "
        "packets that the SDK drops; each packet becomes an object",
    },
    "10": {
        "read request": "the first reading of a servo makes more than a packet: which packet is due, how long it may "
        "take, and what its bytes mean in SI units are found out, and kept for all further ones",
        "sync write": "goals come in rad, s and rad/s, are rounded, and are judged by the limits of their "
        "servos; the peers are given counts",
    },
    "11": {
        "async": "an event loop waits by its own selector, runs a callback and switches to the task for each "
        "answer; the blocking call waits for the one descriptor",
    },
    "12": {
        "processor time per time-out": "what runs after a wait runs cold, which without the waiting is no such "
        "figure (an exchange is in row 5); ours sends a probe that no late reply can answer, counts, and says what "
        "was sent and what to do",
        "after the deadline": "the deadline passes while the process sleeps: the kernel wakes it when it comes "
        "to it, and whatever else runs on the machine comes first; the error is worded after that",
    },
    "13": {
        "scan of 254 ids": "ids are asked one after the other, and who is silent is asked twice and waited for "
        "as long as a servo may think; to that each waiting adds the time until the process is woken",
        "missed a servo": "an answer that comes later than a servo may think counts as none: the other end is a "
        "process, which the machine may hold up, and a servo held up twice is missed",
    },
    "14": {
        "import of the package": "the errors and the names of what is loaded on demand are there from the "
        "beginning; compiled modules still have to be found and read, one file each",
        "loaded by": "something that the import runs needs one of them",
    },
    "15": {
        "KST": "in the first and last moments the wire is not full",
    },
    "scale": {
        "line full": "each request is taken apart, obeyed and answered in Python; what that takes of a core is "
        "in proportion to the requests, and the line holds no more of them",
        "axes in memory": "each goal makes a movement that is worked out, and each reading asks where it is, one "
        "after the other in one process; an axis that is told less costs less",
    },
}
"""By number of a row: words that its measure and peer have, and the reason; the first that fits counts."""


def reason(row: Row) -> str:
    """Why this row misses, if it does; "" when nobody has said so."""
    measure = f"{row.measure}, {row.peer}"
    return next((why for words, why in REASONS.get(row.number, {}).items() if words in measure), "")
