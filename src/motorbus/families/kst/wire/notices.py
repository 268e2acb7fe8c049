"""What a servo says unasked, and the frames that make it begin and end.

The KST CAN protocol manual has none of this; it is known from public drivers of these servos (a flight-controller
driver, an STM32 driver, a driver of XQPOWER servos). Emergency and heartbeat are CiA 301's and only ever decoded.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.request import Notification
from motorbus.errors import RequestError
from motorbus.families.kst.wire.frames import EVERYONE, LENGTH, NODES, REPLY, REQUEST, one

PDO: Final = 0x180
"""Second identifier (plus node) under which reports have been seen."""
ALARM: Final = 0x380
EMERGENCY: Final = 0x080
HEARTBEAT: Final = 0x700
REPORT_LENGTH: Final = 4
"""Data bytes of a report and of an alarm. A reply has 8: that is what tells them apart, never the first byte."""
LOW_VOLTAGE: Final = b"\x0a\x02\x00\x00"
"""The one alarm that is known."""
FORMS: Final = ("vendor", "standard")
STATES: Final = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
"""What a heartbeat says (CiA 301)."""
_BOOT: Final = 0x00
_PAD: Final = b"\0\0"
_START: Final = 1
_STOP: Final = 2


class Start(NamedTuple):
    """Reports on or off. `forms` holds the forms this frame may be: both, when it goes to everyone (`node` 0)."""

    forms: frozenset[str]
    node: int
    on: bool


def encode_report(node: int, raw: int, *, form: str = "sdo", extended: bool = False) -> CanFrame:
    """A position, in counts, sent unasked: under the identifier of replies, or (`form` "pdo") under 0x180 + node.

    Raises RequestError for an impossible node, form or position.
    """
    bases = {"sdo": REPLY, "pdo": PDO}
    if form not in bases:
        raise RequestError(f"a report has no form {form!r}", expected="sdo or pdo")
    if not -0x8000 <= raw <= 0x7FFF:
        raise RequestError(f"position {raw} does not fit a report", expected="-32768 to 32767 counts")
    return CanFrame(bases[form] + one(node), raw.to_bytes(2, "little", signed=True) + _PAD, extended)


def decode_report(data: bytes) -> int:
    """The position, in counts, in the data of a report notice."""
    return int.from_bytes(data[:2], "little", signed=True)


def encode_alarm(node: int, data: bytes = LOW_VOLTAGE, *, extended: bool = False) -> CanFrame:
    """An alarm, 4 bytes. Raises RequestError for another length or an impossible node."""
    if len(data) != REPORT_LENGTH:
        raise RequestError(f"an alarm of {len(data)} bytes is impossible", expected="4 bytes")
    return CanFrame(ALARM + one(node), data, extended)


def decode_notice(frame: CanFrame) -> Notification | None:
    """What came unasked, in either id format; None for every other frame.

    Kinds: "report", "alarm", "emergency", "heartbeat", and "bus error" (of node 0) for what the adapter reports. The
    two bytes behind a reported position are 0 in all known drivers; with anything else it is no report.
    """
    identifier, data, _ = frame
    if identifier & ERROR_FLAG:
        return Notification(EVERYONE, "bus error", data)
    node = identifier & 0x7F
    kind = _kind(identifier - node, data) if node else ""
    return Notification(node, kind, data) if kind else None


def _kind(base: int, data: bytes) -> str:
    if base in (REPLY, PDO):
        return "report" if len(data) == REPORT_LENGTH and data[2:] == _PAD else ""
    if base == ALARM:
        return "alarm" if len(data) == REPORT_LENGTH else ""
    if base == EMERGENCY:
        return "emergency" if len(data) == LENGTH else ""
    if base == HEARTBEAT:
        return "heartbeat" if len(data) == 1 and data[0] & 0x7F in STATES else ""
    return ""


def encode_boot(node: int, *, extended: bool = False) -> CanFrame:
    """A node says that it starts (CiA 301: the heartbeat of state 0). Raises RequestError for an impossible node."""
    return CanFrame(HEARTBEAT + one(node), bytes((_BOOT,)), extended)


def says_boot(data: bytes) -> bool:
    """Whether a heartbeat with this data says that its node has just started."""
    return len(data) == 1 and data[0] & 0x7F == _BOOT


def encode_start(form: str, node: int, on: bool, *, extended: bool = False) -> CanFrame:
    """Let a node, or everyone (0), report, or stop that; nobody answers.

    `form` "vendor" has the node as identifier and says `01 00` or `02 00`; "standard" is CiA 301's NMT, identifier 0,
    `01 node` or `02 node`, without which an XQPOWER servo ignores positions. Raises RequestError for another form or
    an impossible node.
    """
    if form not in FORMS:
        raise RequestError(f"there is no start form {form!r}", expected="vendor or standard")
    who = EVERYONE if node == EVERYONE else one(node)
    command = _START if on else _STOP
    if form == "vendor":
        return CanFrame(who, bytes((command, 0)), extended)
    return CanFrame(0, bytes((command, who)), extended)


def addressed(frame: CanFrame) -> int | None:
    """Whom a frame of a host is for, by its identifier, whether it makes sense or not; None: it is no frame of a host.

    `EVERYONE` for all. A start or stop is known by its data too, for others use such identifiers for their own.
    """
    identifier = frame.id & ~REMOTE_FLAG
    node = identifier - REQUEST
    if node == EVERYONE or node in NODES:
        return node
    start = decode_start(frame)
    return None if start is None else start.node


def decode_start(frame: CanFrame) -> Start | None:
    """A start or stop of reports in either form, or None."""
    identifier, data, _ = frame
    if len(data) != 2 or data[0] not in (_START, _STOP):
        return None
    on = data[0] == _START
    if identifier == 0 and (data[1] == EVERYONE or data[1] in NODES):
        forms = FORMS if data[1] == EVERYONE else ("standard",)
        return Start(frozenset(forms), data[1], on)
    if identifier in NODES and data[1] == 0:
        return Start(frozenset({"vendor"}), identifier, on)
    return None
