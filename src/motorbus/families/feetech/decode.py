"""FEETECH packets as text, field by field, with the reason why a packet is invalid; and recorded packets by kind.

Instruction and status packets have the same form: FF FF 01 02 01 FB is a PING to servo 1, and also the answer of a
servo 1 with a voltage alarm. The fifth byte and the packets before decide; where both are possible, both are shown.
Registers have the names of the servo's map, if that is given or the servo was read from register 0 on before. For other
servos they are those of STS, with the remark "by the STS map" where the six maps disagree.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from motorbus.core.decode import Fields, counted
from motorbus.core.family import Explanation
from motorbus.core.recording import RecordedEvent, RecordedFrame
from motorbus.core.register import RegisterMap
from motorbus.core.request import Noise
from motorbus.families.feetech import protocol
from motorbus.families.feetech.models import choose
from motorbus.families.feetech.protocol import BROADCAST, HEADER, MAX_ID, RULES, Instruction, Packet
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import alarms

IDENTITY: Final = 5  # registers that identify a servo
BEGIN: Final = re.compile(rb"(?<!\xff)(?=\xff\xff)")  # of a header; the last two FF of a run are the header


class _Kinds:
    """Tells instruction and status packets apart by the packets before.

    A packet with the id and length of an expected reply is that reply, a repeated instruction is its echo or a reply,
    and any other packet is an instruction if a servo can carry it out.
    """

    def __init__(self) -> None:
        self._last = b""
        self._expected: dict[int, tuple[int, int]] = {}  # address and size of the registers in a reply, by id

    def kind(self, data: bytes, packet: Packet) -> tuple[str, int | None]:
        """ "request", "reply" or "either", and the address of the registers in an expected reply."""
        id, code, parameters = packet
        if data == self._last and id != BROADCAST:
            return "either", None
        address, size = self._expected.pop(id, (None, -1))
        if id != BROADCAST and size == len(parameters):
            return "reply", address
        if id != BROADCAST and not protocol.suits(code, parameters):
            return "reply", None
        self._last = data
        if code == Instruction.SYNC_READ and len(parameters) >= 3:
            self._expected |= dict.fromkeys(parameters[2:], (parameters[0], parameters[1]))
        elif id != BROADCAST:
            self._expected[id] = (parameters[0], parameters[1]) if code == Instruction.READ else (0, 0)
        return "request", None


class Recording:
    """Decoder of recorded packets of servos, of a host, or of both; see `core.recording.RecordingReceiver`."""

    code_meaning: Final = "the fifth byte: the instruction of a request, the alarm bits of a reply"

    def __init__(self, direction: str = "") -> None:
        self._parser: Final = protocol.parser(MAX_ID if direction == "rx" else BROADCAST)
        self._kind: Final = {"rx": "reply", "tx": "request"}.get(direction, "")
        self._kinds: Final = _Kinds()

    def feed(self, data: Any) -> list[RecordedEvent]:
        """Take a chunk of bytes; return the events that are complete."""
        return [self._event(*found) for found in self._parser.feed(data)]

    def flush(self) -> list[RecordedEvent]:
        """End of data: return the packets in the held bytes, and the remainder as noise."""
        return [self._event(*found) for found in self._parser.feed(b"", end=True)]

    def _event(self, data: bytes, fault: str) -> RecordedEvent:
        if fault:
            return Noise(data, fault)
        packet = protocol.decode(data)
        kind = self._kind or self._kinds.kind(data, packet)[0]
        return RecordedFrame(data, kind, packet.id, packet.code)


def decode(data: bytes, maps: Mapping[int, str] = MappingProxyType({}), usual: str = "") -> list[Explanation]:
    """All packets and all runs of other bytes, in order; their parts cover every byte. Never raises.

    `maps` has the names of the register maps of known servos by id; `usual` is that of all others, "" for unknown.
    """
    text = _Text({id: TABLES[name] for id, name in maps.items() if name in TABLES}, TABLES.get(usual))
    parser = protocol.parser()
    found: list[Explanation] = []
    for piece, fault in (*parser.feed(data), *parser.feed(b"", end=True)):
        if not fault:
            found.append(text.explain(piece))
        elif fault == "checksum":
            found.append(_invalid(piece))
        else:
            found += [_invalid(part) for part in BEGIN.split(piece) if part]
    return found


class _Text:
    """Explains valid packets one after the other; knows the maps of identified servos."""

    def __init__(self, maps: dict[int, RegisterMap], usual: RegisterMap | None) -> None:
        self._maps = maps
        self._usual = usual
        self._kinds = _Kinds()

    def explain(self, data: bytes) -> Explanation:
        packet = protocol.decode(data)
        id, code, parameters = packet
        kind, address = self._kinds.kind(data, packet)
        to = "everyone" if id == BROADCAST else f"servo {id}"
        instruction = f"{protocol.instruction_name(code)} to {to}"
        alarm = self._alarms(packet)
        status = (
            f"status packet of servo {id}{f' with {counted(len(parameters))}' if parameters else ''}: {alarm}"
        )
        fields = _head(data)
        fault = ""
        if kind == "reply":
            if address == 0 and len(parameters) >= IDENTITY:
                major, minor, end, *model = parameters[:IDENTITY]
                table = choose((major, minor), (model[0], model[1]), end).table
                if table:
                    self._maps[id] = TABLES[table]
            title = f"{status} (or {instruction})" if code in RULES or code & 0xC0 else status
            fields.take(1, "error", self._alarms(packet))
            if address is not None:
                self._values(fields, id, address, len(parameters))
        else:
            also = "the same again: an echo, or " if kind == "either" else "or "
            title = instruction if id == BROADCAST else f"{instruction} ({also}{status})"
            doubt = "" if id == BROADCAST else f"; as an error byte: {alarm}"
            fields.take(1, "instruction", protocol.instruction_name(code) + doubt)
            fault = _impossible(packet)
            if protocol.suits(code, parameters):
                self._parameters(fields, packet)
        _unnamed(fields, len(fields.rest) - 1)
        fields.take_rest("checksum", "right")
        return Explanation(data, title, tuple(fields.parts), fault)

    def _alarms(self, packet: Packet) -> str:
        if not packet.code:
            return "no alarm"
        return f"alarm {self._by_map(packet.id, lambda table: ', '.join(alarms(packet.code, table.name)))}"

    def _parameters(self, fields: Fields, packet: Packet) -> None:
        id, code, parameters = packet
        if code == Instruction.CALIBRATE:
            fields.take(len(parameters), "position", _word(parameters))
            return
        if len(parameters) < 2:
            return
        address, count = parameters[:2]
        row_name = self._by_map(id, lambda table: _name(address, table))
        fields.take(1, "address", f"register {address}, {row_name}")
        if code in (Instruction.WRITE, Instruction.REG_WRITE):
            self._values(fields, id, address, len(parameters) - 1)
        elif code == Instruction.SYNC_WRITE:
            fields.take(1, "length", f"{counted(count)} for each servo")
            while len(fields.rest) > 1:
                servo = fields.rest[0]
                fields.take(1, "id", _id(servo))
                self._values(fields, servo, address, count)
        else:
            span = range(address, address + count)
            covered = self._by_map(
                id, lambda table: ", ".join(row.name for row in table.values() if row.address in span)
            )
            fields.take(1, "count", counted(count) + (f": {covered}" if covered else ""))
            for servo in parameters[2:]:
                fields.take(1, "id", _id(servo))

    def _values(self, fields: Fields, id: int, address: int, count: int) -> None:
        """The next bytes, which are registers from `address` on."""
        end = address + count
        while address < end:
            row = self._table(id).at(address)
            if row is not None and address + row.size > end:
                row = None
            size, name = (row.size, row.name) if row is not None else (1, "data")
            fields.take(size, name, self._by_map(id, partial(_value, address, fields.rest[:size])))
            address += size

    def _table(self, id: int) -> RegisterMap:
        return self._maps.get(id) or self._usual or TABLES["sts"]

    def _by_map(self, id: int, text: Callable[[RegisterMap], str]) -> str:
        """A text by the map of this servo, or by STS with a remark if other maps give another one."""
        shown = text(self._table(id))
        if id in self._maps or self._usual or all(text(table) == shown for table in TABLES.values()):
            return shown
        return f"{shown}, by the STS map"


# -- texts -----------------------------------------------------------------------------------------------------


def _head(data: bytes) -> Fields:
    fields = Fields(data)
    fields.take(2, "header", "a packet begins")
    if len(data) > 2:
        fields.take(1, "id", _id(data[2]))
    if len(data) > 3:
        size = f"{data[3] + 4} bytes in all" if data[3] >= 2 else "impossible, at least 2"
        fields.take(1, "length", f"{data[3]}: {size}")
    return fields


def _id(id: int) -> str:
    if id == BROADCAST:
        return "everyone (254)"
    return f"servo {id}" if id <= MAX_ID else "impossible: 255 is read as part of the header"


def _impossible(packet: Packet) -> str:
    """Why no servo carries out or answers this instruction; "" if one does."""
    name = protocol.instruction_name(packet.code)
    if packet.code not in RULES:
        return f"instruction 0x{packet.code:02X} is unknown: no servo obeys or answers"
    if not protocol.suits(packet.code, packet.parameters):
        return f"{name} with {counted(len(packet.parameters))} of parameters cannot be carried out"
    if packet.code in (Instruction.READ, Instruction.SYNC_READ) and not packet.parameters[1]:
        return f"{name} of no byte"
    if packet.code == Instruction.READ and packet.id == BROADCAST:
        return "no servo answers a READ to everyone"
    return ""


def _name(address: int, table: RegisterMap) -> str:
    """The register at this address, or the one whose second byte is there."""
    if row := table.at(address):
        return row.name
    before = table.at(address - 1)
    return f"second byte of {before.name}" if before and before.size == 2 else "not in the map"


def _value(address: int, data: bytes, table: RegisterMap) -> str:
    row = table.at(address)
    if row is None or row.size != len(data):
        return f"register {address}, {_name(address, table)}: {data[0]}"
    raw = row.decode(data)
    if raw in row.choices:
        return f"{raw} ({row.choices[raw]})"
    if row.bits:
        return f"{raw} ({', '.join(name for bit, name in row.bits.items() if raw >> bit & 1) or 'none'})"
    return f"{raw} ({row.to_value(raw):.4g} {row.unit})" if row.unit else str(raw)


def _unnamed(fields: Fields, count: int) -> None:
    data = fields.rest[:count]
    fields.take(count, "parameters", _word(data) if count == 2 else " ".join(map(str, data)))


def _word(data: bytes) -> str:
    little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
    return f"{little} if little-endian (STS, SMS, HLS), {big} if big-endian (SCS)"


# -- invalid bytes ---------------------------------------------------------------------------------------------


def _invalid(data: bytes) -> Explanation:
    """Explain bytes that are no valid packet; they contain at most one header, at their beginning."""
    fault = _fault(data)
    if data[:2] != HEADER or set(data) == {0xFF}:
        fields = Fields(data)
        fields.take_rest("stray", counted(len(data)))
        return Explanation(data, "no packet", tuple(fields.parts), fault)
    fields = _head(data)
    if len(data) > 4:
        either = f"{protocol.instruction_name(data[4])}, or " if data[4] in RULES else ""
        fields.take(1, "instruction or error", f"{either}alarm {', '.join(alarms(data[4])) or 'none'}")
    is_whole = len(data) > 5 and len(data) == data[3] + 4
    _unnamed(fields, len(fields.rest) - is_whole)
    fields.take_rest("checksum", f"wrong, should be {protocol.checksum(data[2:-1]):02X}")
    return Explanation(data, "broken packet", tuple(fields.parts), fault)


def _fault(data: bytes) -> str:
    if set(data) == {0xFF}:
        return "FF without a packet: the header is the last two FF before an id"
    if data[:2] != HEADER:
        return "no packet begins here: there is no FF FF"
    if data[2:3] == HEADER[:1]:
        return "id 255 is impossible: FF FF FF is a header with one FF too many"
    if len(data) < 4:
        return f"cut off after {counted(len(data))}: a packet has at least {protocol.OVERHEAD}"
    if data[3] < 2:
        return f"length {data[3]} is impossible: it counts at least instruction and checksum, 2"
    if len(data) != data[3] + 4:
        return f"length {data[3]} means {data[3] + 4} bytes but {len(data)} are there"
    return f"checksum {data[-1]:02X} is wrong, should be {protocol.checksum(data[2:-1]):02X}"
