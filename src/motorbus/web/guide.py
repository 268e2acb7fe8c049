"""Guided procedures of `motorbus.setup` in the page."""

from __future__ import annotations

from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Final

from msgspec import Struct

from motorbus.errors import Interrupted, RequestError
from motorbus.motion.robot import Robot
from motorbus.setup.engine import Live, Note, Step, run
from motorbus.setup.presets import Joint, Preset
from motorbus.setup.verify import verify

SHOW: Final = 0.1  # s between two live tables
LOOK: Final = 0.2  # s between two looks at a stop while the user thinks


class PageFace:
    """A `Face`: steps go to `put`, texts of the user come by `answers`. A stop ends the procedure."""

    def __init__(self, put: Callable[[Struct], None], is_stopped: Callable[[], bool]) -> None:
        self.answers: SimpleQueue[str] = SimpleQueue()
        self._put = put
        self._is_stopped = is_stopped
        self._shown = 0.0

    def show(self, step: Step) -> str | None:
        """Show a step; waits for the answer of a prompt. Raises Interrupted after a stop."""
        if not isinstance(step, Live):
            self._put(step)
        elif monotonic() - self._shown > SHOW:
            self._shown = monotonic()
            self._put(step)
        if isinstance(step, Note):
            return None
        while True:
            if self._is_stopped():
                raise Interrupted("the set-up was stopped", advice="begin it again")
            try:
                return self.answers.get(timeout=0.0 if isinstance(step, Live) else LOOK)
            except Empty:
                if isinstance(step, Live):
                    return None


def verify_axes(robot: Robot, bus: str, face: PageFace) -> dict[str, int]:
    """The sign of each axis of a FEETECH bus that was moved by hand. They go limp; only reads are sent then."""
    if bus not in robot.buses or robot.buses[bus].family.name != "feetech":
        raise RequestError(f"{bus}: its axes cannot be verified by hand", expected="a bus of FEETECH servos")
    axes = {name: axis.config for name, axis in robot.axes.items() if axis.config.bus == bus}
    robot.disable_torque(tuple(axes))
    direction = "move it by hand in the direction in which its position shall rise"
    joints = tuple(Joint(name, config.node, direction) for name, config in axes.items())
    signs = run(verify(robot.buses[bus], Preset(bus, joints)), face)
    for name, sign in signs.items():
        if sign != axes[name].sign:
            face.show(Note(f"{name} turns the other way: its machine file needs sign = {sign}", warning=True))
    return signs
