"""A simulated controller with a real bus on it: driver and simulator, each judged by the bytes of the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from motorbus.bus.blocking import Bus
from motorbus.bus.interlock import DeviceLimits
from motorbus.core.request import Data
from motorbus.core.steps import Runnable
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.parameters import Project, Step, with_steps
from motorbus.families.stepper.simulator import Controller as SimulatedController
from motorbus.journal import BusJournal
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink

T = TypeVar("T")

GEOMETRY = Project(number=1, microsteps=8, step_angle=180, turn_distance=1600)
TURN = Step(distance=1600, speed=60, start_frequency=400, acceleration=100)
"""A turn in a little more than a second."""
READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"
READ_INPUT_1 = "FF AA 00 0B 01 00 00 00 00 00 B5"
STOP_PROJECT = "FF AA 5E 00 00 00 00 00 00 00 07"
STOP_MOTOR = "FF AA 03 0D 00 00 00 00 00 00 B9"


def made(*steps: Step, number: int = 1, **values: Any) -> Project:
    """A project with these steps, by default a turn."""
    return with_steps(Project(**{**_values(GEOMETRY), "number": number, **values}), steps or (TURN,))


def _values(project: Project) -> dict[str, Any]:
    names = ("microsteps", "step_angle", "turn_distance")
    return {name: getattr(project, name) for name in names}


class Line(PerfectLine):
    """A line that hands what the controller sends to `change`; an empty result is nothing.

    `request` is the last one, `replies` is all that the controller sent, with its times (s).
    """

    def __init__(self) -> None:
        self.change: Callable[[bytes], bytes] = lambda data: data
        self.request = b""
        self.replies: list[tuple[float, bytes]] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.HOST:
            self.request = data
            return super().carry(sender, data, at)
        self.replies.append((at, data))
        changed = self.change(data)
        return super().carry(sender, changed, at) if changed else []


class Bench:
    """A simulated bus, the real bus on it with a journal, what was reported, and what was sent."""

    def __init__(self, *, pace: bool = False, **options: Any) -> None:
        self.simulator = FAMILY.simulator((1,), **options)
        self.line = Line()
        self.link = MemoryLink(self.simulator, rate=9600, line=self.line, pace=pace)
        self.events: list[object] = []
        self.journal = BusJournal("stepper:/dev/ttyUSB7")
        self.react: Callable[[object], None] = lambda event: None
        settings = ("motor", "dump_order", "ramp_tick_ms")
        driver = FAMILY.open(**{name: options[name] for name in settings if name in options})
        self.bus = Bus(self.link, driver, interlock=DeviceLimits(), report=self._report, journal=self.journal)
        self.device = Controller(self.bus)
        self._trace = self.bus.trace.subscribe(limit=1_000_000)

    def _report(self, event: object) -> None:
        self.events.append(event)
        self.react(event)

    @property
    def simulated(self) -> SimulatedController:
        device = self.simulator.nodes[1]
        assert isinstance(device, SimulatedController)
        return device

    def run(self, operation: Runnable[T]) -> T:
        return self.bus.run(operation)

    def press(self, request: str) -> None:
        """Let the controller have a request of another host, and swallow what it replies."""
        self.simulator.receive(bytes.fromhex(request), self.link.now())
        self.simulator.advance(self.link.now() + 0.05)
        self.link.advance(0.06)

    def sent(self) -> list[str]:
        """Every request since the last call, in hexadecimal."""
        return [
            record.data.hex(" ").upper()
            for record in self._trace
            if record.direction == "tx" and isinstance(record.data, bytes)
        ]

    def told(self, kind: type[T]) -> list[T]:
        """The events of this type."""
        return [event for event in self.events if isinstance(event, kind)]


@contextmanager
def bench(project: Project | None = None, **options: Any) -> Iterator[Bench]:
    """A bench whose controller has this project, and has replied once."""
    one = Bench(**options)
    if project is not None:
        one.simulated.put(project.number, project)
    one.device.ping()
    one.sent()
    try:
        yield one
    finally:
        one.bus.close()
