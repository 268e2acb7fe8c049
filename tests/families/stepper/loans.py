"""Hosts that die in the middle of a borrow: a controller that outlives them, and the journal that they leave.

What is under test runs on a bus of its own. It dies at the so-many-th request, before that has left or after it; a host
that is dead neither sends nor records anything. The next one is another bus on the same line, with the same journal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from motorbus.bus.blocking import Bus
from motorbus.core.request import Data
from motorbus.errors import LinkLost, MotorbusError
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.simulator import Controller as SimulatedController
from motorbus.families.stepper.simulator import simulate
from motorbus.families.stepper.table import Project, Step, with_steps
from motorbus.journal import BusJournal
from motorbus.link.base import Line
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate

T = TypeVar("T")

MINE = with_steps(
    Project(
        number=1, microsteps=8, step_angle=180, turn_distance=400, loop_first=1, loop_last=2, loop_count=3
    ),
    (
        Step(distance=7, direction=1, start_frequency=60, acceleration=40, speed=90, delay=300, output=2),
        Step(distance=50, start_frequency=50, acceleration=30, speed=120),
    ),
)
"""A project 1 of somebody's, in which every field that is borrowed has a value of its own."""


class Cut(NamedTuple):
    """The host dies at this request, counted from 0; when `sent` it has left, and its answer is not read."""

    request: int
    sent: bool = False


class Doomed(MemoryLink):
    """A link whose host dies as the cut says; `count` is how many requests there were.

    At each of the moments in `interrupts` (s) its user presses Ctrl-C.
    """

    def __init__(self, cut: Cut | None, simulator: Any, interrupts: list[float], **more: Any) -> None:
        super().__init__(simulator, rate=9600, **more)
        self.cut = cut
        self.interrupts = interrupts
        self.count = 0
        self.dead = False

    def write(self, data: Data) -> None:
        self.alive()
        if self.cut is not None and self.count == self.cut.request:
            if self.cut.sent:
                super().write(data)
                self._process_until(self.now())
            self.dead = True
        self.count += 1
        self.alive()
        super().write(data)

    def read(self, until: float) -> list[Data]:
        self.alive()
        if self.interrupts and self.now() >= self.interrupts[0]:
            self.interrupts.pop(0)
            raise KeyboardInterrupt
        return super().read(min([until, *self.interrupts[:1]]))

    def alive(self) -> None:
        """Raise LinkLost when it is not."""
        if self.dead:
            raise LinkLost("this host is dead")


class Line1:
    """A line with its controller, whose project 1 is `MINE`, and the journal of its port."""

    def __init__(self, project: Project | None = MINE, **options: Any) -> None:
        self.simulator = simulate((1,), **options)
        self.journal = BusJournal("stepper:/dev/ttyUSB7")
        self.events: list[object] = []
        self.now = 0.0
        self.line: Line | None = None
        self.settings: dict[str, Any] = {}
        self.pace = False
        self.interrupts: list[float] = []
        self.sent: list[str] = []
        self.count = 0
        self.react: Callable[[object, Bus], None] = lambda event, bus: None
        if project is not None:
            self.simulated.put(1, project)
        self.simulator.advance(0.0)  # the supply comes now
        self.before = self.simulated.store.image(1)

    @property
    def simulated(self) -> SimulatedController:
        return self.simulator.nodes[1]

    def run(self, work: Callable[[Controller], T], cut: Cut | None = None) -> T | MotorbusError:
        """A host does this until it dies; its value, or the error that it ended with."""
        link = Doomed(cut, self.simulator, self.interrupts, start=self.now, line=self.line, pace=self.pace)

        def record(event: object) -> None:
            link.alive()
            self.journal(event)

        def report(event: object) -> None:
            self.events.append(event)
            self.react(event, bus)

        bus = Bus(link, FAMILY.open(**self.settings), interlock=Gate(), report=report, journal=record)
        trace = bus.trace.subscribe(limit=100_000)
        try:
            return work(Controller(bus))
        except MotorbusError as error:
            return error
        finally:
            self.count = link.count
            self.sent = [
                one.data.hex(" ").upper()
                for one in trace
                if one.direction == "tx" and isinstance(one.data, bytes)
            ]
            self.now = link.now() + 0.1
            self.simulator.advance(self.now)

    def later(self, seconds: float = 20.0) -> None:
        """Let time pass without a host."""
        self.now += seconds
        self.simulator.advance(self.now)

    @property
    def at_rest(self) -> bool:
        return self.simulated.state.phase is Phase.IDLE

    @property
    def as_before(self) -> bool:
        """Whether project 1 reads as it did in the beginning."""
        return self.simulated.store.image(1) == self.before

    def recovery(self, device: Controller) -> str | None:
        """What the next host does with what the journal calls unfinished."""
        change = self.journal.unfinished()
        return None if change is None else device.recover(change.verb, change.facts)
