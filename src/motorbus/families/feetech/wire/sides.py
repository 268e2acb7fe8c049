"""Who has said a packet, a host or a servo, where a recording does not tell.

Instruction and status packets have the same shape, and a fifth byte of 1 to 13 can be an instruction as well as alarm
bits. So it counts what was asked before: a packet with the id and the length that are due is the answer, one that
repeats the last instruction is its echo or an answer, and the others are instructions if they can be carried out.
"""

from __future__ import annotations

from functools import partial
from operator import itemgetter
from typing import Final

from motorbus.core.capture import EITHER, REPLY, REQUEST, PacketFacts
from motorbus.families.feetech.wire.packets import (
    BROADCAST,
    RULES,
    Instruction,
    decode_sync_read,
    suits,
)

ID: Final = 2
LENGTH: Final = 3
CODE: Final = 4
_SURE: Final = bytes(set(range(256)) - set(RULES))
"""Fifth bytes that are no instruction."""
_ID = itemgetter(ID)
_CODE = itemgetter(CODE)


class Sides:
    """Kinds, ids and fifth bytes of packets in the order in which they were said; see `core.capture.Cutter.tell`."""

    __slots__ = ("_kind", "_last", "_owed")

    def __init__(self, way: str = "") -> None:
        self._kind = {"rx": REPLY, "tx": REQUEST}.get(way)
        self._last: bytes | None = None
        self._owed: dict[int, int] = {}  # by id: so many bytes of parameters has the answer that is due

    def tell(self, packets: list[bytes]) -> PacketFacts:
        """Of the next packets, each whole and sound. Only what was said before makes it necessary to look at once."""
        kind = self._kind
        if (
            kind is None
            and not self._owed
            and not may_ask(bytes(map(_ID, packets)), bytes(map(_CODE, packets)))
        ):
            kind = REPLY
        if kind is not None:
            return partial(_told, packets, kind)
        kinds = [self._side(packet) for packet in packets]
        return lambda: (kinds, *_said(packets))

    def _side(self, data: bytes) -> int:
        id, code, parameters = data[ID], data[CODE], data[5:-1]
        if data == self._last and id != BROADCAST:
            return EITHER
        due = self._owed.pop(id, None)
        if id != BROADCAST and (due == len(parameters) or not suits(code, parameters)):
            return REPLY
        self._last = data
        self._owed.update(_due(id, code, parameters))
        return REQUEST


def _told(packets: list[bytes], kind: int) -> tuple[list[int], bytes, bytes]:
    """Packets that are all of this kind."""
    return [kind] * len(packets), *_said(packets)


def _said(packets: list[bytes]) -> tuple[bytes, bytes]:
    return bytes(map(_ID, packets)), bytes(map(_CODE, packets))


def may_ask(ids: bytes, codes: bytes) -> bool:
    """May any of the packets with these ids and fifth bytes be an instruction?"""
    return BROADCAST in ids or bool(codes.translate(None, _SURE))


def _due(id: int, code: int, parameters: bytes) -> dict[int, int]:
    """Whose answers an instruction that can be carried out calls for, and of how many bytes."""
    if code == Instruction.SYNC_READ and (request := decode_sync_read(parameters)):
        return dict.fromkeys(request.ids, request.length)
    if id == BROADCAST:
        return {}
    return {id: parameters[1] if code == Instruction.READ else 0}
