"""Simulated servos on one half-duplex wire: who receives which packet, who replies, and when.

A packet with a wrong checksum is ignored. A broadcast is carried out and, but for PING, not answered; at
status return level 0 only reads are (FEETECH serial bus servo protocol manual V1.01, 1.1 and 1.3). The wire
idles high and each 0 bit pulls it low, so replies that overlap are ANDed. Simplified: by whole bytes.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable, Mapping
from itertools import count
from math import ceil, inf
from operator import attrgetter
from random import Random
from typing import Final, NamedTuple

from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.protocol import BROADCAST, MAX_ID, MAX_PARAMETERS, OVERHEAD, Instruction
from motorbus.families.feetech.registers.codes import BAUD_CODES, BAUD_CODES_OF
from motorbus.families.feetech.simulator.models import Model
from motorbus.families.feetech.simulator.quirks import Quirks
from motorbus.families.feetech.simulator.servo import Servo

BITS: Final = 10  # of a byte on the wire
JITTER: Final = 20  # bits by which a second servo with an id may be late # assumption
SLACK: Final = 0.05  # of a byte; replies that are less apart start together
FRAME_GAP: Final = 0.005  # s; after a longer pause an incomplete packet is dropped # assumption
USUAL_RATE: Final = 1_000_000  # bit/s, of a host that has not set one
WRITES: Final = (Instruction.WRITE, Instruction.REG_WRITE, Instruction.SYNC_WRITE)
ALWAYS: Final = (Instruction.PING, Instruction.READ)  # answered at every status return level
_WHEN: Final = attrgetter("when")
_TRIPS_AT: Final = attrgetter("trips_at")


class Reply(NamedTuple):
    """Bytes that start at `when` (s), if the `lives` of the servo are the same; without servo an echo."""

    when: float
    order: int
    data: bytearray
    servo: Servo | None
    life: int


class FeetechBus:
    """A `core.family.Simulator` of FEETECH servos; `now` is the latest time (s).

    `servos` are those of the ids as given, then second ones; `usual_rate` is the rate of the first one when
    it was made (bit/s). Servos that ship with different rates have 1 Mbit/s, unless `quirks` name one.
    """

    def __init__(self, ids: Iterable[int], models: Iterable[Model], quirks: Quirks) -> None:
        self.quirks = quirks
        self.now = 0.0
        self.rate: int | None = None
        self.servos: tuple[Servo, ...] = ()
        self._parser = protocol.parser()
        self._received_at = 0.0
        self._replies: list[Reply] = []
        self._order = count()
        self._random = Random(0)
        models = list(models)
        rate = quirks.servo_baud
        if not rate and len({model.rate for model in models}) > 1:
            rate = USUAL_RATE
        for id, model in zip(ids, models, strict=True):
            codes = [code for code in BAUD_CODES_OF[model.table.name] if BAUD_CODES[code] == rate]
            if rate and not codes:
                raise RequestError(
                    f"a {model.name} has no rate of {rate} bit/s", expected="a rate of its map"
                )
            self._add(id, model, codes[0] if rate else None)
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 1-6")
        self.usual_rate: int = self.servos[0].baud_rate or 0

    def _add(self, id: int, model: Model, baud_code: int | None) -> Servo:
        if not 0 <= id <= MAX_ID:
            raise RequestError(f"id {id} is not possible", expected=f"0 to {MAX_ID}")
        servo = Servo(id, model, self.quirks, lambda: self.now, baud_code)
        self.servos = (*self.servos, servo)
        return servo

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by their present id; the first of two with one id."""
        found: dict[int, Servo] = {}
        for servo in self.servos:
            found.setdefault(servo.id, servo)
        return found

    def duplicate(self, id: int) -> None:
        """Add a servo as shipped, with this id and the rate of the servo that has it.

        Raises RequestError when there is none.
        """
        first = self.nodes.get(id)
        if first is None:
            raise RequestError(f"no servo has the id {id}", expected=f"one of {sorted(self.nodes)}")
        self._add(id, first.model, first.memory["baud_rate"]).jitter = JITTER

    def tune(self, rate: int) -> None:
        """Set the rate of the host (bit/s); servos set to another one neither receive nor are received."""
        self.rate = rate or None

    def due(self) -> float | None:
        """The moment (s) of the next reply, or None."""
        return self._replies[0].when if self._replies else None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """The replies that start up to this moment (s), in order."""
        sent: list[tuple[float, Data]] = []
        while self._replies and self._replies[0].when <= to:
            reply = self._replies.pop(0)
            self._pass(reply.when)
            if reply.servo is None or reply.servo.lives == reply.life:
                sent.append((reply.when, bytes(reply.data)))
        self._pass(to)
        return sent

    def receive(self, data: Data, at: float) -> None:
        """Take bytes of the host whose last bit arrives at this moment (s)."""
        if not isinstance(data, bytes):
            return
        self._pass(at)
        if self.quirks.echo:
            self._send([Reply(at, next(self._order), bytearray(data), None, 0)])
        if self._parser.held and at - len(data) * self._byte_time(None) - self._received_at > FRAME_GAP:
            self._parser = protocol.parser()
        self._received_at = at
        for frame, fault in self._parser.feed(data):
            if not fault:
                self._carry_out(protocol.decode(frame), at)

    def _pass(self, to: float) -> None:
        """Time passes; servos trip meanwhile by themselves."""
        while (servo := min(self.servos, key=_TRIPS_AT)).trips_at <= to:
            self.now = max(self.now, servo.trips_at)
            servo.trip()
        self.now = max(self.now, to)

    # -- instructions ------------------------------------------------------------------------------

    def _carry_out(self, packet: protocol.Packet, at: float) -> None:
        id, code, parameters = packet
        if code == Instruction.SYNC_READ and protocol.suits(code, parameters):
            self._sync_read(packet, at)
        elif code == Instruction.SYNC_WRITE:
            items = protocol.decode_sync_write(parameters) if id == BROADCAST else None
            for item_id, data in items.items if items else ():
                for servo in self._receivers(item_id, code, at):
                    servo.carry_out(Instruction.WRITE, parameters[:1] + data, at)
        else:
            found = [self._answer(servo, packet, at) for servo in self._receivers(id, code, at)]
            answers = [answer for answer in found if answer is not None]
            if id == BROADCAST and self.quirks.broadcast_ping == "in_turn":
                for answer in sorted(answers, key=lambda answer: answer.data[2]):
                    at = self._send([answer._replace(when=at)])
            else:
                self._send(answers)

    def _receivers(self, id: int, code: int, at: float) -> list[Servo]:
        """The servos that take this instruction to this id."""
        return [
            servo
            for servo in self.servos
            # An HLS carries out writes to its second id as well (HLS memory table).
            if (
                id in (servo.id, BROADCAST) or (code in WRITES and id == servo.memory.values.get("second_id"))
            )
            and servo.receives(self.rate, at)
        ]

    def _answer(self, servo: Servo, packet: protocol.Packet, at: float) -> Reply | None:
        """The reply of a servo that carries out an instruction."""
        id, rate = servo.id, servo.baud_rate
        parameters = servo.carry_out(packet.code, packet.parameters, at)
        if packet.id == BROADCAST:
            replies = packet.code == Instruction.PING and servo.model.traits.broadcast_ping
        else:  # a write to a second id is not answered # assumption
            replies = packet.id == id and (packet.code in ALWAYS or servo.memory["status_return_level"] != 0)
        if self.quirks.baud_ack == "new" and rate != servo.baud_rate:
            replies = False
        if parameters is None or not replies:
            return None
        own = servo.id if self.quirks.id_ack == "new" else id
        return self._reply(servo, own, parameters, at, packet.code)

    def _reply(self, servo: Servo, id: int, parameters: bytes, at: float, code: int) -> Reply:
        """A status packet, sent when the EEPROM has stored; that to RESET is sent before."""
        if self.quirks.eeprom_commit == "before_ack" and code != Instruction.RESET:
            at = max(at, servo.memory.busy_until)  # a reply to any request waits for it # assumption
        at += servo.reply_delay
        if servo.jitter:
            at += servo.jitter * self._byte_time(servo) / BITS * self._random.random()
        data = bytearray(protocol.frame(id, servo.error, parameters))
        return Reply(at, next(self._order), data, servo, servo.lives)

    def _sync_read(self, packet: protocol.Packet, at: float) -> None:
        """One reply for each id, back to back in the order of the list (FTServo_Linux, FTServo_Python).

        It is answered at every status return level. # assumption
        """
        code, (address, length, *ids) = packet.code, packet.parameters
        if length > MAX_PARAMETERS or packet.id != BROADCAST:
            return
        for id in ids:
            answers = [
                self._reply(servo, id, servo.read(address, length), at, code)
                for servo in self._receivers(id, code, self.now)
                if servo.model.traits.sync_read and code not in servo.lacks
            ]
            if answers:
                at = self._send(answers)
            elif self.quirks.sync_read_missing == "silent":
                return
            elif self.quirks.sync_read_missing == "wait":
                at += self._byte_time(None) * (length + OVERHEAD)

    # -- the wire ----------------------------------------------------------------------------------

    def _send(self, replies: Iterable[Reply]) -> float:
        """Send replies of one moment, those that overlap as one; returns the end (s) of the last one."""
        end = -inf
        for reply in sorted(replies, key=_WHEN):
            byte = self._byte_time(reply.servo)
            if reply.when > end - SLACK * byte:
                first = reply
                insort(self._replies, reply)
            else:
                start, wire = ceil((reply.when - first.when) / byte - SLACK), first.data
                wire += b"\xff" * (start + len(reply.data) - len(wire))
                for place, value in enumerate(reply.data, start):
                    wire[place] &= value
            end = max(end, reply.when + len(reply.data) * byte)
        return end

    def _byte_time(self, servo: Servo | None) -> float:
        """Seconds of a byte on the wire."""
        return BITS / (self.rate or (servo and servo.baud_rate) or USUAL_RATE)
