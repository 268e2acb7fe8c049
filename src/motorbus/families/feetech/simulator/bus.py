"""Simulated servos on one half-duplex wire: who receives which packet, who replies, and when.

A packet with a wrong checksum is ignored. A broadcast is carried out and, but for PING, not answered; at
status return level 0 only reads are (FEETECH serial bus servo protocol manual V1.01, 1.1 and 1.3). The wire
idles high and each 0 bit pulls it low, so replies that overlap are ANDed. Simplified: by whole bytes.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from math import ceil, inf
from operator import attrgetter
from random import Random
from typing import Final, NamedTuple

from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.protocol import BROADCAST, MAX_ID, MAX_PARAMETERS, OVERHEAD, Instruction
from motorbus.families.feetech.simulator.instructions import carry_out
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
_NEXT: Final = attrgetter("overload.next")


class Reply(NamedTuple):
    """Bytes that start at `when` (s), if the `lives` of the servo are the same; without servo an echo."""

    when: float
    order: int
    data: bytes
    servo: Servo | None
    life: int


class FeetechBus:
    """A `core.family.Simulator` of FEETECH servos; `now` is the latest time (s).

    `servos` are those of the ids as given, then second ones; `usual_rate` is the rate of the first one when
    it was made (bit/s).
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
        for id, model in zip(ids, models, strict=True):
            self._add(id, model)
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 1-6")
        self.usual_rate: int = self.servos[0].baud_rate or 0

    def _add(self, id: int, model: Model) -> Servo:
        if not 0 <= id <= MAX_ID:
            raise RequestError(f"id {id} is not possible", expected=f"0 to {MAX_ID}")
        servo = Servo(id, model, self.quirks, lambda: self.now)
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
        if id not in self.nodes:
            raise RequestError(f"no servo has the id {id}", expected=f"one of {sorted(self.nodes)}")
        first = self.nodes[id]
        second = self._add(id, first.model)
        second.jitter = JITTER
        address = second.model.table["baud_rate"].address
        second.memory.live[address] = second.memory.stored[address] = first.memory["baud_rate"]

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
            when, _, data, servo, life = self._replies.pop(0)
            self._pass(when)
            if servo is None or servo.lives == life:
                sent.append((when, data))
        self._pass(to)
        return sent

    def receive(self, data: Data, at: float) -> None:
        """Take bytes of the host whose last bit arrives at this moment (s)."""
        if not isinstance(data, bytes):
            return
        self._pass(at)
        if self.quirks.echo:
            self._speak([Reply(at, 0, data, None, 0)])
        if self._parser.held and at - len(data) * self._byte_time(None) - self._received_at > FRAME_GAP:
            self._parser = protocol.parser()
        self._received_at = at
        for frame, fault in self._parser.feed(data):
            if not fault:
                self._carry_out(protocol.decode(frame), at)

    def _pass(self, to: float) -> None:
        """Let time pass; servos do meanwhile what they do by themselves."""
        while (servo := min(self.servos, key=_NEXT)).overload.next <= to:
            self.now = max(self.now, servo.overload.next)
            servo.trip()
        self.now = max(self.now, to)

    # -- instructions ------------------------------------------------------------------------------

    def _carry_out(self, packet: protocol.Packet, at: float) -> None:
        id, code, parameters = packet
        if code == Instruction.SYNC_READ and protocol.suits(code, parameters):
            self._sync_read(packet, at)
        elif code == Instruction.SYNC_WRITE:
            items = protocol.decode_sync_write(parameters)
            for item_id, data in items.items if items and id == BROADCAST else ():
                for servo in self._receivers(item_id, code, at):
                    carry_out(servo, Instruction.WRITE, bytes((parameters[0],)) + data, at)
        else:
            found = [self._answer(servo, packet, at) for servo in self._receivers(id, code, at)]
            answers = [answer for answer in found if answer is not None]
            if id == BROADCAST and self.quirks.broadcast_ping == "in_turn":
                for answer in sorted(answers, key=lambda answer: answer.data[2]):
                    at = self._speak([answer._replace(when=at)])
            else:
                self._speak(answers)

    def _receivers(self, id: int, code: int, at: float) -> list[Servo]:
        """The servos that take this instruction to this id."""
        servos: Iterable[Servo] = self.servos
        if id != BROADCAST and code in WRITES:
            servos = [servo for servo in servos if servo.obeys(id)]
        elif id != BROADCAST:
            servos = [servo for servo in servos if servo.id == id]
        return [servo for servo in servos if servo.receives(self.rate, at)]

    def _answer(self, servo: Servo, packet: protocol.Packet, at: float) -> Reply | None:
        """Let a servo carry out an instruction; returns its reply."""
        id, rate = servo.id, servo.baud_rate
        parameters = carry_out(servo, packet.code, packet.parameters, at)
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
        start = at  # a reply to any request waits for the EEPROM # assumption
        if self.quirks.eeprom_commit == "before_ack" and code != Instruction.RESET:
            start = max(at, servo.memory.busy_until)
        start += servo.reply_delay
        if servo.jitter:
            start += servo.jitter * self._byte_time(servo) / BITS * self._random.random()
        data = protocol.frame(id, servo.error, parameters)
        return Reply(start, 0, data, servo, servo.lives)

    def _sync_read(self, packet: protocol.Packet, at: float) -> None:
        """One reply for each id, back to back in the order of the list (FTServo_Linux, FTServo_Python).

        It is answered at every status return level. # assumption
        """
        code, (_, length, *ids) = packet.code, packet.parameters
        if length > MAX_PARAMETERS or packet.id != BROADCAST:
            return
        for id in ids:
            answers = [
                self._reply(servo, id, servo.read(*packet.parameters[:2]), at, code)
                for servo in self._receivers(id, code, self.now)
                if servo.model.traits.sync_read and code not in servo.lacks
            ]
            if answers:
                at = self._speak(answers)
            elif self.quirks.sync_read_missing == "silent":
                return
            elif self.quirks.sync_read_missing == "wait":
                at += self._byte_time(None) * (length + OVERHEAD)

    # -- the wire ----------------------------------------------------------------------------------

    def _speak(self, replies: Iterable[Reply]) -> float:
        """Send replies of one moment, those that overlap as one; returns the end (s) of the last one."""
        end, together = -inf, list[Reply]()
        for reply in sorted(replies, key=lambda reply: reply.when):
            byte = self._byte_time(reply.servo)
            if reply.when > end - SLACK * byte:
                self._send(together)
                together = []
            together.append(reply)
            end = max(end, reply.when + len(reply.data) * byte)
        self._send(together)
        return end

    def _send(self, together: Sequence[Reply]) -> None:
        """Send replies that overlap."""
        wire = bytearray()
        for reply in together:
            late = (reply.when - together[0].when) / self._byte_time(reply.servo)
            start = ceil(late - SLACK)
            wire += b"\xff" * (start + len(reply.data) - len(wire))
            for place, byte in enumerate(reply.data, start):
                wire[place] &= byte
        if together:
            insort(self._replies, together[0]._replace(order=next(self._order), data=bytes(wire)))

    def _byte_time(self, servo: Servo | None) -> float:
        """Seconds of a byte on the wire."""
        return BITS / (self.rate or (servo and servo.baud_rate) or USUAL_RATE)
