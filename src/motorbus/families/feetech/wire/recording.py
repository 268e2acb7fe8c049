"""Packets of a recorded FEETECH line: of servos, of a host, or of both."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.families.feetech.wire.packets import BROADCAST, MAX_ID, Instruction, decode_sync_read, suits
from motorbus.families.feetech.wire.stream import Stream


class Recording:
    """A receiver of recorded packets; see `core.recording.RecordingReceiver`.

    Instruction and status packets have the same form, and a fifth byte of 1 to 13 may be an instruction or alarm bits.
    Where the direction is unknown, the packets before decide: a packet with the id and length of an expected reply is
    that reply, a repetition of the last instruction is its echo or a reply, and any other packet is an instruction if
    a servo can execute it.
    """

    code_meaning: Final = "the fifth byte: the instruction of a request, the alarm bits of a reply"

    def __init__(self, direction: str = "") -> None:
        self._stream: Final = Stream(MAX_ID if direction == "rx" else BROADCAST, self._frame)
        self._kind: Final = {"rx": "reply", "tx": "request"}.get(direction)
        self._last = b""
        self._expected: Final[dict[int, int]] = {}  # bytes of parameters in the reply, by id

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._stream.feed(data)

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the packets in the held bytes, and the remainder as noise."""
        return self._stream.flush()

    def _frame(self, packet: bytes) -> RecordedFrame:
        id, code = packet[2], packet[4]
        if self._kind is not None:
            return RecordedFrame(packet, self._kind, id, code)
        if packet == self._last and id != BROADCAST:
            return RecordedFrame(packet, "either", id, code)
        parameters = packet[5:-1]
        expected = self._expected.pop(id, None)
        if id != BROADCAST and (expected == len(parameters) or not suits(code, parameters)):
            return RecordedFrame(packet, "reply", id, code)
        self._last = packet
        if code == Instruction.SYNC_READ and (request := decode_sync_read(parameters)):
            self._expected.update(dict.fromkeys(request.ids, request.length))
        elif id != BROADCAST:
            self._expected[id] = parameters[1] if code == Instruction.READ else 0
        return RecordedFrame(packet, "request", id, code)
