"""What is neither request nor reply, in words: reports, alarms, starts, CANopen's own frames, and frames of nobody."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.families.kst.phrases import Field, Told, angle, faulted
from motorbus.families.kst.table import Profile
from motorbus.families.kst.wire import (
    ALARM,
    EMERGENCY,
    EVERYONE,
    HEARTBEAT,
    LOW_VOLTAGE,
    NODES,
    PDO,
    REPLY,
    STATES,
    Start,
    decode_notice,
    decode_report,
    decode_start,
)

_Said: TypeAlias = tuple[str, str, list[Field]]
"""What kind of frame it is, what it says in short, and its fields."""
_NMT: Final = {0x80: "be pre-operational", 0x81: "restart", 0x82: "restart communication"}
_BUS_ERRORS: Final = (
    "a frame could not be sent in time",
    "arbitration was lost",
    "trouble in the controller",
    "a protocol error",
    "trouble in the transceiver",
    "nobody acknowledged",
    "bus off",
    "a bus error",
    "the controller was restarted",
)
"""The bits of an error frame's identifier, from bit 0 on, as SocketCAN numbers them."""
_EMERGENCIES: Final = {
    0x0: "no error",
    0x1: "generic error",
    0x2: "current",
    0x3: "voltage",
    0x4: "temperature",
    0x5: "device hardware",
    0x6: "device software",
    0x7: "additional modules",
    0x8: "monitoring",
    0x9: "external error",
    0xF: "specific to the device",
}
"""The upper four bits of an emergency's code (CiA 301)."""
_REGISTER: Final = ("generic", "current", "voltage", "temperature", "communication", "profile", "", "vendor")
"""The bits of the error register (CiA 301, object 1001h)."""


def unasked(frame: CanFrame, profile: Profile) -> Told:
    """Any frame that does not stand under the identifier of a request or of a reply with 8 bytes."""
    if frame.id & ERROR_FLAG:
        return _bus_error(frame)
    if frame.id & REMOTE_FLAG:
        return _nothing(frame, "a remote frame: nothing in this protocol is asked for by one")
    if (start := decode_start(frame)) is not None:
        return _start(frame, start)
    node, base = frame.id & 0x7F, frame.id & ~0x7F
    if base == 0:
        return _nmt(frame) if node == EVERYONE else _nothing(frame, _NO_START)
    if base not in _TOLD or node not in NODES:
        return _nothing(frame, "no frame of this protocol has this identifier")
    if decode_notice(frame) is None:
        return _nothing(frame, _SHAPES[base])
    kind, said, fields = _TOLD[base](frame.data, profile)
    identifier = f"{kind} of node {node} (0x{base:03X} + {node}), {_bits(frame)}"
    return Told(f"{kind} of node {node}: {said}", identifier, fields)


# --- frames of servos ---------------------------------------------------------------------------------------


def _report(data: bytes, profile: Profile) -> _Said:
    position = angle(profile, decode_report(data))
    return "report", position, [(2, "position", position), (2, "reserved", "0")]


def _alarm(data: bytes, profile: Profile) -> _Said:
    what = "low voltage" if data == LOW_VOLTAGE else f"not known ({data.hex(' ').upper()})"
    return "alarm", what, [(len(data), "alarm", what)]


def _emergency(data: bytes, profile: Profile) -> _Said:
    code, register = int.from_bytes(data[:2], "little"), data[2]
    what = f"0x{code:04X}, {_EMERGENCIES.get(code >> 12, 'not known')}"
    bits = ", ".join(name or "reserved" for bit, name in enumerate(_REGISTER) if register >> bit & 1)
    fields: list[Field] = [
        (2, "error code", what),
        (1, "error register", f"0x{register:02X}: {bits or 'no error'}"),
        (5, "vendor", "the maker's own"),
    ]
    return "emergency", what, fields


def _heartbeat(data: bytes, profile: Profile) -> _Said:
    state = STATES[data[0] & 0x7F] + (", toggle bit of node guarding set" if data[0] & 0x80 else "")
    return "heartbeat", state, [(1, "state", state)]


_TOLD: Final[dict[int, Callable[[bytes, Profile], _Said]]] = {
    REPLY: _report,
    PDO: _report,
    ALARM: _alarm,
    EMERGENCY: _emergency,
    HEARTBEAT: _heartbeat,
}
_SHAPES: Final = {
    REPLY: "a report is a position (2 bytes) and two zeros",
    PDO: "a report is a position (2 bytes) and two zeros",
    ALARM: "an alarm has 4 data bytes",
    EMERGENCY: "an emergency has 8 data bytes",
    HEARTBEAT: "a heartbeat is one byte that tells a state: 0, 4, 5 or 127",
}


# --- frames of hosts ----------------------------------------------------------------------------------------

_NO_START: Final = "under a node's own number there are only 01 00 (start) and 02 00 (stop)"


def _start(frame: CanFrame, start: Start) -> Told:
    who = f"node {start.node}" if start.node != EVERYONE else "everyone"
    what = f"{'start' if start.on else 'stop'} reports, and motion where that must be started"
    by = "either form" if len(start.forms) > 1 else f"the {''.join(start.forms)} form"
    fields: list[Field] = [
        (1, "command", what),
        (1, "reserved", "0") if "vendor" in start.forms else (1, "node", who),
    ]
    title = f"to {who}: {'start' if start.on else 'stop'}, in {by}"
    return Told(title, f"{_number(frame)}, {_bits(frame)}", fields)


def _nmt(frame: CanFrame) -> Told:
    data = frame.data
    if len(data) != 2 or data[0] not in _NMT or data[1] not in (EVERYONE, *NODES):
        return _nothing(frame, "no command of network management: 01, 02, 80, 81 or 82 and a node, 0 to 127")
    who = f"node {data[1]}" if data[1] else "everyone"
    fields: list[Field] = [(1, "command", _NMT[data[0]]), (1, "node", who)]
    return Told(f"to {who}: {_NMT[data[0]]}", f"network management, {_bits(frame)}", fields)


# --- frames of nobody ---------------------------------------------------------------------------------------


def _bus_error(frame: CanFrame) -> Told:
    classes = [text for bit, text in enumerate(_BUS_ERRORS) if frame.id >> bit & 1]
    fault = f"no data frame: the adapter reports {', '.join(classes) or 'an error on the bus'}"
    return faulted(
        "error on the bus", f"error frame, classes 0x{frame.id & 0x1FFF_FFFF:03X}", frame.data, fault
    )


def _nothing(frame: CanFrame, fault: str) -> Told:
    if not frame.extended and frame.id & 0x1FFF_FFFF > 0x7FF:
        fault = f"identifier 0x{frame.id & 0x1FFF_FFFF:X} does not fit 11 bits"
    return faulted("no frame of this protocol", f"{_number(frame)}, {_bits(frame)}", frame.data, fault)


def _number(frame: CanFrame) -> str:
    return f"0x{frame.id & 0x1FFF_FFFF:0{8 if frame.extended else 3}X}"


def _bits(frame: CanFrame) -> str:
    return "29 bits" if frame.extended else "11 bits"
