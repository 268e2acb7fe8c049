"""Several simulated servos on one CAN bus: who hears which frame, who speaks first, and what breaks.

A bus at one rate is a polite place: arbitration lets the lower identifier go first and nothing is lost. Two things
break it, and both are told to the host as an adapter tells them, by frames with `ERROR_FLAG`: a sender at another
rate than a listener, and two senders with one identifier and unequal data. What a controller does then is ISO 11898,
simplified: each broken frame counts as one error, and after 16 a servo turns error passive and disturbs no more.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from heapq import heappop, heappush
from itertools import count
from typing import Final, NamedTuple

from motorbus.core.can_bits import precedence
from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, Audience, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import Profile
from motorbus.families.kst.simulator import sight as seen
from motorbus.families.kst.simulator.servo import Servo
from motorbus.families.kst.simulator.switches import Switches

ERROR: Final = CanFrame(ERROR_FLAG | 0x88, bytes(8))
"""What an adapter tells of a broken frame: protocol violation and bus error, the classes of SocketCAN."""
PASSIVE: Final = 16
"""Errors (of 8 points each) after which a transmitter is error passive at 128 points: ISO 11898."""
TWIN: Final = 1000
"""Added to its unit number, the key of a servo whose id another one has already."""
_BEFORE_ALL_CLOCKS: Final = -1.0
_ATTEMPT_BITS: Final = 100
"""Bits from the beginning of a frame that breaks to the next attempt; about, for it depends on the bit that differs."""


class Voice(NamedTuple):
    """A frame that a servo begins to send at `when`, unless it has lost its supply since; of nobody: an error."""

    when: float
    order: int
    frame: CanFrame
    servo: Servo | None
    life: int


class Roster(NamedTuple):
    """Who hears the host, in order and by id, who is there but set to another rate, and whether none hears it.

    It is made anew when anybody changes, not for each frame: on a full bus of 127 that is all there would be time for.
    """

    hearing: list[Servo]
    by_node: dict[int, list[Servo]]
    mistuned: list[Servo]
    alone: bool


class KstBus:
    """A `motorbus.core.family.Simulator` of KST CAN servos.

    `servos` are all of them, in the order in which they were made; `now` is the latest moment it was told.
    """

    def __init__(
        self, ids: Iterable[int], profile: Profile, switches: Switches, twins: Iterable[int] = ()
    ) -> None:
        self.switches = switches
        self.now = 0.0
        self.rate: int | None = None
        self._voices: list[Voice] = []
        self._order = count()
        ids, twins = tuple(ids), tuple(twins)
        self.servos = tuple(
            Servo(unit, _checked(node), profile, switches, lambda: self.now, self._say)
            for unit, node in enumerate((*ids, *twins), start=1)
        )
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", advice="give ids, such as 0x25")
        for servo in self.servos[len(ids) :]:
            servo.delay = switches.duplicate_delay
        self._awake = not switches.reports_ms
        self._asked = False
        self._known: Roster | None = None
        self._report_at: float | None = None
        for servo in self.servos:
            servo.changed = self._forget

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by the id they have now; a second one with an id has the key 1000 + its unit number."""
        found: dict[int, Servo] = {}
        for servo in self.servos:
            found[TWIN + servo.unit if servo.node in found else servo.node] = servo
        return found

    def duplicate(self, node: int) -> None:
        """A second servo with this id is there from now on, like the first and as it ships but for id and rate.

        Raises RequestError when there is none.
        """
        if node not in self.nodes:
            raise RequestError(f"no servo has the id {node}")
        first = self.nodes[node]
        twin = Servo(len(self.servos) + 1, node, first.profile, self.switches, lambda: self.now, self._say)
        twin.delay = self.switches.duplicate_delay
        twin.bit_rate = first.bit_rate
        self.servos = (*self.servos, twin)
        twin.changed = self._forget
        self._forget()

    def tune(self, rate: int) -> None:
        """The host's rate in bit/s; servos set to another one neither hear nor are heard. 0: whichever they have."""
        self.rate = rate or None
        self._forget()

    def receive(self, data: Data, at: float) -> None:
        """A frame of the host; what is no CAN frame is ignored."""
        self._wake(at)
        self.now = max(self.now, at)
        if not isinstance(data, CanFrame) or data.id & ERROR_FLAG:
            return
        self._disturb(self.now)
        if data.id & REMOTE_FLAG:
            return
        if (order := notifications.decode_start(data)) is not None:
            for servo in self._addressed(order.node, data.extended):
                servo.obey_start(order, self.now)
        elif (request := sdo.decode_request(data)) is not None:
            for servo in self._addressed(request.node, data.extended):
                servo.obey(request, self.now)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Every frame that begins up to this moment, with its own, in order."""
        self._wake(to)
        sent: list[tuple[float, Data]] = []
        while (moment := self.due()) is not None and moment <= to:
            self.now = max(self.now, moment)
            sent += [(moment, frame) for frame in self._spoken(moment)]
        self.now = max(self.now, to)
        return sent

    def due(self) -> float | None:
        """When the next frame begins, or None."""
        if not self._awake:
            return None if self._asked else _BEFORE_ALL_CLOCKS
        due = self._voices[0].when if self._voices else None
        if self._known is None:
            self._roster()
        report = self._report_at
        return due if report is None or (due is not None and due <= report) else report

    def audience(self, data: Data) -> Audience:
        """Whom a frame is for. What no host sends, as replies of other devices, is for none of these."""
        node = notifications.addressee(data) if isinstance(data, CanFrame) else None
        if node is None or not isinstance(data, CanFrame):
            return Audience.NONE
        heeding = [servo for servo in self.servos if servo.takes(data.extended)]
        if not any(node in (sdo.BROADCAST, servo.node) for servo in heeding):
            return Audience.NONE
        return Audience.EVERYONE if node == sdo.BROADCAST else Audience.OURS

    obeys_at_once = False

    def sight(self, at: float) -> Iterable[tuple[int, tuple[Hashable, ...]]]:
        """What each servo holds at this moment."""
        return seen.sight(self.servos, at)

    def shown(self, picture: tuple[Hashable, ...], name: str) -> int:
        """What a picture of a servo has in this row."""
        return seen.shown(picture, name)

    def _wake(self, at: float) -> None:
        """What reports from power-up on does so from the first moment it is told, for a clock may begin anywhere.

        Until then `due` asks for that once, by a moment before all clocks: whoever then says the present moment gets
        every report from there on, and whoever only repeats it is not made to walk through the age of his machine.
        """
        if self._awake:
            return
        self._asked = True
        if at >= 0:
            self._awake = True
            for servo in self.servos:
                servo.wake(at)

    def _forget(self) -> None:
        self._known = None

    def _roster(self) -> Roster:
        if self._known is None:
            there = [servo for servo in self.servos if servo.plugged]
            hearing = [servo for servo in there if servo.hears(self.rate)]
            mistuned = [servo for servo in there if not servo.hears(self.rate)]
            by_node: dict[int, list[Servo]] = {}
            for servo in hearing:
                by_node.setdefault(servo.node, []).append(servo)
            self._known = Roster(hearing, by_node, mistuned, len(mistuned) == len(there))
            self._find_report()
        return self._known

    def _find_report(self) -> None:
        moments = [servo.report_due() for servo in self.servos]
        self._report_at = min((moment for moment in moments if moment is not None), default=None)

    def _addressed(self, node: int, extended: bool) -> list[Servo]:
        """Whoever hears and heeds a frame to this id."""
        roster = self._roster()
        named = roster.hearing if node == sdo.BROADCAST else roster.by_node.get(node, [])
        return [servo for servo in named if servo.takes(extended)]

    def _say(self, servo: Servo | None, when: float, frame: CanFrame) -> None:
        heappush(self._voices, Voice(when, next(self._order), frame, servo, servo.lives if servo else 0))

    # -- who speaks at one moment -----------------------------------------------------------------------------------

    def _spoken(self, moment: float) -> Iterable[CanFrame]:
        """What the host gets of all that begins at this moment, in the order of arbitration."""
        broken: list[CanFrame] = []
        speaking: list[tuple[Servo, CanFrame]] = []
        for servo, frame in self._begun(moment):
            if servo is None:
                broken.append(frame)
            elif not servo.hears(self.rate):
                broken.append(ERROR)  # to a host at another rate any frame is a broken one
            else:
                speaking.append((servo, frame))
        return [*broken, *self._arbitrated(speaking, moment)]

    def _begun(self, moment: float) -> list[tuple[Servo | None, CanFrame]]:
        begun: list[tuple[Servo | None, CanFrame]] = []
        while self._voices and self._voices[0].when <= moment:
            voice = heappop(self._voices)
            if voice.servo is None or voice.servo.lives == voice.life:
                begun.append((voice.servo, voice.frame))
        if self._report_at == moment:
            for servo in self.servos:
                if servo.report_due() == moment:
                    begun += [(servo, frame) for frame in servo.report(moment)]
            self._find_report()
        return begun

    def _arbitrated(self, speaking: list[tuple[Servo, CanFrame]], moment: float) -> list[CanFrame]:
        """Lower identifiers first. With one identifier equal frames become one and unequal ones break."""
        heard: list[CanFrame] = []
        if len(speaking) < 2:
            return [frame for _, frame in speaking]
        rounds: dict[tuple[tuple[int, ...], int], list[tuple[Servo, CanFrame]]] = {}
        seen: dict[tuple[int, int, bool], int] = {}
        for servo, frame in speaking:
            place = (servo.unit, frame.id, frame.extended)
            seen[place] = seen.get(place, -1) + 1  # one servo sends its own frames one after the other
            rounds.setdefault((precedence(frame), seen[place]), []).append((servo, frame))
        for key in sorted(rounds):
            frames = sorted({frame for _, frame in rounds[key]})
            if len(frames) == 1:
                heard += frames
            else:
                self._collide([servo for servo, _ in rounds[key]], frames, moment)
        return heard

    def _collide(self, servos: list[Servo], frames: list[CanFrame], moment: float) -> None:
        """All see a bit that they did not send, break off and try again, until they are error passive."""
        attempt = _ATTEMPT_BITS / servos[0].bit_rate
        for servo in servos:
            servo.errors += PASSIVE
        for number in range(1, PASSIVE + 1):
            self._say(None, moment + number * attempt, ERROR)
        if self.switches.collision == "passive":  # the flags of an error passive one break nobody's frame
            for number, frame in enumerate(frames, start=PASSIVE + 1):
                self._say(None, moment + number * attempt, frame)

    def _disturb(self, at: float) -> None:
        """The host speaks: to a servo at another rate that is a broken frame, which it breaks for all to see."""
        if self.rate is None:
            return
        _, _, mistuned, alone = self._roster()  # alone: then nobody acknowledges the frame either
        active = [servo for servo in mistuned if servo.errors < PASSIVE]
        for servo in mistuned:
            servo.errors += 1
        if active or (mistuned and alone):
            self._say(None, at, ERROR)


def _checked(node: int) -> int:
    if node not in sdo.NODES:
        raise RequestError(f"node id {node} is not possible", expected="1 to 127")
    return node
