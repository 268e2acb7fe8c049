"""A real bus on simulated KST servos. Tests judge the driver by the frames it sends and by simulator memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeVar

from motorbus.core.request import Data
from motorbus.families.kst import FAMILY, PowerCycleNeeded, Servo, settings_of
from motorbus.families.kst.simulator import KstBus
from motorbus.families.kst.simulator import Servo as SimulatedServo
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.simulators.kst.host import frame
from tests.support.world import make_bus

T = TypeVar("T")


class Answers(PerfectLine):
    """Replies of the test to some requests: one text for each time, the last one again and again.

    "" is silence; a text may have several frames.
    """

    def __init__(self, answers: Mapping[str, str | Sequence[str]]) -> None:
        self._left = {key: [texts] if isinstance(texts, str) else [*texts] for key, texts in answers.items()}

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        left = self._left.get(str(data)) if sender is Side.HOST else None
        if left is None:
            return super().carry(sender, data, at)
        text = left.pop(0) if len(left) > 1 else left[0]
        return [Delivery(at + 0.0001, Side.HOST, frame(one)) for one in text.split()]


class Bench:
    """A bus on simulated servos, by default one with id 5. `on` is called with each event of the bus."""

    def __init__(
        self,
        *ids: int,
        settings: Mapping[str, object] | None = None,
        link: type[MemoryLink] = MemoryLink,
        position: int = 0,
        line: Line | None = None,
        profile: str = "kst",
        **options: object,
    ) -> None:
        simulator = FAMILY.simulator(ids or (5,), profile, **options)
        assert isinstance(simulator, KstBus)
        self.simulator = simulator
        for servo in simulator.servos:
            servo.raw_position = servo.values["goal_position"] = position
        self.link: Any = link(simulator, rate=500_000, line=line)
        self.events: list[object] = []
        self.on: Callable[[object], object] = lambda event: None
        driver = FAMILY.open(**{"profile": profile, **(settings or {})})
        self.bus = make_bus(self.link, driver, report=self._report)
        self.settings = settings_of(self.bus)
        self._trace = self.bus.trace.subscribe(limit=1_000_000)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.bus.close()

    def _report(self, event: object) -> None:
        self.events.append(event)
        self.on(event)

    def __getitem__(self, node: int) -> SimulatedServo:
        """The simulated servo with this id."""
        return self.simulator.nodes[node]

    def servo(self, node: int = 5) -> Servo:
        """A servo of the driver of which nothing is known yet."""
        return Servo(self.bus, node)

    def of(self, kind: type[T]) -> list[T]:
        """The events of this kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def sent(self) -> list[str]:
        """The frames sent since the last call, as text."""
        return [str(record.data) for record in self._trace if record.direction == "tx"]

    def written(self) -> list[str]:
        """The data of the writes sent since the last call."""
        data = (text.partition("#")[2] for text in self.sent())
        return [text for text in data if len(text) == 16 and not text.startswith("40")]

    def on_power_cycle(self, act: Callable[[], object] | None = None) -> None:
        """Call this whenever `provision` asks for a power cycle; by default the first servo is restarted."""
        act = act or self.simulator.servos[0].power_cycle
        self.on = lambda event: act() if isinstance(event, PowerCycleNeeded) else None


def abort(index: int, code: int, subindex: int = 0) -> str:
    """The frame with which node 5 refuses a request."""
    data = b"\x80" + index.to_bytes(2, "little") + bytes((subindex,)) + code.to_bytes(4, "little")
    return f"585#{data.hex()}"
