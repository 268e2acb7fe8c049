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
from motorbus.families.kst.sdo import Sdo

HEAD: Final = 5  # bytes before the data in `CanFrame.flat()`: identifier (4), number of data bytes (1)
SHAPES: Final = {"report": ": a position (2) and two zeros", "heartbeat": ": 0, 4, 5 or 127"}
SDO: Final = {
    ("request", "upload"): ("read (upload)", "read {0}"),
    ("request", "download"): ("write (download), {0}", "write {0} = {1}"),
    ("request", "abort"): ("abort", "give up {0}: {1}"),
    ("reply", "upload"): ("value (upload), {0}", "{0} = {1}"),
    ("reply", "segments"): ("upload in segments", "{0} comes in segments"),
    ("reply", "download"): ("written", "{0} is written"),
    ("reply", "abort"): ("abort", "{0} refused: {1}"),
}
"""Meaning of the specifier (with the stated length), and title (with object and value)."""


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
    """One frame; `fields`, `row` (of its object), `fault`, `kind`, `node` and `code` are set while it is decoded."""

    def __init__(self, flat: bytes, profile: Profile) -> None:
        number = int.from_bytes(flat[:4], "big")
        self.flat = flat
        self.frame = CanFrame(number & 0x7FFF_FFFF, flat[HEAD:], bool(number >> 31))
        self.profile = profile
        self.fields = Fields(flat)
        self.row: Register | None = None
        self.fault = self.kind = ""
        self.node, self.code = self.frame.id & 0x7F, self.frame.id & ~0x7F

    def explain(self) -> Explanation:
        digits, bits = (8, 29) if self.frame.extended else (3, 11)
        number = self.frame.id & 0x1FFF_FFFF
        self.fields.take(4, "identifier", f"0x{number:0{digits}X}, {bits} bits")
        self.fields.take(1, "length", counted(len(self.frame.data), "data byte"))
        title = self._title()
        if self.fault:
            self.fields.take_rest("data", self.fault)
        self.fields.take_reserved()
        parts = tuple(self.fields.parts)
        return Explanation(self.flat, title, parts, self.fault, self.kind, self.node, self.code)

    def _title(self) -> str:
        """Decode the frame; return its title."""
        frame, node = self.frame, self.node
        if frame.id & ERROR_FLAG:
            self.fault = "no data frame: the adapter reports an error on the bus"
            self.kind, self.node, self.code = "notice", sdo.BROADCAST, ERROR_FLAG
            return "error on the bus"
        if self.code == sdo.REQUEST:
            return self._sdo("request", sdo.decode_request(frame.data), f"request to {_name(node)}:")
        if self.code == sdo.REPLY and node and len(frame.data) != notifications.REPORT_LENGTH:
            return self._sdo("reply", sdo.decode_reply(frame.data), f"reply of {_name(node)}:")
        if (start := notifications.decode_start(frame)) is not None:
            self.kind, self.node, self.code = "request", start.node, 0
            return self._start(start)
        if (notification := notifications.decode_notification(frame)) is not None:
            self.kind = "notice"
            return f"{notification.kind} of node {node}: {self._notification(notification)}"
        return self._foreign()

    # -- requests and replies ------------------------------------------------------------------------------------

    def _sdo(self, what: str, one: Sdo | None, who: str) -> str:
        data = self.frame.data
        if one is None:
            self.fault = f"a {what} has 8 data bytes, here are {len(data)}"
            if len(data) == sdo.LENGTH:
                self.fault = f"specifier 0x{data[0]:02X} is of no {what} that is supported"
            return f"no {what}"
        self.kind, self.code = what, data[0] << 24 | one.index << 8 | one.subindex
        meaning, title = SDO[what, one.kind]
        length = "length not stated" if one.size is None else counted(one.size)
        name = self._object(meaning.format(length), one)
        text = self._abort_code(one) if one.kind == "abort" else self._value(one) if "{1}" in title else ""
        return f"{who} {title.format(name, text)}"

    def _object(self, meaning: str, one: Sdo) -> str:
        """Decode specifier, index and sub-index; return the name of the object."""
        table = self.profile.table
        self.row = table.at(one.index, one.subindex) or KST_EXT.at(one.index, one.subindex)
        shown = self.row.name if self.row else "no object that is known"
        if self.row and self.row.name not in table:
            shown += f", not in profile {self.profile.name}"
        self.fields.take(1, "specifier", f"0x{self.frame.data[0]:02X}: {meaning}")
        self.fields.take(2, "index", f"0x{one.index:04X}, {shown}")
        self.fields.take(1, "sub-index", f"{one.subindex}")
        return self.row.name if self.row else f"0x{one.index:04X}:{one.subindex}"

    def _abort_code(self, one: Sdo) -> str:
        text = sdo.abort_text(one.code)
        self.fields.take_rest("abort code", f"0x{one.code:08X}: {text}" if one.code in sdo.ABORTS else text)
        return text

    # -- values --------------------------------------------------------------------------------------------------

    def _value(self, one: Sdo) -> str:
        """Decode the value; without a stated length the object has its own. Returns its text."""
        row = self.row
        size = one.size or (row.size if row else sdo.EXPEDITED)
        data = self.fields.rest[:size]
        name, note = row.name if row else "data", ""
        if name in VERSIONS:
            text = f'"{version_text(data)}"'
        elif row is None or row.size != size:
            name = "data"
            text = f"{int.from_bytes(data, 'little')} ({data.hex(' ').upper()})"
            text += f", but {row.name} has {counted(row.size)}" if row else ""
        elif name == "status":
            known = self.profile if "status" in self.profile.table else PROFILES["kst-ext"]
            raw = row.decode(data)
            ampere = f"{profiles.current(known, raw):.6g} A ({known.current_scale:g} A per count)"
            degrees = f"{profiles.temperature(raw)} °C"
            self.fields.take(2, "current", ampere)
            self.fields.take(1, "temperature", degrees)
            return f"{ampere}, {degrees}"
        else:
            text = self._meaning(row, data)
            if name == "present_position" and "status" not in self.profile.table:
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

    def _angle(self, raw: int) -> str:
        return f"{self._degrees(raw)} (raw {raw}, {self.profile.counts_per_degree} per degree)"

    def _degrees(self, raw: int) -> str:
        return f"{raw / self.profile.counts_per_degree:.6g}°"

    # -- other frames --------------------------------------------------------------------------------------------

    def _notification(self, notification: Notification) -> str:
        """Decode the data of a notification; return their text."""
        data = notification.data
        match notification.kind:
            case "report":
                name, size, what = "position", 2, self._angle(notifications.decode_report(data))
            case "alarm":
                name, size, what = "alarm", len(data), notifications.alarm_text(data)
            case "heartbeat":
                guard = ", toggle bit of node guarding set" if data[0] & 0x80 else ""
                name, size, what = "state", 1, notifications.STATES[data[0] & 0x7F] + guard
            case _:  # an emergency
                name, size, what = "error code", 2, f"code 0x{int.from_bytes(data[:2], 'little'):04X}"
        self.fields.take(size, name, what)
        if notification.kind == "emergency":
            self.fields.take(1, "error register", f"0x{data[2]:02X}")
            self.fields.take_rest("vendor", "defined by the maker")
        return what

    def _start(self, start: notifications.Start) -> str:
        verb = "start" if start.on else "stop"
        by = "either form" if len(start.forms) > 1 else f"the {''.join(start.forms)} form"
        self.fields.take(1, "command", f"{verb} reports, and motion where that must be started")
        if "vendor" not in start.forms:
            self.fields.take(1, "node", _name(start.node))
        return f"to {_name(start.node)}: {verb}, in {by}"

    def _foreign(self) -> str:
        kind, length = notifications.NOTIFICATIONS.get(self.code, ("", 0))
        self.fault = "no frame of this protocol has this identifier"
        if self.frame.id & REMOTE_FLAG:
            self.fault = "a remote frame: this protocol has none"
        elif kind and self.node:
            self.fault = f"a {kind} has {counted(length)}{SHAPES.get(kind, '')}"
        return "no frame of this protocol"


def _name(node: int) -> str:
    return f"node {node}" if node != sdo.BROADCAST else "everyone"
