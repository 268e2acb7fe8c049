"""Every byte of a KST conversation in words, and why a frame that is wrong is wrong.

A frame says which way it goes by its identifier, and a reply what it answers by index and sub-index, so each frame is
told by itself. Angles are counted as the profile says; an object that the profile lacks is named as newer servos have
it. Words for what is no SDO frame are in `unasked.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Explanation, Part
from motorbus.core.register import Register
from motorbus.families.kst.phrases import Field, Told, angle, counted, degrees, faulted, reserved
from motorbus.families.kst.table import KST_EXT, PROFILES, Profile, current, temperature, version
from motorbus.families.kst.unasked import unasked
from motorbus.families.kst.wire import (
    ABORTS,
    EVERYONE,
    LENGTH,
    REPLY,
    REPORT_LENGTH,
    REQUEST,
    SdoReply,
    SdoRequest,
    abort_text,
    decode_reply,
    decode_request,
)

HEAD: Final = 5
"""In a run of bytes a CAN frame stands as `CanFrame.flat()` says: identifier (4), number of data bytes (1), data."""
MANUAL: Final = PROFILES["kst"]
_BOTH: Final = "; commands 6 and 7 of the manual, position and status, are this one frame"
_VALUE: Final = 4
"""Data bytes behind the multiplexer."""


def explain(data: bytes, profile: Profile = MANUAL) -> list[Explanation]:
    """Every frame in a run of bytes, in order, in parts that hold all of its bytes; `fault` is "" for a good one.

    A run that ends in no whole frame has its rest as a last, bad one. Never raises.
    """
    told: list[Explanation] = []
    start = 0
    while start < len(data):
        size = HEAD + data[start + 4] if len(data) - start >= HEAD else HEAD
        if size > HEAD + LENGTH or start + size > len(data):
            return [*told, _no_frame(data[start:])]
        told.append(_explained(data[start : start + size], profile))
        start += size
    return told


def _no_frame(data: bytes) -> Explanation:
    fault = "not a whole CAN frame: identifier (4 bytes), number of data bytes (0 to 8), data"
    return Explanation(data, "no frame", (Part(0, data, "bytes", fault),), fault)


def _explained(data: bytes, profile: Profile) -> Explanation:
    number = int.from_bytes(data[:4], "big")
    frame = CanFrame(number & 0x7FFF_FFFF, data[HEAD:], bool(number >> 31))
    told = _sdo(frame, profile) or unasked(frame, profile)
    parts = [
        Part(0, data[:4], "identifier", told.identifier),
        Part(4, data[4:HEAD], "length", counted(data[4], "data byte")),
    ]
    start = HEAD
    for size, name, meaning in told.fields:
        parts.append(Part(start, data[start : start + size], name, meaning))
        start += size
    return Explanation(data, told.title, tuple(parts), told.fault)


def _sdo(frame: CanFrame, profile: Profile) -> Told | None:
    """A frame under the identifier of a request or a reply, or None."""
    request, reply = frame.id - REQUEST, frame.id - REPLY
    bits = f"{29 if frame.extended else 11} bits"
    if 0 <= request < 128:
        who = f"node {request}" if request != EVERYONE else "everyone"
        return _request(frame, who, f"request to {who} (0x600 + {request}), {bits}", profile)
    if 0 < reply < 128 and len(frame.data) != REPORT_LENGTH:
        return _reply(
            frame.data, f"node {reply}", f"reply of node {reply} (0x580 + {reply}), {bits}", profile
        )
    return None


# --- requests -----------------------------------------------------------------------------------------------


def _request(frame: CanFrame, who: str, identifier: str, profile: Profile) -> Told:
    request = decode_request(frame)
    if request is None:
        return _short(frame.data, "request", identifier)
    specifier = frame.data[0]
    if request.kind == "unknown":
        return _unknown(frame.data, "request", identifier)
    if request.kind == "segment":
        what = f"the next segment, toggle {request.toggle}"
        fields = [_specifier(specifier, what), reserved(frame.data[1:])]
        return Told(f"request to {who}: {what}", identifier, fields)
    row = _row(profile, request.index, request.subindex)
    said, what, values = _asked(request, row, frame.data[_VALUE:], profile)
    fields = [_specifier(specifier, what), *_object(profile, row, request), *values]
    return Told(f"request to {who}: {said}", identifier, fields)


def _asked(
    request: SdoRequest, row: Register | None, data: bytes, profile: Profile
) -> tuple[str, str, list[Field]]:
    """What is asked, what the specifier means, and the fields of the last four bytes."""
    name = _name(row, request)
    if request.kind == "upload":
        return f"read {name}", "read (upload)", [reserved(data)]
    if request.kind == "abort":
        text = abort_text(int.from_bytes(data, "little"))
        return f"give up {name}: {text}", "abort", [(_VALUE, "abort code", _code(data))]
    size = len(request.data) if request.sized else None
    values = list(_values(profile, row, data, size))
    return f"write {name} = {_short_value(values)}", f"write (download), {_stated(size)}", values


# --- replies ------------------------------------------------------------------------------------------------


def _reply(data: bytes, who: str, identifier: str, profile: Profile) -> Told:
    reply = decode_reply(data)
    if len(data) != LENGTH:
        return _short(data, "reply", identifier, " (or, as a report, 4)")
    if reply is None:
        return _unknown(data, "reply", identifier)
    if reply.kind == "segment":
        return _segment(data, reply, who, identifier)
    row = _row(profile, reply.index, reply.subindex)
    said, what, values = _answered(reply, row, data[_VALUE:], profile)
    fields = [_specifier(data[0], what), *_object(profile, row, reply), *values]
    return Told(f"reply of {who}: {said}", identifier, fields)


def _answered(
    reply: SdoReply, row: Register | None, data: bytes, profile: Profile
) -> tuple[str, str, list[Field]]:
    """What is said, what the specifier means, and the fields of the last four bytes."""
    name = _name(row, reply)
    if reply.kind == "abort":
        return f"{name} refused: {abort_text(reply.code)}", "abort", [(_VALUE, "abort code", _code(data))]
    if reply.kind == "download":
        return f"{name} is written", "written", [reserved(data)]
    if reply.kind == "upload-start":
        size = "without saying how long" if reply.size is None else counted(reply.size)
        field = reserved(data) if reply.size is None else (_VALUE, "size", size)
        return f"{name} comes in segments, {size}", "upload in segments", [field]
    values = list(_values(profile, row, data, reply.size))
    return f"{name} = {_short_value(values)}", f"value (upload), {_stated(reply.size)}", values


def _segment(data: bytes, reply: SdoReply, who: str, identifier: str) -> Told:
    more = "the last" if reply.last else "more follow"
    what = f"segment, toggle {reply.toggle}, {counted(len(reply.data))}, {more}"
    fields: list[Field] = [_specifier(data[0], what)]
    if reply.data:
        fields.append((len(reply.data), "data", version(reply.data)))
    if rest := data[1 + len(reply.data) :]:
        fields.append(reserved(rest))
    return Told(f"reply of {who}: {what}", identifier, fields)


# --- fields -------------------------------------------------------------------------------------------------


def _short(data: bytes, what: str, identifier: str, other: str = "") -> Told:
    return faulted(f"no {what}", identifier, data, f"a {what} has 8 data bytes{other}, here are {len(data)}")


def _unknown(data: bytes, what: str, identifier: str) -> Told:
    fault = (
        f"specifier 0x{data[0]:02X} is no {what}'s: segmented writing and block transfer are not spoken here"
    )
    return faulted(f"no {what}", identifier, data, fault)


def _specifier(byte: int, meaning: str) -> Field:
    """Byte 0 and what it says."""
    return 1, "specifier", f"0x{byte:02X}: {meaning}"


def _stated(size: int | None) -> str:
    """What the specifier of a value says of its length."""
    return "length not stated" if size is None else counted(size)


def _row(profile: Profile, index: int, subindex: int) -> Register | None:
    """The object as the profile has it, else as newer servos do."""
    return profile.table.at(index, subindex) or KST_EXT.at(index, subindex)


def _name(row: Register | None, said: SdoRequest | SdoReply) -> str:
    return row.name if row else f"0x{said.index:04X}:{said.subindex}"


def _object(profile: Profile, row: Register | None, said: SdoRequest | SdoReply) -> Iterator[Field]:
    if row is None:
        name = "no object that is known"
    else:
        name = row.name if row.name in profile.table else f"{row.name}, not in profile {profile.name}"
        name += _BOTH if _ambiguous(profile, row) else ""
    yield 2, "index", f"0x{said.index:04X}, {name}"
    yield 1, "sub-index", f"{said.subindex}"


def _short_value(values: list[Field]) -> str:
    """What the title says of a value: its fields, without what else they might be."""
    return ", ".join(said.partition("; or,")[0] for _, name, said in values if name != "reserved")


def _code(data: bytes) -> str:
    code = int.from_bytes(data, "little")
    return f"0x{code:08X}: {abort_text(code)}" if code in ABORTS else abort_text(code)


def _values(profile: Profile, row: Register | None, data: bytes, stated: int | None) -> Iterator[Field]:
    """The four data bytes: what belongs to the object, and the rest. Without a stated length the object has its own."""
    size = stated or (row.size if row else _VALUE)
    value = data[:size]
    if row is not None and "version" in row.name:
        yield size, row.name, f'"{version(value)}"'
    elif row is None or row.size != size:
        yield size, "data", _number(row, value)
    elif row.name == "status":
        yield from _status(profile, row, value)
    else:
        yield size, row.name, _meaning(profile, row, value)
    if rest := data[size:]:
        yield reserved(rest)


def _number(row: Register | None, data: bytes) -> str:
    number = f"{int.from_bytes(data, 'little')} ({data.hex(' ').upper()})"
    return f"{number}, but {row.name} has {counted(row.size)}" if row else number


def _status(profile: Profile, row: Register, data: bytes) -> Iterator[Field]:
    """Current and temperature; with the scale of newer servos where the profile has no status of its own."""
    known = profile if profile.status_row else PROFILES["kst-ext"]
    raw = row.decode(data)
    yield 2, "current", f"{current(known, raw):.6g} A ({known.current_scale:g} A per count)"
    yield 1, "temperature", f"{temperature(known, raw)} °C"
    yield reserved(data[3:])


def _meaning(profile: Profile, row: Register, data: bytes) -> str:
    raw = row.decode(data)
    if row.unit == "rad":
        shown = angle(profile, raw)
        if _ambiguous(profile, row):
            shown += f"; or, if command 7 was meant, the status 0x{data[0]:02X} 0x{data[1]:02X}"
    elif row.bits:
        shown = (
            f"0x{raw:02X} ({', '.join(name for bit, name in row.bits.items() if raw >> bit & 1) or 'none'})"
        )
    elif row.choices:
        shown = f"{raw} ({row.choices.get(raw, 'not known')})" if row.size == 1 else _letters(row, raw, data)
    else:
        shown = f"{row.to_value(raw):.6g} {row.unit} (raw {raw})" if row.unit else str(raw)
    if row.low <= raw <= row.high or row.name == "store":
        return shown
    low, high = (degrees(profile, end) if row.unit == "rad" else str(end) for end in (row.low, row.high))
    whose = profile.name if row.name in profile.table else KST_EXT.name
    return f"{shown}, outside {low} to {high} of profile {whose}"


def _ambiguous(profile: Profile, row: Register) -> bool:
    """The manual reads position and status by one and the same frame; later servos have a status of its own."""
    return row.name == "present_position" and profile.status_row is None


def _letters(row: Register, raw: int, data: bytes) -> str:
    """A signature: the letters themselves, and whether they are the right ones."""
    return f'"{version(data)}"' + ("" if raw in row.choices else ", the wrong letters: nothing is stored")
