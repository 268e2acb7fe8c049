"""Every byte of a FEETECH conversation in words, and why a packet that is wrong is wrong.

Instruction and status packets have the same shape: FF FF 01 02 01 FB is a PING to servo 1, and also the
answer of a servo 1 that has a voltage alarm. What a packet can be read as depends on its fifth byte and on
what was said before; where both readings are possible, both are told. Registers are named by the STS map, and those
of a servo by its own map once it has said, in answer to a READ from register 0 on, who it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from motorbus.core.family import Explanation, Part
from motorbus.core.register import Register, RegisterMap
from motorbus.core.request import Noise
from motorbus.families.feetech.table import STS, TABLES, alarms, choose
from motorbus.families.feetech.wire import (
    BROADCAST,
    HEADER,
    MAX_ID,
    RULES,
    Instruction,
    checksum,
    decode_sync_read,
    instruction_name,
    suits,
)
from motorbus.families.feetech.wire.stream import Stream

_HEAD = 5
"""Registers that tell who a servo is."""


class _Asked(NamedTuple):
    """What a servo was asked for: so many bytes from this register on, due in its next status packet."""

    address: int
    size: int


@dataclass(slots=True)
class _Said:
    """What was said before: the last instruction packet, what each servo still owes, and the maps of those who have
    told who they are; `usual` is the map of the others."""

    usual: RegisterMap
    last: bytes = b""
    asked: dict[int, _Asked] = field(default_factory=dict)
    maps: dict[int, RegisterMap] = field(default_factory=dict)

    def table(self, id: int) -> RegisterMap:
        """The register map by which to name what this servo is told or tells."""
        return self.maps.get(id, self.usual)

    def learn(self, id: int, data: bytes) -> None:
        """Registers 0 to 4 and what follows them, as this servo has them."""
        chosen = choose((data[0], data[1]), (data[3], data[4]), data[2])
        if chosen.table:
            self.maps[id] = TABLES[chosen.table]


def explain(data: bytes, table: RegisterMap = STS) -> list[Explanation]:
    """Every packet and every run of stray bytes in `data`, in order; together they hold all of its bytes.

    The parts of a packet cover it byte by byte, each with its place in the packet. `fault` is "" for a good
    packet. Parameters of a status packet are named when the READ that asked for them comes before it.
    """
    stream = Stream(BROADCAST, bytes)
    told: list[Explanation] = []
    said = _Said(table)
    for packet in _together([*stream.feed(data), *stream.flush()]):
        if isinstance(packet, bytes):
            told.append(_packet(packet, said))
        else:
            told.extend(_fault(piece) for piece in _pieces(packet))
    return told


# --- good packets -------------------------------------------------------------------------------------------


def _packet(data: bytes, said: _Said) -> Explanation:
    """A packet is an instruction when its form allows that and nobody owes an answer of just this form."""
    id, code, parameters = data[2], data[4], data[5:-1]
    table = said.table(id)
    if data == said.last and id != BROADCAST:
        return _instruction(data, f"the same again: an echo, or {_as_status(data, table)}", said)
    owed = said.asked.pop(id, None)
    answers = owed is not None and owed.size == len(parameters)
    if id != BROADCAST and (answers or not suits(code, parameters)):
        return _status(data, owed if answers else None, said)
    said.last = data
    said.asked.update(_wishes(id, code, parameters))
    return _instruction(data, f"or {_as_status(data, table)}" if id != BROADCAST else "", said)


def _status(data: bytes, owed: _Asked | None, said: _Said) -> Explanation:
    id, code, parameters = data[2], data[4], data[5:-1]
    if owed and owed.address == 0 and len(parameters) >= _HEAD:
        said.learn(id, parameters)
    table = said.table(id)
    also = f" (or {_as_instruction(data)})" if code in RULES or code & 0xC0 else ""
    parts = _values(5, owed.address, parameters, table) if owed else _data(5, parameters)
    told = Part(4, data[4:5], "error", _alarms(code, table))
    return _told(data, _as_status(data, table) + also, told, parts)


def _instruction(data: bytes, also: str, said: _Said) -> Explanation:
    id, code, parameters = data[2], data[4], data[5:-1]
    title = _as_instruction(data) + (f" ({also})" if also else "")
    doubt = f"; as an error byte: {_alarms(code, said.table(id))}" if id != BROADCAST else ""
    named = Part(4, data[4:5], "instruction", instruction_name(code) + doubt)
    if suits(code, parameters):
        return _told(data, title, named, _parameters(id, code, parameters, said))
    return _told(data, title, named, _data(5, parameters), _senseless(code, parameters))


def _told(data: bytes, title: str, fifth: Part, parts: list[Part], fault: str = "") -> Explanation:
    return Explanation(data, title, (*_head(data), fifth, *parts, _sum(data)), fault)


def _as_status(data: bytes, table: RegisterMap) -> str:
    count = len(data) - 6
    carried = f" with {_bytes(count)}" if count else ""
    return f"status packet of servo {data[2]}{carried}: {_alarms(data[4], table)}"


def _as_instruction(data: bytes) -> str:
    return f"{instruction_name(data[4])} to {'everyone' if data[2] == BROADCAST else f'servo {data[2]}'}"


def _alarms(error: int, table: RegisterMap = STS) -> str:
    return f"alarm {', '.join(alarms(error, table.name))}" if error else "no alarm"


def _senseless(code: int, parameters: bytes) -> str:
    """Why nobody will act on an instruction packet whose form is right."""
    if code not in RULES:
        return f"instruction 0x{code:02X} is unknown: no servo obeys or answers"
    return f"{instruction_name(code)} with {_bytes(len(parameters))} of parameters cannot be carried out"


def _wishes(id: int, code: int, parameters: bytes) -> dict[int, _Asked]:
    """Which servos will answer an instruction, and with what."""
    if code == Instruction.SYNC_READ and (request := decode_sync_read(parameters)):
        return dict.fromkeys(request.ids, _Asked(request.address, request.length))
    if id == BROADCAST:
        return {}
    if code == Instruction.READ and len(parameters) == 2:
        return {id: _Asked(parameters[0], parameters[1])}
    return {id: _Asked(0, 0)}


# --- the fields of a packet ---------------------------------------------------------------------------------


def _head(data: bytes) -> Iterator[Part]:
    yield Part(0, data[:2], "header", "a packet begins")
    if len(data) > 2:
        yield Part(2, data[2:3], "id", _id(data[2]))
    if len(data) > 3:
        size = f"{data[3] + 4} bytes in all" if data[3] >= 2 else "impossible, at least 2"
        yield Part(3, data[3:4], "length", f"{data[3]}: {size}")


def _id(id: int) -> str:
    if id == BROADCAST:
        return "everyone (254)"
    return f"servo {id}" if id <= MAX_ID else "impossible: 255 is read as part of the header"


def _sum(data: bytes) -> Part:
    right = checksum(data[2:-1])
    verdict = "right" if data[-1] == right else f"wrong, should be {right:02X}"
    return Part(len(data) - 1, data[-1:], "checksum", verdict)


def _parameters(id: int, code: int, parameters: bytes, said: _Said) -> list[Part]:
    table = said.table(id)
    if code in (Instruction.READ, Instruction.SYNC_READ):
        return _span(parameters, table)
    if code in (Instruction.WRITE, Instruction.REG_WRITE):
        return [_address(parameters[0], table), *_values(6, parameters[0], parameters[1:], table)]
    if code == Instruction.SYNC_WRITE:
        return _sync_write(parameters, said)
    if code == Instruction.CALIBRATE and parameters:
        return [Part(5, parameters, "position", _word(parameters))]
    return _data(5, parameters)


def _span(parameters: bytes, table: RegisterMap) -> list[Part]:
    address, count = parameters[:2]
    names = [row.name for row in table.values() if address <= row.address < address + count]
    covered = f": {', '.join(names)}" if names else ""
    return [
        _address(address, table),
        Part(6, parameters[1:2], "count", f"{_bytes(count)}{covered}"),
        *(Part(7 + i, bytes((id,)), "id", _id(id)) for i, id in enumerate(parameters[2:])),
    ]


def _sync_write(parameters: bytes, said: _Said) -> list[Part]:
    address, length = parameters[:2]
    parts = [
        _address(address, said.usual),
        Part(6, parameters[1:2], "length", f"{_bytes(length)} for each servo"),
    ]
    for at in range(2, len(parameters), length + 1):
        id, data = parameters[at], parameters[at + 1 : at + 1 + length]
        parts.append(Part(5 + at, parameters[at : at + 1], "id", _id(id)))
        parts += _values(6 + at, address, data, said.table(id))
    return parts


def _address(address: int, table: RegisterMap) -> Part:
    return Part(5, bytes((address,)), "address", f"register {address}, {_register(address, table)}")


def _register(address: int, table: RegisterMap) -> str:
    """The name of the register at this address, or of the one whose second byte lies there."""
    if row := table.at(address):
        return row.name
    before = table.at(address - 1)
    return (
        f"second byte of {before.name}"
        if before and before.size == 2
        else f"not in the {table.name.upper()} map"
    )


def _values(start: int, address: int, data: bytes, table: RegisterMap) -> list[Part]:
    """The bytes from register `address` on, cut into registers."""
    parts: list[Part] = []
    at = 0
    while at < len(data):
        row = table.at(address + at)
        whole = row is not None and at + row.size <= len(data)
        piece = data[at : at + row.size] if row and whole else data[at : at + 1]
        if row and whole:
            parts.append(Part(start + at, piece, row.name, _value(row, piece)))
        else:
            meaning = f"register {address + at}, {_register(address + at, table)}: {piece[0]}"
            parts.append(Part(start + at, piece, "data", meaning))
        at += len(piece)
    return parts


def _value(row: Register, data: bytes) -> str:
    raw = row.decode(data)
    if raw in row.choices:
        return f"{raw} ({row.choices[raw]})"
    if row.bits:
        names = [name for bit, name in row.bits.items() if raw >> bit & 1]
        return f"{raw} ({', '.join(names) or 'none'})"
    return f"{raw} ({row.to_value(raw):.4g} {row.unit})" if row.unit else str(raw)


def _data(start: int, data: bytes) -> list[Part]:
    if not data:
        return []
    return [Part(start, data, "parameters", _word(data) if len(data) == 2 else " ".join(map(str, data)))]


def _word(data: bytes) -> str:
    little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
    return f"{little} if little-endian (STS, SMS, HLS), {big} if big-endian (SCS)"


# --- bad ones -----------------------------------------------------------------------------------------------


def _together(events: list[bytes | Noise]) -> Iterator[bytes | list[Noise]]:
    """Good packets one by one, and all the noise between two of them in one list."""
    run: list[Noise] = []
    for event in events:
        if isinstance(event, Noise):
            run.append(event)
            continue
        if run:
            yield run
            run = []
        yield event
    if run:
        yield run


def _pieces(noise: list[Noise]) -> list[bytes]:
    """Noise cut where a packet seems to begin. What follows a packet with a wrong checksum may be its end."""
    pieces: list[bytes] = []
    for event in noise:
        start = 0 if event.fault == "checksum" else event.data.find(HEADER)
        before, rest = (event.data, b"") if start < 0 else (event.data[:start], event.data[start:])
        if before and pieces:
            pieces[-1] += before
        elif before:
            pieces.append(before)
        pieces += [rest] if event.fault == "checksum" else _cut(rest)
    return pieces


def _cut(data: bytes) -> Iterator[bytes]:
    """Bytes that begin with a header, cut before each further one; a run of FF stays in one piece."""
    start = 0
    while start < len(data):
        run = start
        while data[run : run + 1] == b"\xff":
            run += 1
        end = data.find(HEADER, run)
        end = len(data) if end < 0 else end
        yield data[start:end]
        start = end


def _fault(data: bytes) -> Explanation:
    if data[:2] != HEADER or set(data) == {0xFF}:
        return Explanation(data, "no packet", (Part(0, data, "stray", _bytes(len(data))),), _stray(data))
    return Explanation(data, "broken packet", (*_head(data), *_rest(data)), _why(data))


def _stray(data: bytes) -> str:
    if set(data) == {0xFF}:
        return "FF without a packet: the header is the last two FF before an id"
    return "no packet begins here: there is no FF FF"


def _rest(data: bytes) -> Iterator[Part]:
    """What follows the length field of a broken packet, as far as the length can be believed."""
    size = data[3] + 4 if len(data) > 3 else 0
    if len(data) > 4:
        yield Part(4, data[4:5], "instruction or error", _either(data[4]))
    if size < 6 or len(data) < size:
        yield from _data(5, data[5:])
        return
    yield from _data(5, data[5 : size - 1])
    yield _sum(data[:size])
    if len(data) > size:
        yield Part(size, data[size:], "surplus", f"{_bytes(len(data) - size)} more than the length says")


def _either(code: int) -> str:
    if code not in RULES:
        return _alarms(code)
    return f"{instruction_name(code)}, or {_alarms(code)}"


def _why(data: bytes) -> str:
    if data[2:3] == b"\xff":
        return "id 255 is impossible: FF FF FF is a header with one FF too many"
    if len(data) < 4:
        return f"cut off after {_bytes(len(data))}: a packet has at least 6"
    if data[3] < 2:
        return f"length {data[3]} is impossible: it counts at least instruction and checksum, 2"
    size = data[3] + 4
    right = checksum(data[2 : size - 1])
    if len(data) < size:
        return f"length {data[3]} means {size} bytes but only {len(data)} are there"
    wrong = f"checksum {data[size - 1]:02X} is wrong, should be {right:02X}"
    if len(data) > size:
        return f"length {data[3]} means {size} bytes but {len(data)} are there, and {wrong}"
    return wrong


def _bytes(count: int) -> str:
    return f"{count} byte" if count == 1 else f"{count} bytes"
