"""Frames that servos send unsolicited, the frames that start and stop them, and the receiver of a bus.

    report      0x580 + node or 0x180 + node   4 bytes: position (2), 0 0
    alarm       0x380 + node                   4 bytes
    emergency   0x080 + node                   8 bytes (CiA 301, decoded only)
    heartbeat   0x700 + node                   1 byte (CiA 301)

The length of a frame tells a report from a reply, never the first byte. Source: the KST CAN protocol manual has none of
this; public drivers of these servos (a flight-controller driver, an STM32 driver, a driver of XQPOWER servos) do.
"""

from __future__ import annotations

from collections import Counter
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Data, Event, Noise, Notification, Reply
from motorbus.errors import RequestError
from motorbus.families.kst import sdo

PDO: Final = 0x180
ALARM: Final = 0x380
EMERGENCY: Final = 0x080
HEARTBEAT: Final = 0x700
REPORT_LENGTH: Final = 4  # data bytes of a report and of an alarm
NOTIFICATIONS: Final = {
    sdo.REPLY: ("report", REPORT_LENGTH),
    PDO: ("report", REPORT_LENGTH),
    ALARM: ("alarm", REPORT_LENGTH),
    EMERGENCY: ("emergency", sdo.LENGTH),
    HEARTBEAT: ("heartbeat", 1),
}
"""Identifier without the node -> kind and number of data bytes."""
REPORT_FORMS: Final = {"sdo": sdo.REPLY, "pdo": PDO}
LOW_VOLTAGE: Final = b"\x0a\x02\x00\x00"  # the only alarm that a source names
START_FORMS: Final = ("vendor", "standard")
STATES: Final = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
"""States of a heartbeat (CiA 301)."""
ALARM_TIME: Final = 5.0
"""s for which an alarm is shown after it was received: a servo reports that it begins, not that it is over."""


class Start(NamedTuple):
    """Start (`on`) or stop of reports, for one node or all (0); for all it is of both forms."""

    forms: frozenset[str]
    node: int
    on: bool


def encode_report(node: int, raw: int, *, form: str = "sdo") -> CanFrame:
    """A position (raw counts) under 0x580 + node, or with `form` "pdo" under 0x180 + node."""
    return CanFrame(REPORT_FORMS[form] + node, raw.to_bytes(2, "little", signed=True) + b"\0\0")


def decode_report(data: bytes) -> int:
    """Position (raw counts) of a report."""
    return int.from_bytes(data[:2], "little", signed=True)


def encode_alarm(node: int, data: bytes = LOW_VOLTAGE) -> CanFrame:
    """An alarm of 4 bytes."""
    return CanFrame(ALARM + node, data)


def encode_boot(node: int) -> CanFrame:
    """The heartbeat of a node that has just started."""
    return CanFrame(HEARTBEAT + node, b"\0")


def encode_start(form: str, node: int, on: bool) -> CanFrame:
    """Start or stop the reports of one node or of all (0); it has no reply.

    "vendor": identifier = node, `01 00` or `02 00`. "standard": NMT of CiA 301, identifier 0, `01 node` or `02 node`.
    """
    if form not in START_FORMS:
        raise RequestError(f"there is no start form {form!r}", expected="vendor or standard")
    command = 1 if on else 2
    if form == "vendor":
        return CanFrame(node, bytes((command, 0)))
    return CanFrame(0, bytes((command, node)))


def decode_start(frame: CanFrame) -> Start | None:
    """A start or stop in either form, or None."""
    identifier, data, _ = frame
    if len(data) != 2 or data[0] not in (1, 2):
        return None
    on, node = data[0] == 1, data[1]
    if identifier == 0 and node == sdo.BROADCAST:
        return Start(frozenset(START_FORMS), sdo.BROADCAST, on)
    if identifier == 0 and node in sdo.NODES:
        return Start(frozenset({"standard"}), node, on)
    if identifier in sdo.NODES and node == 0:
        return Start(frozenset({"vendor"}), identifier, on)
    return None


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


def addressee(frame: CanFrame) -> int | None:
    """The node that a frame of a host addresses, 0 for all; None for a frame that no host sends."""
    node = (frame.id & ~REMOTE_FLAG) - sdo.REQUEST
    if node == sdo.BROADCAST or node in sdo.NODES:
        return node
    start = decode_start(frame)
    return None if start is None else start.node


# -- receiver --------------------------------------------------------------------------------------------------


class BusState:
    """What an open bus has received beside replies: counts of frames, bus errors and starts, and recent alarms."""

    def __init__(self) -> None:
        self.frames = 0
        self.errors = 0
        self.boots: Counter[int] = Counter()
        self._alarms: dict[int, tuple[tuple[str, ...], float | None]] = {}

    def note(self, event: Event) -> None:
        """Count one received frame."""
        kind = event.kind if isinstance(event, Notification) else ""
        if kind == "bus error":
            self.errors += 1
            return
        self.frames += 1
        if not isinstance(event, Notification):
            return
        if kind == "alarm":
            name = "low voltage" if event.data == LOW_VOLTAGE else f"alarm {event.data.hex(' ').upper()}"
            self._alarms[event.node] = (name,), None
        elif kind == "heartbeat" and event.data[0] & 0x7F == 0:
            self.boots[event.node] += 1

    def alarm(self, node: int, at: float) -> tuple[str, ...]:
        """Alarms of this node, for `ALARM_TIME` from its next reply on; `at` is the time of its last reply (s)."""
        names, since = self._alarms.get(node, ((), None))
        if names and since is None and at > -inf:
            since = at
            self._alarms[node] = names, since
        return names if since is None or at - since <= ALARM_TIME else ()


_KEY_KINDS: Final = tuple(sdo.reply_kind(specifier).removesuffix("-start") for specifier in range(256))
"""Kind of `Key` by byte 0; "" for no reply."""
_ABORT_CODES: Final = frozenset(code.to_bytes(4, order) for code in sdo.ABORTS for order in ("little", "big"))


class FrameReceiver:
    """Replies and notifications of one bus; any other frame is noise. One frame is one event.

    The text of an slcan adapter has no checksum: one wrong digit turns an abort (80) into an acknowledgement (60).
    So an acknowledgement that carries an abort code is noise.
    """

    held: Final = 0

    def __init__(self, extended: bool = False, state: BusState | None = None) -> None:
        self._extended = extended
        self._state = state

    def feed(self, data: Data, /) -> list[Event]:
        """Decode one frame. Never raises."""
        if not isinstance(data, CanFrame):
            return [Noise(data, "foreign")] if data else []
        identifier, payload, extended = data
        node = identifier - sdo.REPLY
        event: Event | None
        if len(payload) == sdo.LENGTH and 0 < node < sdo.NODES.stop and extended is self._extended:
            event = self._reply(node, payload)
        else:
            event = decode_notification(data)
            if event is None or (extended is not self._extended and event.node):
                event = Noise(payload, "foreign")
        if self._state is not None:
            self._state.note(event)
        return [event]

    def _reply(self, node: int, data: bytes) -> Event:
        kind = _KEY_KINDS[data[0]]
        if not kind or (kind == "download" and data[4:] in _ABORT_CODES):
            return Noise(data, "foreign", node)
        return Reply(node, sdo.Key(kind, data[1] | data[2] << 8, data[3]), data)

    def flush(self) -> list[Event]:
        """Nothing is held."""
        return []
