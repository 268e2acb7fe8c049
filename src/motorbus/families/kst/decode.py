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
from motorbus.families.kst.notifications import (
    ALARM,
    EMERGENCY,
    HEARTBEAT,
    LOW_VOLTAGE,
    PDO,
    REPORT_LENGTH,
    STATES,
    Start,
    decode_notification,
    decode_report,
    decode_start,
)
from motorbus.families.kst.profiles import (
    KST_EXT,
    PROFILES,
    Profile,
    current,
    temperature,
    version_text,
)
from motorbus.families.kst.sdo import (
    ABORTS,
    BROADCAST,
    LENGTH,
    NODES,
    REPLY,
    REQUEST,
    SdoReply,
    SdoRequest,
    abort_text,
    decode_reply,
    decode_request,
)

HEAD: Final = 5
"""Bytes before the data in `CanFrame.flat()`: identifier (4), number of data bytes (1)."""
SAME_FRAME: Final = "; commands 6 and 7 of the manual, position and status, are this one frame"


def decode(data: bytes, profile: Profile = PROFILES["kst"]) -> list[Explanation]:
    """All frames in these bytes (see `CanFrame.flat`), in order; a rest that is no whole frame last. Never raises."""
    found: list[Explanation] = []
    start = 0
    while start < len(data):
        size = HEAD + data[start + 4] if len(data) - start >= HEAD else HEAD
        if size > HEAD + LENGTH or start + size > len(data):
            fields = Fields(data[start:])
            fault = "not a whole CAN frame: identifier (4 bytes), number of data bytes (0 to 8), data"
            fields.take_rest("bytes", fault)
            return [*found, Explanation(data[start:], "no frame", tuple(fields.parts), fault)]
        found.append(_Frame(data[start : start + size], profile).explain())
        start += size
    return found


class _Frame:
    """One frame; `fields` are filled while it is decoded."""

    def __init__(self, data: bytes, profile: Profile) -> None:
        number = int.from_bytes(data[:4], "big")
        self.flat = data
        self.frame = CanFrame(number & 0x7FFF_FFFF, data[HEAD:], bool(number >> 31))
        self.profile = profile
        self.fields = Fields(data)
        self.fault = ""

    def explain(self) -> Explanation:
        title = self._title()
        return Explanation(self.flat, title, tuple(self.fields.parts), self.fault)

    def _begin(self, identifier: str) -> None:
        self.fields.take(4, "identifier", identifier)
        self.fields.take(1, "length", counted(len(self.frame.data), "data byte"))

    def _invalid(self, title: str, identifier: str, fault: str) -> str:
        self._begin(identifier)
        self.fields.take_rest("data", fault)
        self.fault = fault
        return title

    @property
    def _bits(self) -> str:
        return "29 bits" if self.frame.extended else "11 bits"

    @property
    def _number(self) -> str:
        return f"0x{self.frame.id & 0x1FFF_FFFF:0{8 if self.frame.extended else 3}X}"

    def _title(self) -> str:
        """Decode the frame; return its title."""
        request, reply = self.frame.id - REQUEST, self.frame.id - REPLY
        if 0 <= request < 128:
            who = f"node {request}" if request != BROADCAST else "everyone"
            return self._request(who, f"request to {who} (0x600 + {request}), {self._bits}")
        if 0 < reply < 128 and len(self.frame.data) != REPORT_LENGTH:
            return self._reply(f"node {reply}", f"reply of node {reply} (0x580 + {reply}), {self._bits}")
        return self._other()

    # -- requests and replies ------------------------------------------------------------------------------------

    def _request(self, who: str, identifier: str) -> str:
        request = decode_request(self.frame)
        if request is None:
            return self._wrong_length("request", identifier)
        if request.kind == "unknown":
            return self._unknown_specifier("request", identifier)
        self._begin(identifier)
        if request.kind == "segment":
            what = f"the next segment, toggle {request.toggle}"
            self._specifier(what)
            self.fields.take_reserved()
            return f"request to {who}: {what}"
        row = self._row(request.index, request.subindex)
        name = row.name if row else f"0x{request.index:04X}:{request.subindex}"
        if request.kind == "upload":
            self._head("read (upload)", row, request)
            self.fields.take_reserved()
            return f"request to {who}: read {name}"
        if request.kind == "abort":
            self._head("abort", row, request)
            return f"request to {who}: give up {name}: {self._abort_code()}"
        size = len(request.data) if request.sized else None
        self._head(f"write (download), {_stated(size)}", row, request)
        return f"request to {who}: write {name} = {self._value(row, size)}"

    def _reply(self, who: str, identifier: str) -> str:
        data = self.frame.data
        reply = decode_reply(data)
        if len(data) != LENGTH:
            return self._wrong_length("reply", identifier, " (or, as a report, 4)")
        if reply is None:
            return self._unknown_specifier("reply", identifier)
        self._begin(identifier)
        if reply.kind == "segment":
            more = "the last" if reply.last else "more follow"
            what = f"segment, toggle {reply.toggle}, {counted(len(reply.data))}, {more}"
            self._specifier(what)
            self.fields.take(len(reply.data), "data", version_text(reply.data))
            self.fields.take_reserved()
            return f"reply of {who}: {what}"
        row = self._row(reply.index, reply.subindex)
        name = row.name if row else f"0x{reply.index:04X}:{reply.subindex}"
        if reply.kind == "abort":
            self._head("abort", row, reply)
            return f"reply of {who}: {name} refused: {self._abort_code()}"
        if reply.kind == "download":
            self._head("written", row, reply)
            self.fields.take_reserved()
            return f"reply of {who}: {name} is written"
        if reply.kind == "upload-start":
            size = "without saying how long" if reply.size is None else counted(reply.size)
            self._head("upload in segments", row, reply)
            if reply.size is not None:
                self.fields.take_rest("size", size)
            self.fields.take_reserved()
            return f"reply of {who}: {name} comes in segments, {size}"
        self._head(f"value (upload), {_stated(reply.size)}", row, reply)
        return f"reply of {who}: {name} = {self._value(row, reply.size)}"

    def _wrong_length(self, what: str, identifier: str, other: str = "") -> str:
        fault = f"a {what} has 8 data bytes{other}, here are {len(self.frame.data)}"
        return self._invalid(f"no {what}", identifier, fault)

    def _unknown_specifier(self, what: str, identifier: str) -> str:
        fault = (
            f"specifier 0x{self.frame.data[0]:02X} is no {what}'s: segmented writing and block transfer are not spoken "
            "here"
        )
        return self._invalid(f"no {what}", identifier, fault)

    def _row(self, index: int, subindex: int) -> Register | None:
        return self.profile.table.at(index, subindex) or KST_EXT.at(index, subindex)

    def _specifier(self, meaning: str) -> None:
        self.fields.take(1, "specifier", f"0x{self.frame.data[0]:02X}: {meaning}")

    def _head(self, meaning: str, row: Register | None, frame: SdoRequest | SdoReply) -> None:
        name = "no object that is known"
        if row is not None:
            name = (
                row.name
                if row.name in self.profile.table
                else f"{row.name}, not in profile {self.profile.name}"
            )
            name += SAME_FRAME if self._is_ambiguous(row) else ""
        self._specifier(meaning)
        self.fields.take(2, "index", f"0x{frame.index:04X}, {name}")
        self.fields.take(1, "sub-index", f"{frame.subindex}")

    def _abort_code(self) -> str:
        code = int.from_bytes(self.fields.rest, "little")
        text = abort_text(code)
        self.fields.take_rest("abort code", f"0x{code:08X}: {text}" if code in ABORTS else text)
        return text

    # -- values --------------------------------------------------------------------------------------------------

    def _value(self, row: Register | None, stated: int | None) -> str:
        """The value and the bytes behind it; without a stated length the object has its own. Returns the text."""
        size = stated or (row.size if row else 4)
        value = self.fields.rest[:size]
        if row is not None and "version" in row.name:
            meaning = f'"{version_text(value)}"'
        elif row is None or row.size != size:
            meaning = f"{int.from_bytes(value, 'little')} ({value.hex(' ').upper()})"
            meaning += f", but {row.name} has {counted(row.size)}" if row else ""
            self.fields.take(size, "data", meaning)
            self.fields.take_reserved()
            return meaning
        elif row.name == "status":
            return self._status(row, value)
        else:
            meaning = self._meaning(row, value)
        self.fields.take(size, row.name, meaning)
        self.fields.take_reserved()
        return meaning.partition("; or,")[0]

    def _status(self, row: Register, data: bytes) -> str:
        """With the scale of newer servos where the profile has no status of its own."""
        known = self.profile if self.profile.status_row else PROFILES["kst-ext"]
        raw = row.decode(data)
        ampere = f"{current(known, raw):.6g} A ({known.current_scale:g} A per count)"
        degrees = f"{temperature(raw)} °C"
        self.fields.take(2, "current", ampere)
        self.fields.take(1, "temperature", degrees)
        self.fields.take_reserved()
        return f"{ampere}, {degrees}"

    def _meaning(self, row: Register, data: bytes) -> str:
        raw = row.decode(data)
        if row.unit == "rad":
            shown = self._angle(raw)
            if self._is_ambiguous(row):
                shown += f"; or, if command 7 was meant, the status 0x{data[0]:02X} 0x{data[1]:02X}"
        elif row.bits:
            names = ", ".join(name for bit, name in row.bits.items() if raw >> bit & 1)
            shown = f"0x{raw:02X} ({names or 'none'})"
        elif row.choices and row.size == 1:
            shown = f"{raw} ({row.choices.get(raw, 'not known')})"
        elif row.choices:
            wrong = "" if raw in row.choices else ", the wrong letters: nothing is stored"
            shown = f'"{version_text(data)}"{wrong}'
        else:
            shown = f"{row.to_value(raw):.6g} {row.unit} (raw {raw})" if row.unit else str(raw)
        if row.low <= raw <= row.high or row.name == "store":
            return shown
        low, high = (self._degrees(end) if row.unit == "rad" else str(end) for end in (row.low, row.high))
        whose = self.profile.name if row.name in self.profile.table else KST_EXT.name
        return f"{shown}, outside {low} to {high} of profile {whose}"

    def _is_ambiguous(self, row: Register) -> bool:
        return row.name == "present_position" and self.profile.status_row is None

    def _angle(self, raw: int) -> str:
        return f"{self._degrees(raw)} (raw {raw}, {self.profile.counts_per_degree} per degree)"

    def _degrees(self, raw: int) -> str:
        return f"{raw / self.profile.counts_per_degree:.6g}°"

    # -- other frames --------------------------------------------------------------------------------------------

    def _other(self) -> str:
        """Any frame that is neither request nor reply of 8 bytes."""
        frame = self.frame
        if frame.id & ERROR_FLAG:
            classes = [text for bit, text in enumerate(_BUS_ERRORS) if frame.id >> bit & 1]
            fault = f"no data frame: the adapter reports {', '.join(classes) or 'an error on the bus'}"
            identifier = f"error frame, classes 0x{frame.id & 0x1FFF_FFFF:03X}"
            return self._invalid("error on the bus", identifier, fault)
        if frame.id & REMOTE_FLAG:
            return self._foreign("a remote frame: nothing in this protocol is asked for by one")
        if (start := decode_start(frame)) is not None:
            return self._start(start)
        node, base = frame.id & 0x7F, frame.id & ~0x7F
        if base == 0:
            if node == BROADCAST:
                return self._nmt()
            return self._foreign("under a node's own number there are only 01 00 (start) and 02 00 (stop)")
        if base not in _SHAPES or node not in NODES:
            return self._foreign("no frame of this protocol has this identifier")
        kind, shape = _SHAPES[base]
        if decode_notification(frame) is None:
            return self._foreign(shape)
        self._begin(f"{kind} of node {node} (0x{base:03X} + {node}), {self._bits}")
        return f"{kind} of node {node}: {self._notification(kind)}"

    def _notification(self, kind: str) -> str:
        data = self.frame.data
        if kind == "report":
            what = self._angle(decode_report(data))
            self.fields.take(2, "position", what)
            self.fields.take_reserved()
        elif kind == "alarm":
            what = "low voltage" if data == LOW_VOLTAGE else f"not known ({data.hex(' ').upper()})"
            self.fields.take_rest("alarm", what)
        elif kind == "heartbeat":
            toggle = ", toggle bit of node guarding set" if data[0] & 0x80 else ""
            what = STATES[data[0] & 0x7F] + toggle
            self.fields.take_rest("state", what)
        else:
            code, register = int.from_bytes(data[:2], "little"), data[2]
            what = f"0x{code:04X}, {_EMERGENCIES.get(code >> 12, 'not known')}"
            bits = ", ".join(name or "reserved" for bit, name in enumerate(_REGISTER) if register >> bit & 1)
            self.fields.take(2, "error code", what)
            self.fields.take(1, "error register", f"0x{register:02X}: {bits or 'no error'}")
            self.fields.take_rest("vendor", "the maker's own")
        return what

    def _start(self, start: Start) -> str:
        who = f"node {start.node}" if start.node != BROADCAST else "everyone"
        verb = "start" if start.on else "stop"
        by = "either form" if len(start.forms) > 1 else f"the {''.join(start.forms)} form"
        self._begin(f"{self._number}, {self._bits}")
        self.fields.take(1, "command", f"{verb} reports, and motion where that must be started")
        if "vendor" in start.forms:
            self.fields.take_reserved()
        else:
            self.fields.take_rest("node", who)
        return f"to {who}: {verb}, in {by}"

    def _nmt(self) -> str:
        data = self.frame.data
        if len(data) != 2 or data[0] not in _NMT or data[1] not in (BROADCAST, *NODES):
            return self._foreign(
                "no command of network management: 01, 02, 80, 81 or 82 and a node, 0 to 127"
            )
        who = f"node {data[1]}" if data[1] else "everyone"
        self._begin(f"network management, {self._bits}")
        self.fields.take(1, "command", _NMT[data[0]])
        self.fields.take_rest("node", who)
        return f"to {who}: {_NMT[data[0]]}"

    def _foreign(self, fault: str) -> str:
        if not self.frame.extended and self.frame.id & 0x1FFF_FFFF > 0x7FF:
            fault = f"identifier 0x{self.frame.id & 0x1FFF_FFFF:X} does not fit 11 bits"
        return self._invalid("no frame of this protocol", f"{self._number}, {self._bits}", fault)


def _stated(size: int | None) -> str:
    return "length not stated" if size is None else counted(size)


_NMT: Final = {0x80: "be pre-operational", 0x81: "restart", 0x82: "restart communication"}
_BUS_ERRORS: Final = (
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
"""Upper four bits of the code of an emergency (CiA 301)."""
_REGISTER: Final = ("generic", "current", "voltage", "temperature", "communication", "profile", "", "vendor")
"""Bits of the error register (CiA 301, object 1001h)."""
_SHAPES: Final = {
    REPLY: ("report", "a report is a position (2 bytes) and two zeros"),
    PDO: ("report", "a report is a position (2 bytes) and two zeros"),
    ALARM: ("alarm", "an alarm has 4 data bytes"),
    EMERGENCY: ("emergency", "an emergency has 8 data bytes"),
    HEARTBEAT: ("heartbeat", "a heartbeat is one byte with a state: 0, 4, 5 or 127"),
}
"""Kind and form of the frames of a servo, by identifier without the node."""
