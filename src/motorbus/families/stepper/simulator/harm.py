"""What a cable, an adapter or an unlucky moment does to requests, replies and notices, and to which of them.

Most faults are not by chance: the so-many-th of a kind is hit, always in the same way; a test that fails fails again.
Errors of single bytes are by chance, as is the place of a notice in a dump; with the same seed they come again too.
Whatever is done is remarked, for a host can only guess it, and a test wants to know what it has to forgive.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from random import Random
from typing import Final

from motorbus.families.stepper import wire
from motorbus.families.stepper.simulator.switches import Switches

NOISE: Final = b"\x00\x55\xff"
"""What comes before a reply with reply_fault=noise; its end might begin a header."""
OTHER: Final = bytes.fromhex("FFAA030D0000")
"""The reply that stands for one to another command."""
_OF_REPLY: Final = {
    "lost": "is lost",
    "late": "is late",
    "doubled": "comes twice",
    "bit": "has a bit flipped",
    "other": "is replaced by that of another command",
    "split": "comes in two pieces",
    "noise": "has noise before it",
}
_OF_NOTICE: Final = {
    "lost": "is lost",
    "doubled": "comes twice",
    "late": "is late",
    "early": "waits for the next reply",
    "inside_dump": "waits for the next dump",
}
_OF_DUMP: Final = {"short": "lacks its second half", "byte": "lacks a byte"}


class Harm:
    """Does what its switches say; `remark` is told of it."""

    def __init__(self, switches: Switches, remark: Callable[[str], object]) -> None:
        self._switches = switches
        self._remark = remark
        self._random = Random(switches.seed)
        self._seen: Counter[str] = Counter()
        self._passed = 0
        self._echoes = False
        self._heard_at = 0.0

    def change(self, switches: Switches, *, reseed: bool) -> None:
        """From now on as these say: counted from here, with `reseed` chance begins afresh as well."""
        self._switches = switches
        self._seen.clear()
        if reseed:
            self._random = Random(switches.seed)

    # -- what the host sends --------------------------------------------------------------------------------------

    def echoed(self, data: bytes, at: float) -> bytes:
        """What of this the line hands back."""
        if self._switches.echo != "six":
            return data if self._switches.echo == "yes" else b""
        length = wire.REQUEST_LENGTH
        if at - self._heard_at > self._switches.rx_gap_ms / 1000:
            self._passed += -self._passed % length  # after a pause a request begins
        self._heard_at = at
        back = bytearray()
        for place, byte in enumerate(data, self._passed):
            if place % length == 0:
                self._echoes = self._hit("echo")
            if self._echoes and place % length < wire.REPLY_LENGTH:
                back.append(byte)
        self._passed += len(data)
        if back:
            self._remark(f"fault: {_hex(back)} is an echo")
        return bytes(back)

    def misheard(self, data: bytes) -> bytes:
        """What of this arrives at the device."""
        return self._garbled(data, self._switches.request_errors, "what the host sent")

    def unheard(self, request: bytes) -> bool:
        """Whether the device misses this request altogether."""
        missed = self._switches.reply_fault == "unheard" and self._hit("request")
        if missed:
            self._remark(f"fault: the request {_hex(request)} is not heard")
        return missed

    # -- what the device says ---------------------------------------------------------------------------------------

    def spoken(self, data: bytes) -> bytes:
        """What of this arrives at the host."""
        return self._garbled(data, self._switches.byte_errors, "what it said")

    def of_reply(self, data: bytes) -> list[tuple[float, bytes]]:
        """The pieces in which a reply or a dump comes, and how much later than it should each of them begins (s)."""
        fault = self._switches.reply_fault
        if fault not in _OF_REPLY or not self._hit("reply"):
            return [(0.0, data)]
        self._remark(f"fault: the reply {_hex(data[: wire.REPLY_LENGTH])} {_OF_REPLY[fault]}")
        late = self._switches.fault_time
        if fault == "split":
            return [(0.0, data[:3]), (late, data[3:])]
        copies = {"lost": 0, "doubled": 2}.get(fault, 1)
        return [(late if fault == "late" else 0.0, self._spoilt(data, fault))] * copies

    def of_notice(self) -> str:
        """Which fault hits this notice, "" for none."""
        fault = self._switches.notice_fault
        if fault not in _OF_NOTICE or not self._hit("notice"):
            return ""
        self._remark(f"fault: the notice {_OF_NOTICE[fault]}")
        return fault

    def of_dump(self, data: bytes) -> bytes:
        """What is left of a dump."""
        fault = self._switches.dump_fault
        if fault not in _OF_DUMP or not self._hit("dump"):
            return data
        self._remark(f"fault: the dump of project {data[3]} {_OF_DUMP[fault]}")
        return data[:113] if fault == "short" else data[:60] + data[61:]

    def with_notice(self, data: bytes) -> bytes:
        """A dump that has a notice between two of its bytes, somewhere behind its header."""
        place = wire.REPLY_LENGTH + int(self._random.random() * (len(data) - wire.REPLY_LENGTH))
        self._remark(f"fault: a notice in the dump of project {data[3]}, before byte {place}")
        return data[:place] + wire.NOTICE + data[place:]

    def _spoilt(self, data: bytes, fault: str) -> bytes:
        if fault == "noise":
            return NOISE + data
        if fault == "other":
            return OTHER if data[:4] != OTHER[:4] else OTHER[:3] + b"\x0c" + OTHER[4:]
        if fault == "bit":
            number = self._seen["reply"] // self._every
            at = number % wire.REPLY_LENGTH
            return data[:at] + bytes((data[at] ^ 1 << number % 8,)) + data[at + 1 :]
        return data

    def _garbled(self, data: bytes, probability: float, what: str) -> bytes:
        if not probability:
            return data
        draw = self._random.random
        found = bytes(byte ^ 1 + int(255 * draw()) if draw() < probability else byte for byte in data)
        wrong = sum(one != other for one, other in zip(data, found, strict=True))
        if wrong:
            self._remark(f"fault: {wrong} of {len(data)} bytes of {what} arrive wrong")
        return found

    @property
    def _every(self) -> int:
        return self._switches.fault_every

    def _hit(self, kind: str) -> bool:
        """Count one more of this kind; whether it is one that is hit."""
        self._seen[kind] += 1
        return self._seen[kind] % self._every == 0


def _hex(data: bytes | bytearray) -> str:
    return data.hex(" ").upper()
