"""Several simulated servos on one half-duplex wire: who answers which packet, and when.

What all real ones have in common, so no switch: a packet with a wrong checksum, a wrong length or an unknown
instruction is met with silence, for no error code for it exists; a broadcast is obeyed and not answered, PING
excepted; at status return level 0 only PING and reads are answered (FEETECH serial bus servo protocol manual
V1.01, 1.1 and 1.3). Servos that answer at once pull the wire low together: wired-AND, byte by byte.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator.memory import Layout
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.servo import Servo
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

_MOST = 253
"""More bytes than this do not fit into one status packet."""
_USUAL_RATE = 1_000_000
_ANSWERED_AT_LEVEL_0 = (Instruction.PING, Instruction.READ)


class Voice(NamedTuple):
    """A packet that a servo begins to send at `when`; it is not sent if the servo has lost its supply since."""

    when: float
    order: int
    data: bytes
    servo: Servo
    life: int


class Answer(NamedTuple):
    """What one servo has to say to one packet: its parameters, from which id, and how much later than usual (s)."""

    parameters: bytes = b""
    id: int | None = None
    later: float = 0.0


class FeetechBus:
    """A `motorbus.core.family.Simulator` of FEETECH servos.

    `servos` are all of them in the order given, two with one id included; `now` is the latest moment it was told.
    """

    def __init__(
        self,
        ids: Iterable[int],
        model: Model,
        *,
        position: int | Mapping[int, int] | None = None,
        switches: Switches | None = None,
    ) -> None:
        self.switches = switches or Switches()
        self.now = 0.0
        self.rate: int | None = None
        self._splitter = Splitter("instruction")
        self._heard_at = 0.0
        self._voices: list[Voice] = []
        self._order = count()
        self._by_id: dict[int, list[Servo]] | None = None
        layout = Layout(model.table, model.defaults)
        self.servos = tuple(
            Servo(
                _checked(id),
                model,
                layout,
                self.switches,
                lambda: self.now,
                self._forget_ids,
                position.get(id) if isinstance(position, Mapping) else position,
            )
            for id in ids
        )
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 1-6")

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by the id they have now; of two with one id the first."""
        return {id: servos[0] for id, servos in self._ids().items()}

    def tune(self, rate: int) -> None:
        """The host's rate; servos set to another one neither hear nor are heard."""
        self.rate = rate

    def due(self) -> float | None:
        """When the next packet begins, or None."""
        return self._voices[0].when if self._voices else None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Every packet that a servo begins to send up to this moment, each with its own, in order."""
        self.now = max(self.now, to)
        sent: list[tuple[float, Data]] = []
        while self._voices and self._voices[0].when <= to:
            voice = heappop(self._voices)
            if voice.servo.lives == voice.life:
                sent.append((voice.when, voice.data))
        return sent

    def receive(self, data: Data, at: float) -> None:
        """Bytes of the host, cut anywhere, several packets in one piece or half of one."""
        if isinstance(data, CanFrame):
            return
        self.now = max(self.now, at)
        began = at - len(data) * self._byte_time(None)
        if self.switches.frame_gap and began - self._heard_at > self.switches.frame_gap:
            self._splitter = Splitter("instruction")
        self._heard_at = at
        for packet in self._splitter.feed(data):
            if isinstance(packet, InstructionPacket):
                self._hear(packet, at)

    def _hear(self, packet: InstructionPacket, at: float) -> None:
        if packet.instruction == Instruction.SYNC_READ:
            self._sync_read(packet, at)
        elif packet.instruction == Instruction.SYNC_WRITE:
            self._sync_write(packet, at)
        elif packet.instruction in _OBEY:
            self._obey(packet, at)

    def _obey(self, packet: InstructionPacket, at: float) -> None:
        """Everyone addressed obeys at this very moment; then those speak who may."""
        broadcast = packet.id == BROADCAST
        speaking: list[tuple[Servo, Answer]] = []
        for servo in self._hearing(self.servos if broadcast else self._ids().get(packet.id, ()), at):
            id, rate = servo.id, servo.baud_rate
            answer = _OBEY[packet.instruction](servo, packet.parameters, at)
            if answer is None or not self._answers(servo, packet.instruction, broadcast):
                continue
            if rate != servo.baud_rate and self.switches.baud_ack == "new":
                continue
            new = servo.id if self.switches.id_ack == "new" else id
            speaking.append((servo, answer._replace(id=new)))
        if broadcast and self.switches.broadcast_ping == "in_turn":
            self._in_turn(speaking, at)
        else:
            self._at_once(speaking, at)

    def _answers(self, servo: Servo, instruction: int, broadcast: bool) -> bool:
        if broadcast:
            return instruction == Instruction.PING
        return instruction in _ANSWERED_AT_LEVEL_0 or servo.memory["status_return_level"] != 0

    def _sync_write(self, packet: InstructionPacket, at: float) -> None:
        order = decode_sync_write(packet.parameters)
        if order is None or packet.id != BROADCAST or not order.length:
            return
        for id, data in order.items:
            for servo in self._hearing(self._ids().get(id, ()), at):
                servo.write(order.address, data, at)

    def _sync_read(self, packet: InstructionPacket, at: float) -> None:
        """One packet per listed servo, back to back, in the order of the list (FTServo_Linux, FTServo_Python)."""
        order = decode_sync_read(packet.parameters)
        if order is None or packet.id != BROADCAST or order.length > _MOST:
            return
        moment = at
        for id in order.ids:
            servos = list(self._hearing(self._ids().get(id, ()), at))
            if servos:
                answers = [(servo, Answer(servo.read(order.address, order.length, at))) for servo in servos]
                moment = self._at_once(answers, moment)
            elif self.switches.sync_read_missing == "silent":
                return
            elif self.switches.sync_read_missing == "wait":
                moment += self._byte_time(None) * (order.length + OVERHEAD)

    def _in_turn(self, speaking: list[tuple[Servo, Answer]], at: float) -> None:
        for one in sorted(speaking, key=lambda pair: pair[0].id):
            at = self._at_once([one], at)

    def _at_once(self, speaking: Iterable[tuple[Servo, Answer]], at: float) -> float:
        """Each begins when its return delay is over; those who overlap garble each other. Gives the last end."""
        end = at
        chords: list[tuple[float, bytes, Servo]] = []
        for start, data, servo in sorted(self._spoken(speaking, at), key=lambda voice: voice[0]):
            byte_time = self._byte_time(servo)
            if chords and start < end:
                first, before, other = chords[-1]
                chords[-1] = first, _wired_and(before, data, round((start - first) / byte_time)), other
            else:
                chords.append((start, data, servo))
            end = max(end, start + byte_time * len(data))
        for start, data, servo in chords:
            heappush(self._voices, Voice(start, next(self._order), data, servo, servo.lives))
        return end

    def _spoken(
        self, speaking: Iterable[tuple[Servo, Answer]], at: float
    ) -> Iterable[tuple[float, bytes, Servo]]:
        for servo, answer in speaking:
            id = servo.id if answer.id is None else answer.id
            yield at + servo.return_delay + answer.later, frame(id, servo.error, answer.parameters), servo

    def _byte_time(self, servo: Servo | None) -> float:
        """Seconds of a byte on the wire: ten bits."""
        return 10 / (self.rate or (servo and servo.baud_rate) or _USUAL_RATE)

    def _hearing(self, servos: Iterable[Servo], at: float) -> Iterable[Servo]:
        return [servo for servo in servos if servo.hears(self.rate, at)]

    def _ids(self) -> dict[int, list[Servo]]:
        if self._by_id is None:
            self._by_id = {}
            for servo in self.servos:
                self._by_id.setdefault(servo.id, []).append(servo)
        return self._by_id

    def _forget_ids(self) -> None:
        self._by_id = None


def _checked(id: int) -> int:
    if not 0 <= id <= MAX_ID:
        raise RequestError(f"id {id} is not possible", expected=f"0 to {MAX_ID}")
    return id


def _wired_and(one: bytes, other: bytes, shift: int) -> bytes:
    """What a line shows when two talk, the second so many bytes later: any low bit wins."""
    length = max(len(one), shift + len(other))
    first = one.ljust(length, b"\xff")
    second = (b"\xff" * shift + other).ljust(length, b"\xff")
    return bytes(a & b for a, b in zip(first, second, strict=True))


# What each instruction does to one servo. None: silence.


def _ping(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    return None if parameters else Answer()


def _read(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) != 2 or parameters[1] > _MOST:
        return None
    return Answer(servo.read(parameters[0], parameters[1], at))


def _write(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) < 2:
        return _empty(servo, parameters)
    return Answer(later=servo.write(parameters[0], parameters[1:], at))


def _reg_write(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if len(parameters) < 2:
        return _empty(servo, parameters)
    servo.reg_write(parameters[0], parameters[1:])
    return Answer()


def _empty(servo: Servo, parameters: bytes) -> Answer | None:
    return Answer() if parameters and servo.switches.empty_write == "ack" else None


def _action(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    return None if parameters else Answer(later=servo.action(at))


def _restore_factory(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if parameters or not servo.switches.factory_restore:
        return None
    servo.restore_factory(at)
    return Answer()


def _enter_bootloader(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    if parameters:
        return None
    servo.enter_bootloader(at)
    return Answer() if servo.switches.bootloader == "ack" else None


def _calibrate(servo: Servo, parameters: bytes, at: float) -> Answer | None:
    """Two bytes of position in the servo's byte order, or nothing: the middle (FTServo_Python, reOfsCal)."""
    if len(parameters) not in (0, 2) or servo.switches.calibrate == "ignore":
        return None
    order = servo.model.table["goal_position"].order
    counts = int.from_bytes(parameters, "little" if order == "little" else "big") if parameters else None
    servo.calibrate(servo.model.turn // 2 if counts is None else counts, at)
    return Answer()


# 0x09 is in the dispatcher of firmware 3.10 and nobody knows what it does; 0x0A is ignored by STS3215 firmware
# 3.10 (servolab). Both are left out here, which is silence.
_OBEY: Mapping[int, Callable[[Servo, bytes, float], Answer | None]] = {
    Instruction.PING: _ping,
    Instruction.READ: _read,
    Instruction.WRITE: _write,
    Instruction.REG_WRITE: _reg_write,
    Instruction.ACTION: _action,
    Instruction.RESET: _restore_factory,
    Instruction.BOOTLOADER: _enter_bootloader,
    Instruction.CALIBRATE: _calibrate,
}
