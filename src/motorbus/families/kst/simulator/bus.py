"""Simulated servos on one CAN bus: who receives which frame, who sends first, and what breaks.

At one bit rate arbitration lets the lower identifier go first and nothing is lost. Two things break frames, and an
adapter reports both by frames with `ERROR_FLAG`: a sender at another rate than a listener, and two senders with one
identifier and unequal data. Simplified from ISO 11898: each broken frame counts as one error, and after 16 a servo is
error passive.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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
PASSIVE: Final = 16
"""Errors (of 8 points each) after which a transmitter is error passive, at 128 points (ISO 11898)."""
TWIN: Final = 1000
"""The key of a servo whose id another one has is its unit number plus this."""
RETRY_BITS: Final = 100
"""Bits from the start of a broken frame to the next attempt; it depends on the bit that differs. # assumption"""


class _Sent(NamedTuple):
    """A frame that a servo starts to send at `when`, unless it loses its supply; without a servo an error."""

    when: float
    order: int
    frame: CanFrame
    servo: Servo | None
    life: int


class _Roster(NamedTuple):
    """Servos at the rate of the host, in order and by id, and connected servos at another rate.

    It is made again after a change, not for each frame: on a full bus of 127 servos that would take too long.
    """

    tuned: list[Servo]
    by_node: dict[int, list[Servo]]
    mistuned: list[Servo]


class KstBus:
    """A `core.family.Simulator` of KST CAN servos: `servos` by unit number; `now` is the latest time (s)."""

    def __init__(
        self, ids: Iterable[int], profile: Profile, quirks: Quirks, twins: Iterable[int] = ()
    ) -> None:
        self.quirks = quirks
        self.now = 0.0
        self.rate: int | None = None
        self.servos: tuple[Servo, ...] = ()
        self._servers: dict[int, SdoServer] = {}
        self._frames: list[_Sent] = []
        self._order = count()
        self._begun = not quirks.reports_ms
        self._asked = False
        self._known: _Roster | None = None
        self._report_at: float | None = None
        for node in ids:
            self._add(node, profile)
        for node in twins:
            self._add(node, profile).delay = quirks.duplicate_delay
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 0x25")

    def _add(self, node: int, profile: Profile) -> Servo:
        if node not in sdo.NODES:
            raise RequestError(f"node id {node} is not possible", expected="1 to 127")
        unit = len(self.servos) + 1
        servo = Servo(unit, node, profile, self.quirks, lambda: self.now, self._send)
        self.servos = (*self.servos, servo)
        self._servers[unit] = SdoServer(servo)
        servo.changed = self._forget_roster
        self._forget_roster()
        return servo

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by present id; a second one with an id has the key 1000 + its unit number."""
        found: dict[int, Servo] = {}
        for servo in self.servos:
            found[TWIN + servo.unit if servo.node in found else servo.node] = servo
        return found

    def duplicate(self, node: int) -> None:
        """Add a servo with this id and the rate of the first one. Raises RequestError when there is none."""
        if node not in self.nodes:
            raise RequestError(f"no servo has the id {node}")
        first = self.nodes[node]
        twin = self._add(node, first.profile)
        twin.delay, twin.bit_rate = self.quirks.duplicate_delay, first.bit_rate

    def tune(self, rate: int) -> None:
        """Set the rate (bit/s) of the host; 0: that of each servo."""
        self.rate = rate or None
        self._forget_roster()

    def receive(self, data: Data, at: float) -> None:
        """Take a frame of the host."""
        self._begin(at)
        self.now = max(self.now, at)
        if not isinstance(data, CanFrame) or data.id & ERROR_FLAG:
            return
        self._disturb(self.now)
        if data.id & REMOTE_FLAG:
            return
        if (start := notifications.decode_start(data)) is not None:
            for servo in self._addressed(start.node, data.extended):
                servo.receive_start(start, self.now)
        elif (request := sdo.decode_request(data)) is not None:
            for servo in self._addressed(request.node, data.extended):
                self._servers[servo.unit].receive(request, self.now)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """All frames that start up to this time, each with its time, in order."""
        self._begin(to)
        sent: list[tuple[float, Data]] = []
        while (moment := self.due()) is not None and moment <= to:
            self.now = max(self.now, moment)
            sent += [(moment, frame) for frame in self._frames_at(moment)]
        self.now = max(self.now, to)
        return sent

    def due(self) -> float | None:
        """Time (s) of the next frame, or None."""
        if not self._begun:
            return None if self._asked else -1.0
        due = self._frames[0].when if self._frames else None
        self._roster()
        report = self._report_at
        return due if report is None or (due is not None and due <= report) else report

    def audience(self, data: Data) -> Audience:
        """The receivers of a frame; none for a frame that no host sends."""
        node = notifications.addressee(data) if isinstance(data, CanFrame) else None
        if node is None or not isinstance(data, CanFrame):
            return Audience.NONE
        taking = [servo for servo in self.servos if servo.takes(data.extended)]
        if not any(node in (sdo.BROADCAST, servo.node) for servo in taking):
            return Audience.NONE
        return Audience.EVERYONE if node == sdo.BROADCAST else Audience.OURS

    def _begin(self, at: float) -> None:
        """Start the reports that run from power-up on, at the first time of a clock that may start anywhere.

        Until then `due` asks once for that time, by a time before all clocks.
        """
        if self._begun:
            return
        self._asked = True
        if at >= 0:
            self._begun = True
            for servo in self.servos:
                servo.begin(at)

    def _forget_roster(self) -> None:
        self._known = None

    def _roster(self) -> _Roster:
        if self._known is None:
            tuned = [servo for servo in self.servos if servo.receives_at(self.rate)]
            mistuned = [servo for servo in self.servos if servo.plugged and not servo.receives_at(self.rate)]
            by_node: dict[int, list[Servo]] = {}
            for servo in tuned:
                by_node.setdefault(servo.node, []).append(servo)
            self._known = _Roster(tuned, by_node, mistuned)
            self._find_report()
        return self._known

    def _find_report(self) -> None:
        moments = [servo.report_due() for servo in self.servos]
        self._report_at = min((moment for moment in moments if moment is not None), default=None)

    def _addressed(self, node: int, extended: bool) -> list[Servo]:
        roster = self._roster()
        named = roster.tuned if node == sdo.BROADCAST else roster.by_node.get(node, [])
        return [servo for servo in named if servo.takes(extended)]

    def _send(self, servo: Servo | None, when: float, frame: CanFrame) -> None:
        heappush(self._frames, _Sent(when, next(self._order), frame, servo, servo.lives if servo else 0))

    # -- frames that start at one time ---------------------------------------------------------------------------

    def _frames_at(self, moment: float) -> list[CanFrame]:
        """What the host receives of all that starts at this time, in the order of arbitration."""
        broken: list[CanFrame] = []
        sending: list[tuple[Servo, CanFrame]] = []
        for servo, frame in self._started(moment):
            if servo is None:
                broken.append(frame)
            elif not servo.receives_at(self.rate):
                broken.append(ERROR)
            else:
                sending.append((servo, frame))
        return [*broken, *self._arbitrate(sending, moment)]

    def _started(self, moment: float) -> list[tuple[Servo | None, CanFrame]]:
        started: list[tuple[Servo | None, CanFrame]] = []
        while self._frames and self._frames[0].when <= moment:
            one = heappop(self._frames)
            if one.servo is None or one.servo.lives == one.life:
                started.append((one.servo, one.frame))
        if self._report_at == moment:
            started += [
                (servo, servo.report(moment)) for servo in self.servos if servo.report_due() == moment
            ]
            self._find_report()
        return started

    def _arbitrate(self, sending: list[tuple[Servo, CanFrame]], moment: float) -> list[CanFrame]:
        """Lower identifiers first. With one identifier equal frames become one and unequal ones break each other."""
        if len(sending) < 2:
            return [frame for _, frame in sending]
        rounds: dict[tuple[tuple[int, ...], int], list[tuple[Servo, CanFrame]]] = {}
        numbers: dict[tuple[int, int, bool], int] = {}
        for servo, frame in sending:
            place = (servo.unit, frame.id, frame.extended)
            numbers[place] = numbers.get(place, -1) + 1  # one servo sends its own frames one after the other
            rounds.setdefault((precedence(frame), numbers[place]), []).append((servo, frame))
        received: list[CanFrame] = []
        for key in sorted(rounds):
            frames = {frame for _, frame in rounds[key]}
            if len(frames) == 1:
                received += frames
            else:
                self._collide([servo for servo, _ in rounds[key]], moment)
        return received

    def _collide(self, servos: list[Servo], moment: float) -> None:
        """All abort and try again until they are error passive; then the frames are given up. # assumption"""
        for servo in servos:
            servo.errors += PASSIVE
        for number in range(1, PASSIVE + 1):
            self._send(None, moment + number * RETRY_BITS / servos[0].bit_rate, ERROR)

    def _disturb(self, at: float) -> None:
        """A frame of the host is broken for a servo at another rate, which breaks it for all."""
        if self.rate is None:
            return
        tuned, _, mistuned = self._roster()
        active = [servo for servo in mistuned if servo.errors < PASSIVE]
        for servo in mistuned:
            servo.errors += 1
        if active or (mistuned and not tuned):  # without a listener no servo acknowledges the frame
            self._send(None, at, ERROR)
