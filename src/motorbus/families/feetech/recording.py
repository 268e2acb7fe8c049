"""Decoder of recorded packets: of servos, of a host, or of both."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.request import Noise
from motorbus.families.feetech import protocol
from motorbus.families.feetech.protocol import BROADCAST, MAX_ID, Instruction


class Recording:
    """Packets of servos and hosts; see `core.recording.RecordingReceiver`.

    Instruction and status packets have the same form. Where the direction is unknown, the packets before decide: a
    packet with the id and length of an expected reply is that reply, a repeated instruction is its echo or a reply, and
    any other packet is an instruction if a servo can execute it.
    """

    def __init__(self, direction: str = "") -> None:
        self._parser: Final = protocol.parser(MAX_ID if direction == "rx" else BROADCAST)
        self._kind: Final = {"rx": "reply", "tx": "request"}.get(direction, "")
        self._last = b""
        self._expected: Final[dict[int, int]] = {}  # bytes of parameters in the reply, by id

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return self._events(self._parser.feed(data))

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the packets in the held bytes, and the remainder as noise."""
        return self._events(self._parser.feed(b"", end=True))

    def _events(self, found: list[tuple[bytes, str]]) -> list[RecordedEvent]:
        return [Noise(data, fault) if fault else self._frame(data) for data, fault in found]

    def _frame(self, data: bytes) -> RecordedFrame:
        id, code, parameters = protocol.decode(data)
        return RecordedFrame(data, self._kind or self._kind_of(data, id, code, parameters), id, code)

    def _kind_of(self, data: bytes, id: int, code: int, parameters: bytes) -> str:
        if data == self._last and id != BROADCAST:
            return "either"
        expected = self._expected.pop(id, None)
        if id != BROADCAST and (expected == len(parameters) or not protocol.suits(code, parameters)):
            return "reply"
        self._last = data
        if code == Instruction.SYNC_READ and len(parameters) >= 3:
            self._expected.update(dict.fromkeys(parameters[2:], parameters[1]))
        elif id != BROADCAST:
            self._expected[id] = parameters[1] if code == Instruction.READ else 0
        return "request"
