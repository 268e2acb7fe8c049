"""Packets out of what is being heard on a line, however it is cut.

What a family finds is numbered through, put in order and given its time here. Noise is held until it is known where
it ends, so that the same bytes give the same packets in whatever pieces they come.
"""

from __future__ import annotations

from bisect import bisect_right
from math import isfinite
from operator import attrgetter
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import FAULTS, PIECE, WAYS, Captures, Cutter, Packet, Run
from motorbus.core.family import Family
from motorbus.core.register import shown
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.recorder.heard import captures_of, spoken
from motorbus.recorder.packets import Heard, Mark

_OWN: Final = attrgetter("own")
_NUMBER: Final = {fault: number for number, fault in enumerate(FAULTS)}


class Decoder:
    """Takes a line of one family apart.

    `way` says which way the bytes went unless `feed` says it: "rx" from the devices, "tx" to them, "" both or unknown.
    The ways are kept apart, and places are counted over all that is fed. Raises RequestError for an unknown family or
    way.
    """

    def __init__(self, family: str | Family, way: str = "") -> None:
        self.family: Final = spoken(family)
        self._way: Final = checked(way)
        self._captures: Final[Captures] = captures_of(self.family)
        self._frames: Final = self.family.link.kind == "frames"
        self._lines: Final[dict[str, _Line]] = {}
        self._usual: Final[type] = CanFrame if self._frames else bytes
        self._taken = 0

    def feed(self, data: Data, at: float | None = None, way: str | None = None) -> Heard:
        """Take bytes, cut anywhere, or one CAN frame, and when (s) they came; give what is complete.

        Raises RequestError for an unknown way, for a time that is no finite number, and for bytes where frames are due
        or the other way round.
        """
        if at is not None and (at.__class__ is not float or at - at != 0.0):
            timed(at)
        if data.__class__ is not self._usual:
            fitting(self._frames, data)
            if not self._frames:
                data = bytes(data)  # type: ignore[arg-type]
        way = self._way if way is None else checked(way)
        line = self._lines.get(way)
        if line is None:
            line = self._lines[way] = _Line(self._captures.cutter(way), self._frames)
        place = self._taken
        self._taken += 1 if self._frames else len(data)
        return line.feed(data, place, at)

    def flush(self) -> list[Packet]:
        """Nothing more comes: what can be made of the rest, one way after the other."""
        return [packet for rest in self.rest() for packet in rest]

    def rest(self) -> list[Heard]:
        """As `flush`, with the columns of each way by itself."""
        return [line.flush() for line in self._lines.values()]


class _Line:
    """What went one way."""

    __slots__ = ("_at", "_cutter", "_fault", "_frames", "_marks", "_more", "_noise", "_taken", "_told")

    def __init__(self, cutter: Cutter, frames: bool) -> None:
        self._cutter = cutter
        self._frames = frames
        self._taken = 0
        self._told = 0
        self._more: int | None = None
        self._at: float | None = None
        self._marks: tuple[Mark, ...] = ()
        self._noise = b""
        self._fault = 0

    def feed(self, data: Data, place: int, at: float | None) -> Heard:
        own = self._taken
        self._taken = own + (1 if self._frames else len(data))
        more = place - own
        if more != self._more or at != self._at:
            self._more, self._at = more, at
            self._marks += (Mark(own, more, at),)
        return self._heard(self._cutter.feed(data))

    def flush(self) -> Heard:
        return self._heard(self._cutter.flush(), last=True)

    def _heard(self, runs: list[Run], last: bool = False) -> Heard:
        noise: dict[int, int] = {}
        if len(runs) == 1 and isinstance(runs[0], list) and not self._noise:
            data = sound = runs[0]  # the usual case of a good line
        else:
            data, sound = self._sorted(runs, noise)
        if last:
            self._silence(data, noise)
        first, marks = self._told, self._marks
        self._told = told = first + len(data if self._frames else b"".join(data))
        if len(marks) > 1:
            self._marks = marks[max(bisect_right(marks, told, key=_OWN) - 1, 0) :]
        return Heard(first, marks, data, noise, self._cutter.tell(sound), self._frames)

    def _sorted(self, runs: list[Run], noise: dict[int, int]) -> tuple[list[bytes], list[bytes]]:
        """All in order, and of it the packets; of noise the fault into `noise`, by its place."""
        data: list[bytes] = []
        sound: list[bytes] = []
        stray, fault, frames = self._noise, self._fault, self._frames
        for run in runs:
            if isinstance(run, list):
                if stray:
                    noise[len(data)] = fault
                    data.append(stray)
                    stray = b""
                data += run
                sound += run
                continue
            more, name, _ = run
            number = _NUMBER[name]
            if stray and number != fault:
                noise[len(data)] = fault
                data.append(stray)
                stray = b""
            fault = number
            stray += more
            while len(stray) >= PIECE or (frames and stray):
                noise[len(data)] = fault
                data.append(stray[:PIECE])
                stray = stray[PIECE:]
        self._noise, self._fault = stray, fault
        return data, sound

    def _silence(self, data: list[bytes], noise: dict[int, int]) -> None:
        """The noise has ended: tell it."""
        if self._noise:
            noise[len(data)] = self._fault
            data.append(self._noise)
            self._noise = b""


def checked(way: str) -> str:
    """This way, if it is one. Raises RequestError for another word."""
    if way not in WAYS:
        raise RequestError(
            f"there is no way {way!r}", expected='"rx" from the devices, "tx" to them, "" both'
        )
    return way


def timed(at: object) -> None:
    """Raise RequestError for what is no time (s)."""
    try:
        if not isinstance(at, bool) and isfinite(at):  # type: ignore[arg-type]  # it says so itself
            return
    except (TypeError, ValueError, OverflowError):
        pass
    raise RequestError(
        f"at: {shown(at)} is no time",
        expected="a finite number of seconds",
        advice="leave it out where none was noted",
    )


def fitting(frames: bool, data: object) -> None:
    """Raise RequestError for bytes from a bus of frames, and for a frame, or anything else, from a line of bytes."""
    if frames and not isinstance(data, CanFrame):
        raise RequestError(
            "these devices are on a CAN bus: there are no bytes, but frames", expected="a CanFrame"
        )
    if not frames and not isinstance(data, bytes | bytearray | memoryview):
        raise RequestError("these devices are on a serial line", expected="bytes")
