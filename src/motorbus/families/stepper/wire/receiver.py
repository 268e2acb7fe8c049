"""What the bytes of a controller are to its host: replies, dumps, the end of a project, and noise.

Everything goes by length and never by pattern. Once a reply has begun, six bytes belong to it; once a dump has begun,
226 do, and none of them is looked at: a distance of 43775 is FF AA 00 on the wire and one of 56814 is EE DD 00. A
notice, EE DD, may come at any moment between two of these, also between a request and its reply.

There is no checksum. So six bytes that no reply can be are given up one by one, for what was lost in front may have
made a reply and the beginning of the next thing look like one. The bytes of a dump are never searched: what is found
there could be the end of a project that has not ended.

States: IDLE; H1 after FF; N1 after EE; REPLY and DUMP while their bytes come. A pause of more than `GAP` between two
bytes ends what has begun; who has no times calls `flush` when nothing more is coming.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Event, Noise, Notification, Reply
from motorbus.families.stepper.wire.frames import (
    DUMP,
    DUMP_LENGTH,
    HEADER,
    NOTICE,
    ONLY,
    REPLY_LENGTH,
    key_of,
    reply_fault,
)

GAP: Final = 0.05
"""s; 48 byte times at 9600 baud, far above the 16 ms that an USB adapter may hold bytes back: an assumption."""
COMPLETED: Final = "completed"
"""The kind of the notice that a project has run to its end."""
_IDLE: Final = 0


class Receiver:
    """Events out of bytes that may be cut anywhere. Each byte that is fed comes out in exactly one event.

    `node` is told in notices. A dump is a `Reply` of 226 bytes. Holds 225 bytes at most and never raises.
    """

    __slots__ = ("_last", "_node", "_rest", "_stray")

    def __init__(self, node: int = ONLY) -> None:
        self._node = node
        self._rest = b""
        self._stray = b""
        self._last: float | None = None

    @property
    def held(self) -> int:
        """How many bytes wait for more."""
        return len(self._rest)

    def feed(self, data: Data, at: float | None = None) -> list[Event]:
        """Take bytes, and if it is known the moment (s) at which they came; give what is complete."""
        if isinstance(data, CanFrame):
            return [Noise(data.data, "foreign")]
        events: list[Event] = []
        if at is not None:
            if self._last is not None and at - self._last > GAP:
                events += self.flush()
            self._last = at if data else self._last
        return events + self._split(data)

    def flush(self) -> list[Event]:
        """Nothing more is coming: what has begun is short, and noise."""
        events: list[Event] = [Noise(self._rest, "framing")] if self._rest else []
        self._rest = b""
        return events

    def _split(self, data: bytes) -> list[Event]:
        events: list[Event] = []
        data = self._rest + data
        position = _IDLE
        while position < len(data):
            size = _size(data, position)
            if not size:
                self._stray += data[position : position + 1]
                position += 1
                continue
            if position + size > len(data):
                break
            self._told(events)
            events.append(self._event(data[position : position + size]))
            position += size
        self._told(events)
        self._rest = data[position:]
        return events

    def _told(self, events: list[Event]) -> None:
        if self._stray:
            events.append(Noise(self._stray, "framing"))
            self._stray = b""

    def _event(self, data: bytes) -> Event:
        if data == NOTICE:
            return Notification(self._node, COMPLETED, data)
        return Reply(0, key_of(data), data)


def _size(data: bytes, at: int) -> int:
    """How many bytes belong to what begins here, as far as can be told now; 0: nothing begins here."""
    have = data[at : at + REPLY_LENGTH]
    for header in (NOTICE, HEADER):
        if have[:2] == header[: len(have)]:
            break
    else:
        return 0
    if header == NOTICE or len(have) < 2:
        return len(header)
    if len(have) < REPLY_LENGTH:
        return REPLY_LENGTH
    if reply_fault(have):
        return 0
    return DUMP_LENGTH if have[2] == DUMP.code else REPLY_LENGTH
