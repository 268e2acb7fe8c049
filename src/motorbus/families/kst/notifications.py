"""Frames that servos send unsolicited, the frames that start and stop them, and the receiver of a bus.

    report      0x580 + node or 0x180 + node   4 bytes: position (2), 0 0
    alarm       0x380 + node                   4 bytes
    emergency   0x080 + node                   8 bytes (CiA 301)
    heartbeat   0x700 + node                   1 byte (CiA 301)

The length of a frame tells a report from a reply, never the first byte. Source: the KST CAN protocol manual has none of
this; public drivers of these servos (a autopilot driver, an STM32 driver, a driver of XQPOWER servos) do.
"""

from __future__ import annotations

from collections import Counter
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data, Event, Noise, Notification, Reply
from motorbus.families.kst import sdo

REPORT_LENGTH: Final = 4  # data bytes of a report and of an alarm
NOTIFICATIONS: Final = {
    sdo.REPLY: ("report", REPORT_LENGTH),
    0x180: ("report", REPORT_LENGTH),
    0x380: ("alarm", REPORT_LENGTH),
    0x080: ("emergency", sdo.LENGTH),
    0x700: ("heartbeat", 1),
}
"""Identifier without the node -> kind and number of data bytes."""
LOW_VOLTAGE: Final = b"\x0a\x02\x00\x00"  # the only alarm that a source names
STATES: Final = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
"""States of a heartbeat (CiA 301)."""
ALARM_TIME: Final = 5.0
"""s for which an alarm is shown after it was received: a servo reports that it begins, not that it is over."""


class Start(NamedTuple):
    """Start (`on`) or stop of reports, for one node or all (0); for all it is of both forms."""

    forms: frozenset[str]
    node: int
    on: bool


def encode_start(node: int) -> CanFrame:
    """Start one node or all (0) by NMT of CiA 301, `01 node`: it then moves, and reports. It has no reply."""
    return CanFrame(0, bytes((1, node)))


def decode_start(frame: CanFrame) -> Start | None:
    """A start (1) or stop (2), or None. "vendor": identifier = node, `01 00`; "standard": identifier 0, `01 node`."""
    identifier, data, _ = frame
    if len(data) != 2 or data[0] not in (1, 2) or (identifier and data[1]):
        return None
    node = identifier or data[1]
    if node not in (sdo.BROADCAST, *sdo.NODES):
        return None
    forms = ["vendor"] * (data[1] == 0) + ["standard"] * (identifier == 0)
    return Start(frozenset(forms), node, data[0] == 1)


def decode_notification(frame: CanFrame) -> Notification | None:
    """A frame of `NOTIFICATIONS` with either identifier format, or a "bus error" of the adapter (node 0); else None."""
    identifier, data, _ = frame
    if identifier & ERROR_FLAG:
        return Notification(sdo.BROADCAST, "bus error", data)
    node = identifier & 0x7F
    kind, length = NOTIFICATIONS.get(identifier - node, ("", 0))
    if not kind or node == sdo.BROADCAST or len(data) != length:
        return None
    if (kind == "report" and data[2:] != b"\0\0") or (kind == "heartbeat" and data[0] & 0x7F not in STATES):
        return None
    return Notification(node, kind, data)


def decode_report(data: bytes) -> int:
    """Position (raw counts) of a report."""
    return int.from_bytes(data[:2], "little", signed=True)


def alarm_text(data: bytes) -> str:
    """An alarm in words, or in hex where it is not known."""
    return "low voltage" if data == LOW_VOLTAGE else f"alarm {data.hex(' ').upper()}"


# -- receiver --------------------------------------------------------------------------------------------------


class BusState:
    """What servos of an open bus have sent unsolicited: `boots` by node, and recent alarms."""

    def __init__(self) -> None:
        self.boots: Counter[int] = Counter()
        self._alarms: dict[int, tuple[str, float]] = {}

    def note(self, event: Notification) -> None:
        """Keep what this notification says."""
        if event.kind == "alarm":
            self._alarms[event.node] = alarm_text(event.data), inf
        elif event.kind == "heartbeat" and event.data[0] & 0x7F == 0:
            self.boots[event.node] += 1

    def alarm(self, node: int, at: float) -> tuple[str, ...]:
        """Alarms of this node, for `ALARM_TIME` from its next reply on; `at` is the time of its last reply (s)."""
        if node not in self._alarms:
            return ()
        name, since = self._alarms[node]
        if since == inf:
            self._alarms[node] = name, at if at > -inf else inf
            return (name,)
        return (name,) if at - since <= ALARM_TIME else ()


_KINDS: Final = tuple(sdo.reply_kind(specifier).replace("segments", "upload") for specifier in range(256))
"""Kind in the key of a reply by byte 0."""
_ABORT_CODES: Final = frozenset(code.to_bytes(4, order) for code in sdo.ABORTS for order in ("little", "big"))


class FrameReceiver:
    """Replies and notifications of one bus; any other frame is noise. One frame is one event.

    The text of an slcan adapter has no checksum: one wrong digit turns an abort (80) into an acknowledgement (60).
    So an acknowledgement that carries an abort code is noise.
    """

    held: Final = 0

    def __init__(self, extended: bool = False, state: BusState | None = None) -> None:
        self._extended = extended
        self._state = state or BusState()

    def feed(self, data: Data, /) -> list[Event]:
        """Decode one frame. Never raises."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")] if data else []
        identifier, payload, extended = data
        node = identifier - sdo.REPLY
        if len(payload) == sdo.LENGTH and 0 < node < sdo.NODES.stop and extended is self._extended:
            kind = _KINDS[payload[0]]
            if not kind or (kind == "download" and payload[4:] in _ABORT_CODES):
                return [Noise(payload, "foreign", node)]
            return [Reply(node, (kind, payload[1] | payload[2] << 8, payload[3]), payload)]
        event = decode_notification(data)
        if event is None or (extended is not self._extended and event.node):
            return [Noise(payload, "foreign")]
        self._state.note(event)
        return [event]

    def flush(self) -> list[Event]:
        """Nothing is held."""
        return []
