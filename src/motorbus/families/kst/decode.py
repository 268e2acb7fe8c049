"""CAN frames of KST servos as text, field by field, with the reason why a frame is invalid.

The identifier of a frame gives its direction, and index and sub-index of a reply its request, so each frame is
decoded by itself. Angles have the scale of the profile; an object that the profile lacks has the name that newer
servos give it.
"""

from __future__ import annotations

from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.core.decode import Fields, counted
from motorbus.core.family import Explanation
from motorbus.core.register import Register
from motorbus.core.request import Notification
from motorbus.families.kst import notifications, profiles, sdo
from motorbus.families.kst.profiles import KST_EXT, PROFILES, VERSIONS, Profile, version_text

HEAD: Final = 5  # bytes before the data in `CanFrame.flat()`: identifier (4), number of data bytes (1)
BUS_ERRORS: Final = (
    "a frame could not be sent in time",
    "arbitration was lost",
    "trouble in the controller",
    "a protocol error",
    "trouble in the transceiver",
    "no acknowledgement",
    "bus off",
    "a bus error",
    "the controller was restarted",
)
"""Bits of the identifier of an error frame, from bit 0 (SocketCAN)."""
SHAPES: Final = {"report": ": a position (2) and two zeros", "heartbeat": ": 0, 4, 5 or 127"}
NMT: Final = {0x80: "be pre-operational", 0x81: "restart", 0x82: "restart communication"}
"""Commands of network management (CiA 301) besides start and stop."""
EMERGENCIES: Final = {
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
"""Upper four bits of the code of an emergency (CiA 301)."""
ERROR_REGISTER: Final = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "profile",
    "reserved",
    "vendor",
)
"""Bits of object 0x1001 (CiA 301)."""


def decode(data: bytes, profile: Profile = PROFILES["kst"]) -> list[Explanation]:
    """All frames in these bytes (see `CanFrame.flat`), in order; a rest that is no whole frame last. Never raises."""
    found: list[Explanation] = []
    start = 0
    while start < len(data):
        size = HEAD + data[start + 4] if len(data) - start >= HEAD else HEAD
        if size > HEAD + sdo.LENGTH or start + size > len(data):
            fields = Fields(data[start:])
            fault = "not a whole CAN frame: identifier (4 bytes), number of data bytes (0 to 8), data"
            fields.take_rest("bytes", fault)
            return [*found, Explanation(data[start:], "no frame", tuple(fields.parts), fault)]
        found.append(_Frame(data[start : start + size], profile).explain())
        start += size
    return found


class _Frame:
    """One frame; `fields`, `row` (of its object) and `fault` are set while it is decoded."""

    def __init__(self, flat: bytes, profile: Profile) -> None:
        number = int.from_bytes(flat[:4], "big")
        self.flat = flat
        self.frame = CanFrame(number & 0x7FFF_FFFF, flat[HEAD:], bool(number >> 31))
        self.profile = profile
        self.fields = Fields(flat)
        self.row: Register | None = None
        self.fault = ""

    def explain(self) -> Explanation:
        digits, bits = (8, 29) if self.frame.extended else (3, 11)
        number = self.frame.id & 0x1FFF_FFFF
        self.fields.take(4, "identifier", f"0x{number:0{digits}X}, {bits} bits")
        self.fields.take(1, "length", counted(len(self.frame.data), "data byte"))
        title = self._title()
        if self.fault:
            self.fields.take_rest("data", self.fault)
        self.fields.take_reserved()
        return Explanation(self.flat, title, tuple(self.fields.parts), self.fault)

    def _title(self) -> str:
        """Decode the frame; return its title."""
        frame = self.frame
        node, base = frame.id & 0x7F, frame.id & ~0x7F
        if frame.id & ERROR_FLAG:
            classes = [text for bit, text in enumerate(BUS_ERRORS) if frame.id >> bit & 1]
            self.fault = f"no data frame: the adapter reports {', '.join(classes) or 'an error on the bus'}"
            return "error on the bus"
        if base == sdo.REQUEST:
            return self._request(_name(node))
        if base == sdo.REPLY and node and len(frame.data) != notifications.REPORT_LENGTH:
            return self._reply(node)
        if (start := notifications.decode_start(frame)) is not None:
            return self._start(start)
        if (notification := notifications.decode_notification(frame)) is not None:
            return f"{notification.kind} of node {node}: {self._notification(notification)}"
        if frame.id == 0 and len(frame.data) == 2 and frame.data[0] in NMT and frame.data[1] < sdo.NODES.stop:
            command, who = NMT[frame.data[0]], _name(frame.data[1])
            self.fields.take(1, "command", command)
            self.fields.take(1, "node", who)
            return f"to {who}: {command}"
        return self._foreign(node, base)

    # -- requests and replies ------------------------------------------------------------------------------------

    def _request(self, who: str) -> str:
        request = sdo.decode_request(self.frame)
        if request is None or request.kind == "unknown":
            return self._invalid("request", "8 data bytes")
        title = f"request to {who}:"
        match request.kind:
            case "upload":
                return f"{title} read {self._object('read (upload)', request)}"
            case "abort":
                name = self._object("abort", request)
                return f"{title} give up {name}: {self._abort_code()}"
        size = len(request.data) if request.sized else None
        name = self._object(f"write (download), {_stated(size)}", request)
        return f"{title} write {name} = {self._value(size)}"

    def _reply(self, node: int) -> str:
        reply = sdo.decode_reply(self.frame.data)
        if reply is None:
            return self._invalid("reply", "8 data bytes (or, as a report, 4)")
        title = f"reply of node {node}:"
        match reply.kind:
            case "abort":
                name = self._object("abort", reply)
                return f"{title} {name} refused: {self._abort_code()}"
            case "download":
                return f"{title} {self._object('written', reply)} is written"
            case "upload-start":
                name = self._object("upload in segments", reply)
                size = "without saying how long" if reply.size is None else counted(reply.size)
                if reply.size is not None:
                    self.fields.take_rest("size", size)
                return f"{title} {name} comes in segments, {size}"
        name = self._object(f"value (upload), {_stated(reply.size)}", reply)
        return f"{title} {name} = {self._value(reply.size)}"

    def _invalid(self, what: str, length: str) -> str:
        data = self.frame.data
        if len(data) != sdo.LENGTH:
            self.fault = f"a {what} has {length}, here are {len(data)}"
        else:
            self.fault = f"specifier 0x{data[0]:02X} is of no {what}, or of a transfer that is not supported"
        return f"no {what}"

    def _specifier(self, meaning: str) -> None:
        self.fields.take(1, "specifier", f"0x{self.frame.data[0]:02X}: {meaning}")

    def _object(self, meaning: str, frame: sdo.SdoRequest | sdo.SdoReply) -> str:
        """Decode specifier, index and sub-index; return the name of the object."""
        table = self.profile.table
        self.row = table.at(frame.index, frame.subindex) or KST_EXT.at(frame.index, frame.subindex)
        shown = self.row.name if self.row else "no object that is known"
        if self.row and self.row.name not in table:
            shown += f", not in profile {self.profile.name}"
        if self._is_ambiguous:
            shown += "; commands 6 and 7 of the manual, position and status, are this one frame"
        self._specifier(meaning)
        self.fields.take(2, "index", f"0x{frame.index:04X}, {shown}")
        self.fields.take(1, "sub-index", f"{frame.subindex}")
        return self.row.name if self.row else f"0x{frame.index:04X}:{frame.subindex}"

    def _abort_code(self) -> str:
        code = int.from_bytes(self.fields.rest, "little")
        text = sdo.abort_text(code)
        self.fields.take_rest("abort code", f"0x{code:08X}: {text}" if code in sdo.ABORTS else text)
        return text

    # -- values --------------------------------------------------------------------------------------------------

    def _value(self, stated: int | None) -> str:
        """Decode the value; without a stated length the object has its own. Returns its text."""
        row = self.row
        size = stated or (row.size if row else 4)
        data = self.fields.rest[:size]
        name, note = row.name if row else "data", ""
        if name in VERSIONS:
            text = f'"{version_text(data)}"'
        elif row is None or row.size != size:
            name = "data"
            text = f"{int.from_bytes(data, 'little')} ({data.hex(' ').upper()})"
            text += f", but {row.name} has {counted(row.size)}" if row else ""
        elif name == "status":
            known = self.profile if self.profile.status_row else PROFILES["kst-ext"]
            raw = row.decode(data)
            ampere = f"{profiles.current(known, raw):.6g} A ({known.current_scale:g} A per count)"
            degrees = f"{profiles.temperature(raw)} °C"
            self.fields.take(2, "current", ampere)
            self.fields.take(1, "temperature", degrees)
            return f"{ampere}, {degrees}"
        else:
            text = self._meaning(row, data)
            if self._is_ambiguous:
                note = f"; or, if command 7 was meant, the status 0x{data[0]:02X} 0x{data[1]:02X}"
        self.fields.take(size, name, text + note)
        return text

    def _meaning(self, row: Register, data: bytes) -> str:
        raw = row.decode(data)
        if row.name == "store":
            wrong = "" if raw in row.choices else ", the wrong letters: nothing is stored"
            return f'"{version_text(data)}"{wrong}'
        low, high = str(row.low), str(row.high)
        text = str(raw)
        if row.unit == "rad":
            text, low, high = self._angle(raw), self._degrees(row.low), self._degrees(row.high)
        elif row.bits:
            names = ", ".join(name for bit, name in row.bits.items() if raw >> bit & 1)
            text = f"0x{raw:02X} ({names or 'none'})"
        elif row.choices:
            text = f"{raw} ({row.choices.get(raw, 'not known')})"
        elif row.unit:
            text = f"{row.to_value(raw):.6g} {row.unit} (raw {raw})"
        if row.low <= raw <= row.high:
            return text
        whose = self.profile.name if row.name in self.profile.table else KST_EXT.name
        return f"{text}, outside {low} to {high} of profile {whose}"

    @property
    def _is_ambiguous(self) -> bool:
        """The object is the position, which the manual also calls the status."""
        return self.row is not None and self.row.name == "present_position" and not self.profile.status_row

    def _angle(self, raw: int) -> str:
        return f"{self._degrees(raw)} (raw {raw}, {self.profile.counts_per_degree} per degree)"

    def _degrees(self, raw: int) -> str:
        return f"{raw / self.profile.counts_per_degree:.6g}°"

    # -- other frames --------------------------------------------------------------------------------------------

    def _notification(self, notification: Notification) -> str:
        data = notification.data
        match notification.kind:
            case "report":
                what = self._angle(notifications.decode_report(data))
                self.fields.take(2, "position", what)
            case "alarm":
                what = (
                    "low voltage"
                    if data == notifications.LOW_VOLTAGE
                    else f"not known ({data.hex(' ').upper()})"
                )
                self.fields.take_rest("alarm", what)
            case "heartbeat":
                guard = ", toggle bit of node guarding set" if data[0] & 0x80 else ""
                what = notifications.STATES[data[0] & 0x7F] + guard
                self.fields.take_rest("state", what)
            case _:  # an emergency
                code = int.from_bytes(data[:2], "little")
                what = f"0x{code:04X}, {EMERGENCIES.get(code >> 12, 'not known')}"
                bits = [name for bit, name in enumerate(ERROR_REGISTER) if data[2] >> bit & 1]
                self.fields.take(2, "error code", what)
                self.fields.take(1, "error register", f"0x{data[2]:02X}: {', '.join(bits) or 'no error'}")
                self.fields.take_rest("vendor", "defined by the maker")
        return what

    def _start(self, start: notifications.Start) -> str:
        verb = "start" if start.on else "stop"
        by = "either form" if len(start.forms) > 1 else f"the {''.join(start.forms)} form"
        self.fields.take(1, "command", f"{verb} reports, and motion where that must be started")
        if "vendor" not in start.forms:
            self.fields.take(1, "node", _name(start.node))
        return f"to {_name(start.node)}: {verb}, in {by}"

    def _foreign(self, node: int, base: int) -> str:
        kind, length = notifications.NOTIFICATIONS.get(base, ("", 0))
        self.fault = "no frame of this protocol has this identifier"
        if not self.frame.extended and self.frame.id & 0x1FFF_FFFF > 0x7FF:
            self.fault = "the identifier does not fit 11 bits"
        elif self.frame.id & REMOTE_FLAG:
            self.fault = "a remote frame: this protocol has none"
        elif base == 0:
            self.fault = "no start or stop (01 00, 02 00) and no command of network management"
        elif kind and node:
            self.fault = f"a {kind} has {counted(length)}{SHAPES.get(kind, '')}"
        return "no frame of this protocol"


def _name(node: int) -> str:
    return f"node {node}" if node != sdo.BROADCAST else "everyone"


def _stated(size: int | None) -> str:
    return "length not stated" if size is None else counted(size)
