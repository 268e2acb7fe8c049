"""KST servos behind an slcan adapter, all in virtual time: what harms the text between adapter and host can be tried.

Both ends are the product's own: the reader and the writer of the host's link, and the adapter that simulators serve.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from motorbus.core.family import SimulatedNode
from motorbus.core.operation import CanFrame, Data
from motorbus.families.kst.simulator import KstBus
from motorbus.link.memory import MemoryLink
from motorbus.link.slcan import DEFAULT_BAUD, LINE_BITS, SlcanCodec
from motorbus.link.usb_adapters import DEVICE_LATENCY
from motorbus.simulation.slcan import SlcanAdapter
from tests.support.catalogue.kst import KstRig
from tests.support.single_faults import Overheard

LINE = re.compile(rb"t[0-7][0-9A-Fa-f]{2}8[0-9A-Fa-f]{16}")
"""A frame of eight bytes as text, by the LAWICEL manual."""
VALUE = range(13, 17)
"""The places of the digits of a word in such a line: letter, three of the identifier, length, four bytes before it."""


class Adapted:
    """A simulator of text: an open slcan adapter, and the nodes at its other side."""

    def __init__(self, bus: KstBus) -> None:
        self.bus = bus
        self.adapter = SlcanAdapter()
        self.adapter.feed(b"S6\rO\r")
        self.adapter.take()
        self._answers: list[tuple[float, Data]] = []

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return self.bus.nodes

    def tune(self, rate: int) -> None:
        self.bus.tune(rate)

    def receive(self, data: Data, at: float) -> None:
        assert isinstance(data, bytes)
        for frame in self.adapter.feed(data, at):
            self.bus.receive(frame, at)
        if answer := self.adapter.take():
            self._answers.append((at, answer))

    def due(self) -> float | None:
        due = self.bus.due()
        return self._answers[0][0] if self._answers else due

    def advance(self, to: float) -> list[tuple[float, Data]]:
        said, self._answers = self._answers, []
        for when, frame in self.bus.advance(to):
            assert isinstance(frame, CanFrame)
            said.append((when, self.adapter.deliver(frame, when)))
        return said


class TextLink(MemoryLink):
    """Frames for the bus, text on the line; with a `baud` (bit/s) of the adapter's serial line, text needs its time."""

    def __init__(self, simulator: Adapted, *, baud: int | None = None, **options: Any) -> None:
        self.reader: Any = SlcanCodec()
        self.baud = baud
        super().__init__(simulator, pace=baud is not None, **options)
        self.paced = False  # of the frames nobody says when they were on the wire
        if baud is not None:
            self.latency = DEVICE_LATENCY + 2 * LINE_BITS / baud

    def _air_time(self, data: Data) -> float:
        return len(data) * self.bits_per_byte / (self.baud or self.rate)

    def write(self, data: Data) -> None:
        assert isinstance(data, CanFrame)
        super().write(SlcanCodec().encode(data))

    def read(self, until: float) -> list[Data]:
        while True:
            text = super().read(until)
            frames: list[Data] = [frame for one in text for frame in self.reader.feed(bytes(one))]  # type: ignore[arg-type]
            if frames or self.now() >= until:
                return frames


class SlcanRig(KstRig):
    """As `KstRig`, with an adapter between."""

    def linked(self, simulator: KstBus) -> MemoryLink:
        return TextLink(Adapted(simulator), rate=500_000)


class SlowSlcanRig(SlcanRig):
    """The same where the text takes its time, at the usual rate of such adapters."""

    def linked(self, simulator: KstBus) -> MemoryLink:
        return TextLink(Adapted(simulator), baud=DEFAULT_BAUD, rate=500_000)


def value_changed(heard: Overheard) -> bool:
    """Has a digit of a value, or of the reason of a refusal, become another one on the way to the host?"""
    lines, told = LINE.findall(heard.meant), LINE.findall(heard.told)
    return any(
        len(told) > place and int(told[place][VALUE.start :], 16) != int(line[VALUE.start :], 16)
        for place, line in enumerate(lines[:1])
    )


def another_frame(heard: Overheard) -> bool:
    """Did the adapter hear a whole frame that nobody has said? It has no way to know."""
    said = {bytes(line).rstrip(b"\r").upper() for line in heard.said if isinstance(line, bytes)}
    return any(line.upper() not in said for line in _lines(heard.heard))


def _lines(text: bytes) -> list[bytes]:
    return [line for line in re.split(rb"[\r]", text) if LINE.fullmatch(line.strip(b"\n"))]
