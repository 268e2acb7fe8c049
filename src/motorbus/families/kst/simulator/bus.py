"""Simulated servos on one CAN bus: who receives which frame, who sends first, and what breaks.

At one bit rate arbitration lets the lower identifier go first and nothing is lost. Two things break frames, and an
adapter reports both by frames with `ERROR_FLAG`: a sender at another rate than a listener, and two senders with one
identifier and unequal data. Simplified from ISO 11898: each broken frame counts as one error, and after 16 a servo is
error passive.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import count
from typing import Final, NamedTuple

from motorbus.core.can_bits import precedence
from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, Audience, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import Profile
from motorbus.families.kst.simulator.quirks import Quirks
from motorbus.families.kst.simulator.server import SdoServer
from motorbus.families.kst.simulator.servo import Servo

ERROR: Final = CanFrame(ERROR_FLAG | 0x88, bytes(8))
"""An adapter's report of a broken frame: protocol violation and bus error, the classes of SocketCAN."""
PASSIVE_AFTER: Final = 16
"""Errors (of 8 points each) after which a transmitter is error passive, at 128 points (ISO 11898)."""
DUPLICATE_KEY: Final = 1000  # a servo whose id another one has has its unit number plus this as key
RETRY_BITS: Final = 100
"""Bits from the start of a broken frame to the next attempt; it depends on the bit that differs. # assumption"""


class Event(NamedTuple):
    """A frame that starts at `when` (s).

    `frame`  None: a report, made when it is sent
    `servo`  None: an error frame of the adapter
    `epoch`  the counter of `epoch_of` when the event was made; if it has changed since, the event is void
    """

    when: float
    order: int
    servo: Servo | None
    frame: CanFrame | None
    epoch: int


def epoch_of(servo: Servo | None, frame: CanFrame | None) -> int:
    """The number of losses of supply of the servo; for a report, of starts and stops of its reports."""
    if servo is None:
        return 0
    return servo.report_changes if frame is None else servo.power_losses


class KstBus:
    """A `core.family.Simulator` of KST CAN servos: `servos` in order of their units; `now` is the latest time (s)."""

    def __init__(
        self, ids: Iterable[int], profile: Profile, quirks: Quirks, duplicates: Iterable[int] = ()
    ) -> None:
        self.quirks = quirks
        self.now = 0.0
        self.rate: int | None = None
        self.servos: tuple[Servo, ...] = ()
        self._servers: dict[int, SdoServer] = {}
        self._events: list[Event] = []
        self._order = count()
        self._begun = not quirks.reports_ms
        self._was_called = False
        for node in ids:
            self._add(node, profile)
        for node in duplicates:
            self.duplicate(node)
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", expected="ids, such as 0x25")

    def _add(self, node: int, profile: Profile) -> Servo:
        if node not in sdo.NODES:
            raise RequestError(f"node id {node} is not possible", expected="1 to 127")
        servo = Servo(len(self.servos) + 1, node, profile, self.quirks, lambda: self.now, self._send)
        self.servos = (*self.servos, servo)
        self._servers[servo.unit] = SdoServer(servo)
        return servo

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by present id; a second one with an id has the key 1000 + its unit number."""
        found: dict[int, Servo] = {}
        for servo in self.servos:
            found[DUPLICATE_KEY + servo.unit if servo.node in found else servo.node] = servo
        return found

    def duplicate(self, node: int) -> None:
        """Add a servo with this id and the rate of the first one. Raises RequestError when there is none."""
        if node not in self.nodes:
            raise RequestError(f"no servo has the id {node}", expected=f"one of {sorted(self.nodes)}")
        first = self.nodes[node]
        second = self._add(node, first.profile)
        second.delay, second.bit_rate = self.quirks.duplicate_delay, first.bit_rate

    def tune(self, rate: int) -> None:
        """Set the rate (bit/s) of the host; 0: every servo receives, at any rate."""
        self.rate = rate or None

    def receive(self, data: Data, at: float) -> None:
        """Take a frame of the host."""
        self._begin(at)
        self.now = max(self.now, at)
        if not isinstance(data, CanFrame) or data.id & ERROR_FLAG:
            return
        self._disturb()
        if data.id & REMOTE_FLAG:
            return
        if (start := notifications.decode_start(data)) is not None:
            for servo in self._addressed(start.node, data):
                servo.receive_start(start, self.now)
        elif (request := sdo.decode_request(data)) is not None:
            for servo in self._addressed(request.node, data):
                self._servers[servo.unit].receive(request, self.now)

    def _addressed(self, node: int, frame: CanFrame) -> list[Servo]:
        return [
            servo
            for servo in self.servos
            if node in (sdo.BROADCAST, servo.node)
            and self._has_host_rate(servo)
            and self._accepts_format(frame)
        ]

    def _has_host_rate(self, servo: Servo) -> bool:
        return servo.plugged and self.rate in (None, servo.bit_rate)

    def _accepts_format(self, frame: CanFrame) -> bool:
        return self.quirks.id_format in ("asked", "ext" if frame.extended else "std")

    def _disturb(self) -> None:
        """Servos at another rate destroy a frame of the host until they are error passive.

        The adapter repeats the frame until it arrives, so it is always delivered; it reports one error if a servo
        destroyed it, or if only servos at another rate are there and none acknowledges it.
        """
        others = [servo for servo in self.servos if servo.plugged and not self._has_host_rate(servo)]
        active = any(servo.errors < PASSIVE_AFTER for servo in others)
        for servo in others:
            servo.errors += 1
        if active or (others and not any(map(self._has_host_rate, self.servos))):
            self._send(None, self.now, ERROR)

    def audience(self, data: Data) -> Audience:
        """The receivers of a frame at any rate; none for a frame that is no request."""
        if not isinstance(data, CanFrame) or (node := notifications.addressee(data)) is None:
            return Audience.NONE
        taking = [servo.node for servo in self.servos if self._accepts_format(data)]
        if node == sdo.BROADCAST and taking:
            return Audience.EVERYONE
        return Audience.OURS if node in taking else Audience.NONE

    # -- frames of the servos ------------------------------------------------------------------------------------

    def _send(self, servo: Servo | None, when: float, frame: CanFrame | None) -> None:
        if servo is not None and frame is not None:
            frame = frame._replace(extended=servo.extended)
        heappush(self._events, Event(when, next(self._order), servo, frame, epoch_of(servo, frame)))

    def _begin(self, at: float) -> None:
        """Start the reports that run from power-up on (`reports_ms`).

        The first time that the caller passes is the power-up: its clock may start anywhere. To get that time, `due`
        returns -1 until the first call of `receive` or `advance`.
        """
        self._was_called = True
        if not self._begun and at >= 0:  # -1 comes from `due`
            self._begun = True
            for servo in self.servos:
                servo.set_reporting(True, at)

    def due(self) -> float | None:
        """Time (s) of the next frame, or None."""
        if not self._begun:
            return None if self._was_called else -1.0
        while self._events:
            event = self._events[0]
            if event.epoch == epoch_of(event.servo, event.frame):
                return event.when
            heappop(self._events)
        return None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """All frames that start up to this time, each with its time, in order."""
        self._begin(to)
        sent: list[tuple[float, Data]] = []
        while (moment := self.due()) is not None and moment <= to:
            self.now = max(self.now, moment)
            sent += [(moment, frame) for frame in self._frames_at(moment)]
        self.now = max(self.now, to)
        return sent

    def _frames_at(self, moment: float) -> list[CanFrame]:
        """What the host receives of all that starts at this time: errors, then frames in the order of arbitration.

        Lower identifiers go first. With one identifier equal frames become one and unequal ones break each other: the
        n-th frame of a servo with this identifier competes with the n-th of the others.
        """
        received: list[CanFrame] = []
        competing: dict[tuple[tuple[int, ...], int], list[tuple[Servo, CanFrame]]] = {}
        sent: Counter[tuple[int, tuple[int, ...]]] = Counter()
        while (when := self.due()) is not None and when <= moment:
            event = heappop(self._events)
            servo = event.servo
            if servo is None:
                received.append(ERROR)
                continue
            frame = event.frame or servo.report(moment)
            if not self._has_host_rate(servo):
                received.append(ERROR)
                continue
            rank = precedence(frame)
            sent[servo.unit, rank] += 1
            competing.setdefault((rank, sent[servo.unit, rank]), []).append((servo, frame))
        for key in sorted(competing):
            servos, frames = zip(*competing[key], strict=True)
            if len(set(frames)) == 1:
                received.append(frames[0])
            else:
                self._collide(servos, moment)
        return received

    def _collide(self, servos: Sequence[Servo], moment: float) -> None:
        """All abort and try again until they are error passive; then the frames are given up. # assumption"""
        for servo in servos:
            servo.errors += PASSIVE_AFTER
        for number in range(1, PASSIVE_AFTER + 1):
            self._send(None, moment + number * RETRY_BITS / servos[0].bit_rate, ERROR)
