"""Simulated servos on one CAN bus: who receives which frame, and who sends first.

Arbitration lets the lower identifier go first and nothing is lost, save where two servos with one identifier begin at
the same time: equal frames are one, and unequal ones break, which an adapter reports by a frame with `ERROR_FLAG`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, Audience, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import Profile
from motorbus.families.kst.simulator.quirks import Quirks
from motorbus.families.kst.simulator.servo import Servo

ERROR: Final = CanFrame(ERROR_FLAG | 0x88, bytes(8))
"""An adapter's report of a broken frame: protocol violation and bus error, the classes of SocketCAN."""
DUPLICATE_KEY: Final = 1000  # a servo whose id another one has has its unit number plus this as key
DUPLICATE_DELAY: Final = 0.0003  # s by which the second servo with an id replies later # assumption


class KstBus:
    """A `core.family.Simulator` of KST CAN servos: `servos` in order of their units; `now` is the latest time (s)."""

    def __init__(
        self, ids: Iterable[int], profile: Profile, quirks: Quirks, duplicates: Iterable[int] = ()
    ) -> None:
        self.quirks = quirks
        self.now = 0.0
        self.rate: int | None = None
        self.servos: tuple[Servo, ...] = ()
        for node in ids:
            self._add(node, profile)
        for node in duplicates:
            self.duplicate(node)
        if not self.servos:
            raise RequestError("a simulated bus needs at least one servo", expected="ids, such as 0x25")

    def _add(self, node: int, profile: Profile) -> Servo:
        if node not in sdo.NODES:
            raise RequestError(f"node id {node} is not possible", expected="1 to 127")
        servo = Servo(len(self.servos) + 1, node, profile, self.quirks, lambda: self.now)
        self.servos = (*self.servos, servo)
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
        second.delay, second.bit_rate = DUPLICATE_DELAY, first.bit_rate

    def tune(self, rate: int) -> None:
        """Set the rate (bit/s) of the host; 0: every servo receives, at any rate."""
        self.rate = rate or None

    def receive(self, data: Data, at: float) -> None:
        """Take a frame of the host."""
        self.now = max(self.now, at)
        if not isinstance(data, CanFrame):
            return
        start, request = notifications.decode_start(data), sdo.decode_request(data.data)
        for servo in self.servos:
            if self._addressee(data) not in (sdo.BROADCAST, servo.node) or not self._reaches(servo):
                continue
            if start is not None:
                servo.receive_start(start, self.now)
            elif len(data.data) == sdo.LENGTH:
                servo.receive(data, request, self.now)

    def _reaches(self, servo: Servo) -> bool:
        return servo.plugged and self.rate in (None, servo.bit_rate)

    def _addressee(self, frame: CanFrame) -> int | None:
        """The node that a frame of a host addresses, 0 for all; None for a frame that no servo takes."""
        if self.quirks.id_format not in ("asked", "ext" if frame.extended else "std"):
            return None
        start = notifications.decode_start(frame)
        node = frame.id - sdo.REQUEST if start is None else start.node
        return node if node in (sdo.BROADCAST, *sdo.NODES) else None

    def audience(self, data: Data) -> Audience:
        """The receivers of a frame at any rate; none for a frame that is no request."""
        if not isinstance(data, CanFrame):
            return Audience.NONE
        node = self._addressee(data._replace(id=data.id & ~REMOTE_FLAG))
        if node == sdo.BROADCAST:
            return Audience.EVERYONE
        return Audience.OURS if node in [servo.node for servo in self.servos] else Audience.NONE

    # -- frames of the servos ------------------------------------------------------------------------------------

    def due(self) -> float | None:
        """Time (s) of the next frame, or None."""
        moment = min(servo.due() for servo in self.servos)
        return moment if moment < inf else None

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """All frames that start up to this time, each with its time, in order."""
        sent: list[tuple[float, Data]] = []
        while (moment := self.due()) is not None and moment <= to:
            self.now = max(self.now, moment)
            sent += [(moment, frame) for frame in self._frames_at(moment)]
        self.now = max(self.now, to)
        return sent

    def _frames_at(self, moment: float) -> list[CanFrame]:
        """What the host receives of all that starts at this time, in the order of arbitration.

        With one identifier, the n-th frame of a servo competes with the n-th of the others.
        """
        competing: dict[tuple[tuple[int, bool, int], int], set[CanFrame]] = {}
        for servo in self.servos:
            for turn, frame in enumerate(servo.take(moment)):
                if self._reaches(servo):
                    competing.setdefault((_precedence(frame), turn), set()).add(frame)
        frames = [competing[key] for key in sorted(competing)]
        return [min(equal) if len(equal) == 1 else ERROR for equal in frames]


def _precedence(frame: CanFrame) -> tuple[int, bool, int]:
    """Sort key of arbitration: the first eleven bits, then an 11-bit identifier before one of 29 bits."""
    return frame.id >> 18 if frame.extended else frame.id, frame.extended, frame.id
