"""FEETECH packets as text, field by field, with the reason why a packet is invalid.

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
from typing import Final, NamedTuple

from motorbus.core.decode import Fields, counted
from motorbus.core.family import Explanation
from motorbus.core.register import Register, RegisterMap
from motorbus.families.feetech import protocol
from motorbus.families.feetech.models import choose
from motorbus.families.feetech.protocol import BROADCAST, HEADER, MAX_ID, RULES, Instruction, Packet
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.registers.codes import alarms

HEAD: Final = 5  # registers that identify a servo
FOREIGN: Final[Mapping[bytes, str]] = {
    b"\xff\xff\xfd\x00": "a Dynamixel 2.0 packet, which no FEETECH servo answers",
    b"\x55\x55": "a packet of LX or Hiwonder servos, which no FEETECH servo answers",
}
"""First bytes of packets of other makers -> text."""
BEGIN: Final = re.compile(rb"(?<!\xff)(?=\xff\xff)")  # of a header; the last two FF of a run are the header


def decode(data: bytes, maps: Mapping[int, str] = MappingProxyType({}), usual: str = "") -> list[Explanation]:
    """All packets and all runs of other bytes, in order; their parts cover every byte. Never raises.

    `maps` has the names of the register maps of known servos by id; `usual` is that of all others, "" for unknown.
    """
    talk = _Talk({id: TABLES[name] for id, name in maps.items() if name in TABLES}, TABLES.get(usual))
    parser = protocol.parser()
    found: list[Explanation] = []
    for piece, fault in [*parser.feed(data), *parser.feed(b"", end=True)]:
        if not fault:
            found.append(talk.explain(piece))
        elif fault == "checksum":
            found.append(_invalid(piece))
        else:
            found += [_invalid(part) for part in BEGIN.split(piece) if part]
    return found


class _Asked(NamedTuple):
    """What the next status packet of a servo carries: so many bytes from this register on."""

    address: int
    size: int


class _Talk:
    """The packets before: the last instruction, what each servo was asked for, the maps of identified servos."""

    def __init__(self, maps: dict[int, RegisterMap], usual: RegisterMap | None) -> None:
        self.maps = maps
        self.usual = usual
        self.last = b""
        self.asked: dict[int, _Asked] = {}

    def explain(self, data: bytes) -> Explanation:
        """A packet is an instruction if its form allows that and no answer of this form is due."""
        packet = protocol.decode(data)
        is_one = packet.id != BROADCAST
        if data == self.last and is_one:
            return self._instruction(
                data, packet, f"the same again: an echo, or {self._status_title(packet)}"
            )
        asked = self.asked.pop(packet.id, None)
        answers = asked is not None and asked.size == len(packet.parameters)
        if is_one and (answers or not protocol.suits(packet.code, packet.parameters)):
            return self._status(data, packet, asked if answers else None)
        self.last = data
        self._expect(packet)
        return self._instruction(data, packet, f"or {self._status_title(packet)}" if is_one else "")

    def _expect(self, packet: Packet) -> None:
        parameters = packet.parameters
        if packet.code == Instruction.SYNC_READ and len(parameters) >= 3:
            self.asked.update(dict.fromkeys(parameters[2:], _Asked(*parameters[:2])))
        elif packet.id != BROADCAST:
            whole = packet.code == Instruction.READ and len(parameters) == 2
            self.asked[packet.id] = _Asked(*parameters) if whole else _Asked(0, 0)

    # -- packets -------------------------------------------------------------------------------------------------

    def _status(self, data: bytes, packet: Packet, asked: _Asked | None) -> Explanation:
        values = packet.parameters
        if asked and asked.address == 0 and len(values) >= HEAD:
            choice = choose((values[0], values[1]), (values[3], values[4]), values[2])
            if choice.table:
                self.maps[packet.id] = TABLES[choice.table]
        title = self._status_title(packet)
        if packet.code in RULES or packet.code & 0xC0:
            title += f" (or {_instruction_title(packet)})"
        fields = _head(data)
        fields.take(1, "error", self._alarms(packet))
        if asked:
            self._values(fields, packet.id, asked.address, len(values))
        else:
            _unnamed(fields, len(values))
        return _explanation(fields, data, title)

    def _instruction(self, data: bytes, packet: Packet, also: str) -> Explanation:
        fields = _head(data)
        doubt = f"; as an error byte: {self._alarms(packet)}" if packet.id != BROADCAST else ""
        fields.take(1, "instruction", protocol.instruction_name(packet.code) + doubt)
        fault = _impossible(packet)
        if not protocol.suits(packet.code, packet.parameters):
            _unnamed(fields, len(packet.parameters))
        else:
            self._parameters(fields, packet)
        return _explanation(fields, data, _instruction_title(packet) + (f" ({also})" if also else ""), fault)

    def _status_title(self, packet: Packet) -> str:
        count = len(packet.parameters)
        carried = f" with {counted(count)}" if count else ""
        return f"status packet of servo {packet.id}{carried}: {self._alarms(packet)}"

    def _alarms(self, packet: Packet) -> str:
        if not packet.code:
            return "no alarm"
        return f"alarm {self._by_map(packet.id, lambda table: ', '.join(alarms(packet.code, table.name)))}"

    # -- parameters ----------------------------------------------------------------------------------------------

    def _parameters(self, fields: Fields, packet: Packet) -> None:
        count = len(packet.parameters)
        match packet.code:
            case Instruction.READ | Instruction.SYNC_READ:
                self._span(fields, packet)
            case Instruction.WRITE | Instruction.REG_WRITE:
                address = self._address(fields, packet)
                self._values(fields, packet.id, address, count - 1)
            case Instruction.SYNC_WRITE:
                address = self._address(fields, packet)
                length = packet.parameters[1]
                fields.take(1, "length", f"{counted(length)} for each servo")
                for at in range(2, count, length + 1):
                    fields.take(1, "id", _id(packet.parameters[at]))
                    self._values(fields, packet.parameters[at], address, length)
            case Instruction.CALIBRATE:
                fields.take(count, "position", _word(packet.parameters))
            case _:
                _unnamed(fields, count)

    def _span(self, fields: Fields, packet: Packet) -> None:
        address, count = packet.parameters[:2]

        def names(table: RegisterMap) -> str:
            return ", ".join(row.name for row in table.values() if address <= row.address < address + count)

        self._address(fields, packet)
        covered = self._by_map(packet.id, names)
        fields.take(1, "count", counted(count) + (f": {covered}" if covered else ""))
        for id in packet.parameters[2:]:
            fields.take(1, "id", _id(id))

    def _address(self, fields: Fields, packet: Packet) -> int:
        address = packet.parameters[0]
        name = self._by_map(packet.id, lambda table: _name(address, table))
        fields.take(1, "address", f"register {address}, {name}")
        return address

    def _values(self, fields: Fields, id: int, address: int, count: int) -> None:
        """The next bytes, which are registers from `address` on."""
        table = self._table(id)
        data = fields.rest[:count]
        at = 0
        while at < count:
            row = table.at(address + at)
            size = row.size if row and at + row.size <= count else 1
            piece = data[at : at + size]
            name = row.name if row and row.size == size else "data"
            fields.take(size, name, self._by_map(id, partial(_value, address + at, piece)))
            at += size

    def _table(self, id: int) -> RegisterMap:
        return self.maps.get(id) or self.usual or TABLES["sts"]

    def _by_map(self, id: int, text: Callable[[RegisterMap], str]) -> str:
        """A text by the map of this servo, or by STS with a remark if other maps give another one."""
        shown = text(self._table(id))
        if id in self.maps or self.usual or all(text(table) == shown for table in TABLES.values()):
            return shown
        return f"{shown}, by the STS map"


# -- texts -----------------------------------------------------------------------------------------------------


def _explanation(fields: Fields, data: bytes, title: str, fault: str = "") -> Explanation:
    fields.take_rest("checksum", "right")
    return Explanation(data, title, tuple(fields.parts), fault)


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


def _instruction_title(packet: Packet) -> str:
    receiver = "everyone" if packet.id == BROADCAST else f"servo {packet.id}"
    return f"{protocol.instruction_name(packet.code)} to {receiver}"


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
    if before and before.size == 2:
        return f"second byte of {before.name}"
    return "not in the map"


def _value(address: int, data: bytes, table: RegisterMap) -> str:
    row = table.at(address)
    if row is None or row.size != len(data):
        return f"register {address}, {_name(address, table)}: {data[0]}"
    return _meaning(row, row.decode(data))


def _meaning(row: Register, raw: int) -> str:
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
    foreign = next((text for head, text in FOREIGN.items() if data.startswith(head)), "")
    fault = foreign or _fault(data)
    if foreign or data[:2] != HEADER or set(data) == {0xFF}:
        fields = Fields(data)
        fields.take_rest("stray", foreign or counted(len(data)))
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
