"""A host that has frames and a clock, and nothing of the driver."""

from __future__ import annotations

from typing import Any

from motorbus.families.stepper.parameters import Project, Step, decode_image, with_steps
from motorbus.families.stepper.protocol import DUMP_LENGTH, RATE, REPLY_LENGTH, encode
from motorbus.families.stepper.simulator import Controller, simulate

NOTICE = b"\xee\xdd"
GEOMETRY = Project(number=1, microsteps=8, step_angle=180, turn_distance=1600)
TURN = Step(distance=1600, speed=60, start_frequency=400, acceleration=100)


def made(*steps: Step, **values: Any) -> Project:
    """A project with these steps, by default a turn of 1.2 s."""
    base = {name: getattr(GEOMETRY, name) for name in ("microsteps", "step_angle", "turn_distance")}
    return with_steps(Project(**{"number": 1, **base, **values}), steps or (TURN,))


class Host:
    """Sends requests to a simulated line at `now` (s), and keeps what comes back with its time."""

    def __init__(self, project: Project | None = None, *, at: float = 0.0, **options: Any) -> None:
        self.line = simulate((1,), **options)
        self.line.tune(RATE)
        self.now = at
        self.came: list[tuple[float, bytes]] = []
        self.line.advance(at)
        if project is not None:
            self.controller.put(project.number, project)

    @property
    def controller(self) -> Controller:
        return self.line.nodes[1]

    def wait(self, seconds: float) -> list[bytes]:
        """Let time pass; return what came."""
        self.now += seconds
        came = [(at, data) for at, data in self.line.advance(self.now) if isinstance(data, bytes)]
        self.came += came
        return [data for _, data in came]

    def send(self, data: bytes, seconds: float = 0.005) -> list[bytes]:
        self.line.receive(data, self.now)
        return self.wait(seconds)

    def ask(self, name: str, seconds: float = 0.005, **values: int) -> list[bytes]:
        """A command; what came within so many seconds."""
        return self.send(encode(name, **values), seconds)

    def read(self, number: int = 1) -> Project:
        """A project, as a dump shows it."""
        (dump,) = self.ask("read_project", project=number)
        assert len(dump) == DUMP_LENGTH
        return decode_image(dump[REPLY_LENGTH:])

    @property
    def phase(self) -> str:
        return str(self.controller.status()["phase"])
