"""Several simulated servos on one half-duplex wire: who hears which packet, who answers, and when.

What all real ones have in common, so no switch: a packet with a wrong checksum is met with silence; a broadcast is
obeyed and not answered, PING excepted; at status return level 0 only PING and READ are answered (FEETECH serial bus
servo protocol manual V1.01, 1.1 and 1.3), and of SYNC READ, which that manual has not, a switch decides. Servos that
answer at once pull the wire low together.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Hashable, Iterable, Mapping, Sequence
from itertools import count
from operator import attrgetter
from random import Random
from typing import Final, NamedTuple, cast

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import effects
from motorbus.families.feetech.simulator.collision import BITS, Speech, heard, overlapping
from motorbus.families.feetech.simulator.fate import Fate
from motorbus.families.feetech.simulator.instructions import MOST, OBEY, Answer, told
from motorbus.families.feetech.simulator.memory import Layout
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.servo import Servo
from motorbus.families.feetech.simulator.sight import Seen, Sight, shown
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.wire import (
    BROADCAST,
    MAX_ID,
    OVERHEAD,
    Instruction,
    InstructionPacket,
    Splitter,
    decode_sync_read,
    decode_sync_write,
    frame,
)

_USUAL_RATE = 1_000_000
_TWIN_JITTER: Final = 20
"""Bits by which a duplicate begins its reply later, at most. # assumption: two equal servos never reply in step"""
_ANSWERED_AT_LEVEL_0 = (Instruction.PING, Instruction.READ)
_BY_SECOND_ID = (Instruction.WRITE, Instruction.REG_WRITE)
_NOBODY: tuple[Servo, ...] = ()
_WHEN = attrgetter("when")
_made: Final = tuple.__new__
"""Makes a named tuple in half the time of its own call: each packet of each servo needs one."""


class Voice(NamedTuple):
    """A packet that a servo begins to send at `when`; it is not sent if the servo has lost its supply since.

    Without a servo it is the echo of an adapter.
    """

    when: float
    order: int
    data: bytes
    servo: Servo | None = None
    life: int = 0


class FeetechBus:
    """A `motorbus.core.family.Simulator` of FEETECH servos.

    `servos` are all of them in the order given, two with one id included; `now` is the latest moment it was told.
    `twins` are those of them that duplicate an id; unless `reply_jitter` is set they reply up to 20 bits later.
    `model` is that of all, or those of each. `usual_rate` is the rate that the first had at first (bit/s), by which to
    open the bus.
    """

    def __init__(
        self,
        ids: Iterable[int],
        model: Model | Sequence[Model],
        *,
        position: int | Mapping[int, int] | None = None,
        switches: Switches | None = None,
    ) -> None:
        self.switches = switches or Switches()
        self.now = 0.0
        self.rate: int | None = None
        self._splitter = Splitter("instruction")
        self._heard_at = 0.0
        self._voices: list[Voice] = []  # in the order in which they begin
        self._order = count()
        self._by_id: dict[int, list[Servo]] | None = None
        self._by_second: dict[int, list[Servo]] = {}
        self._random = Random(self.switches.seed)
        self._jitter = self.switches.reply_jitter
        self._read_by_map = self.switches.sync_read == "by_map"
        self._sight = Sight()
        numbers = list(ids)
        kinds = [model] * len(numbers) if isinstance(model, Model) else list(model)
        distinct = {id(kind): kind for kind in kinds}
        layouts = {key: Layout(kind.table, kind.defaults) for key, kind in distinct.items()}
        clock, renamed = self._clock, self._forget_ids
        self.servos = tuple(
            Servo(
                _checked(number),
                kind,
                layouts[id(kind)],
                self.switches,
                clock,
                renamed,
                position.get(number) if isinstance(position, Mapping) else position,
            )
            for number, kind in zip(numbers, kinds, strict=True)
        )
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 1-6")
        self.twins: frozenset[Servo] = frozenset()
        self._fate = Fate(self.servos, self.switches)
        self.usual_rate = self.servos[0].baud_rate

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by the id they have now; of two with one id the first."""
        return {id: servos[0] for id, servos in self._ids().items()}

    def duplicate(self, id: int) -> None:
        """A second servo with this id is there from now on, like the first and as it ships but for id and rate.

        Raises RequestError when there is none.
        """
        if id not in self._ids():
            raise RequestError(f"no servo has the id {id}")
        first = self._ids()[id][0]
        layout, switches = first.memory.layout, self.switches
        twin = Servo(id, first.model, layout, switches, self._clock, self._forget_ids, None)
        twin.memory["baud_rate"] = twin.memory.stored[twin.memory.layout.table["baud_rate"].address] = (
            first.memory["baud_rate"]
        )
        self.servos = (*self.servos, twin)
        self.twins |= {twin}
        self._fate = Fate(self.servos, self.switches)
        self._fate.expect(self.now)
        self._forget_ids()

    def tune(self, rate: int) -> None:
        """The host's rate; servos set to another one neither hear nor are heard."""
        self.rate = rate

    def due(self) -> float | None:
        """When the next packet begins, or None."""
        return self._voices[0].when if self._voices else None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Every packet that a servo begins to send up to this moment, each with its own, in order."""
        sent: list[tuple[float, Data]] = []
        if self._voices:
            ripe = bisect_right(self._voices, to, key=_WHEN)
            begun, self._voices = self._voices[:ripe], self._voices[ripe:]
            for when, _, data, servo, life in begun:
                self._pass(when)
                if servo is None or servo.lives == life:
                    sent.append((when, data))
        self._pass(to)
        return sent

    def receive(self, data: Data, at: float) -> None:
        """Bytes of the host, cut anywhere, several packets in one piece or half of one."""
        if isinstance(data, CanFrame):
            return
        self._pass(at)
        if self.switches.echo:
            self._speak(at, bytes(data), None)
        began = at - len(data) * self._byte_time(None)
        if self.switches.frame_gap and began - self._heard_at > self.switches.frame_gap:
            self._splitter = Splitter("instruction")
        self._heard_at = at
        for packet in self._splitter.feed(data):
            if isinstance(packet, InstructionPacket):
                self._hear(packet, at)

    obeys_at_once = True

    def sight(self, at: float) -> Iterable[tuple[int, tuple[Hashable, ...]]]:
        """What each servo holds at this moment, those with one id included."""
        return self._sight.all(self.servos, at)

    def shown(self, picture: tuple[Hashable, ...], name: str) -> int:
        """What a picture of a servo has in this row."""
        return shown(cast("Seen", picture), name)

    def _pass(self, to: float) -> None:
        """Let time pass, and everything happen that servos do by themselves meanwhile."""
        if self._fate.soon <= to:
            self._fate.live(to, self.now, self._tell)
        if to > self.now:
            self.now = to

    def _clock(self) -> float:
        return self.now

    def _tell(self, moment: float) -> None:
        self.now = moment

    def _hear(self, packet: InstructionPacket, at: float) -> None:
        if packet.instruction == Instruction.SYNC_READ:
            self._sync_read(packet, at)
        elif packet.instruction == Instruction.SYNC_WRITE:
            self._sync_write(packet, at)
        elif packet.instruction in OBEY:
            self._obey(packet, at)

    def _obey(self, packet: InstructionPacket, at: float) -> None:
        """Everyone addressed obeys at this very moment; then those speak who may."""
        broadcast = packet.id == BROADCAST
        speaking: list[tuple[Servo, Answer]] = []
        for servo in self._hearing(self.servos if broadcast else self._addressed(packet), at):
            id, rate = servo.id, servo.memory["baud_rate"]
            answer = OBEY[packet.instruction](servo, packet.parameters, at)
            if answer is None or not self._answers(servo, id, packet):
                continue
            if self.switches.baud_ack == "new" and rate != servo.memory["baud_rate"]:
                continue
            new = servo.id if self.switches.id_ack == "new" else id
            speaking.append((servo, answer._replace(id=new)))
        if broadcast and self.switches.broadcast_ping == "in_turn":
            self._in_turn(speaking, at)
        else:
            self._at_once(speaking, at)

    def _addressed(self, packet: InstructionPacket) -> Sequence[Servo]:
        """Those with this id, and for writes those HLS that have it as their second one (HLS memory table)."""
        servos = self._ids().get(packet.id, _NOBODY)
        if packet.instruction in _BY_SECOND_ID and packet.id in self._by_second:
            return [*servos, *self._by_second[packet.id]]
        return servos

    def _answers(self, servo: Servo, id: int, packet: InstructionPacket) -> bool:
        """Whether this servo, which had that id when it heard the packet, may speak."""
        if packet.id == BROADCAST:
            return packet.instruction == Instruction.PING and servo.model.control.broadcast_ping
        if packet.id != id and self.switches.second_id == "silent":
            return False
        return packet.instruction in _ANSWERED_AT_LEVEL_0 or servo.memory["status_return_level"] != 0

    def _sync_write(self, packet: InstructionPacket, at: float) -> None:
        order = decode_sync_write(packet.parameters)
        if order is None or packet.id != BROADCAST or not order.length:
            return
        address, rate = order.address, self.rate
        for id, data in order.items:
            named: Sequence[Servo] = (self._by_id or self._ids()).get(
                id, _NOBODY
            )  # a write may have renamed some
            if id in self._by_second:
                named = [*named, *self._by_second[id]]
            if len(named) == 1:  # most are like that
                if named[0].hears(rate, at):
                    effects.write(named[0], address, data, at)
                continue
            for servo in self._hearing(named, at):
                effects.write(servo, address, data, at)

    def _sync_read(self, packet: InstructionPacket, at: float) -> None:
        """One packet per listed servo, back to back, in the order of the list (FTServo_Linux, FTServo_Python)."""
        order = decode_sync_read(packet.parameters)
        if order is None or packet.id != BROADCAST or order.length > MOST:
            return
        address, length, rate = order.address, order.length, self.rate
        moment, ids, syncs = at, self._ids(), self._syncs
        for id in order.ids:
            servos: Sequence[Servo] = ids.get(id, _NOBODY)
            if len(servos) == 1 and servos[0].hears(rate, at) and syncs(servos[0]):  # most are like that
                moment = self._alone(servos[0], told(servos[0], address, length, at), moment)
                continue
            servos = [one for one in servos if one.hears(rate, at) and syncs(one)]
            if servos:
                moment = self._at_once([(one, told(one, address, length, at)) for one in servos], moment)
            elif self.switches.sync_read_missing == "silent":
                return
            elif self.switches.sync_read_missing == "wait":
                moment += self._byte_time(None) * (length + OVERHEAD)

    def _syncs(self, servo: Servo) -> bool:
        if self._read_by_map:
            return servo.model.control.sync_read
        wish = self.switches.sync_read
        return servo.model.control.sync_read if wish == "by_map" else wish == "yes"

    def _in_turn(self, speaking: list[tuple[Servo, Answer]], at: float) -> None:
        for one in sorted(speaking, key=lambda pair: pair[0].id):
            at = self._at_once([one], at)

    def _at_once(self, speaking: Sequence[tuple[Servo, Answer]], at: float) -> float:
        """Each begins when its return delay is over; those who overlap garble each other. Gives the last end."""
        if len(speaking) == 1:
            return self._alone(*speaking[0], at)
        end = at
        spoken = [Speech(*self._said(servo, answer, at), servo) for servo, answer in speaking]
        for together in overlapping(spoken):
            servo = together[0].servo
            data = heard(
                together, self._byte_time(None) / BITS, drop_unframed=self.switches.framing == "drop"
            )
            if data:
                self._speak(together[0].start, data, servo)
            end = max(end, *(one.end for one in together))
        return end

    def _alone(self, servo: Servo, answer: Answer, at: float) -> float:
        """Nobody speaks with it, so that every byte is heard as it was sent. Gives its end."""
        start, data, bit = self._said(servo, answer, at)
        self._speak(start, data, servo)
        return max(at, start + BITS * bit * len(data))

    def _speak(self, when: float, data: bytes, servo: Servo | None) -> None:
        """Somebody, or an echo, begins to send this at that moment."""
        life, voices = servo.lives if servo else 0, self._voices
        voice = _made(Voice, (when, next(self._order), data, servo, life))
        if voices and when < voices[-1].when:
            insort(voices, voice)
        else:  # most follow one another
            voices.append(voice)

    def _said(self, servo: Servo, answer: Answer, at: float) -> tuple[float, bytes, float]:
        """When it begins, what it sends, and for how long each bit of that (s)."""
        parameters, id, later = answer
        own, error, delay = servo.speaks()
        bit = self._byte_time(servo) / BITS
        if self._jitter:
            later += self._jitter * self._random.random()
        elif servo in self.twins:
            later += _TWIN_JITTER * bit * self._random.random()
        data = frame(own if id is None else id, error, parameters)
        return at + delay + later, data, bit

    def _byte_time(self, servo: Servo | None) -> float:
        """Seconds of a byte on the wire: ten bits."""
        return 10 / (self.rate or (servo and servo.baud_rate) or _USUAL_RATE)

    def _hearing(self, servos: Iterable[Servo], at: float) -> list[Servo]:
        return [servo for servo in servos if servo.hears(self.rate, at)]

    def _ids(self) -> dict[int, list[Servo]]:
        if self._by_id is None:
            self._by_id, self._by_second = {}, {}
            for servo in self.servos:
                self._by_id.setdefault(servo.id, []).append(servo)
                second = servo.second_id
                if second is not None and second != servo.id:
                    self._by_second.setdefault(second, []).append(servo)
        return self._by_id

    def _forget_ids(self) -> None:
        self._by_id = None


def _checked(id: int) -> int:
    if not 0 <= id <= MAX_ID:
        raise RequestError(f"id {id} is not possible", expected=f"0 to {MAX_ID}")
    return id
