"""--dry-run: the same action with each write withheld and shown; the plan of a command of a robot."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from math import pi
from typing import TYPE_CHECKING, Annotated, Any, Final

from msgspec import Meta, Struct

from motorbus.bus.engine import is_poll
from motorbus.cli.output import confirm, note
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Effect, Request, Step
from motorbus.core.steps import Exclusive, Gather, SetBitrate, Shielded, Sleep, discard
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.common import Target, Writing
    from motorbus.core.family import Explanation
    from motorbus.motion.profile import Kind
    from motorbus.motion.robot import Robot

FAR: Final = pi  # rad; a longer move needs consent
FRAMING: Final = ("header", "length", "checksum", "identifier", "reserved")


class Unforeseeable(MotorbusError):
    """What would be sent next depends on a reply that only a real run gets."""


class _AsWritten:
    """The value of a read after a withheld write: equal to everything, of no other use."""

    def __eq__(self, other: object) -> bool:
        return True

    __hash__ = None  # type: ignore[assignment]

    def _use(self, *_: object) -> Any:
        raise Unforeseeable("what follows depends on replies that only a real run gets")

    __getattr__ = __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __and__ = __rshift__ = __getitem__ = (
        _use
    )
    __lt__ = __le__ = __gt__ = __ge__ = __int__ = __float__ = __index__ = __abs__ = __len__ = __iter__ = _use
    __contains__ = __bool__ = __rmul__ = __mod__ = __truediv__ = _use


class Overlay:
    """Stands in place of a bus: reads go through, writes are kept in `withheld`."""

    def __init__(self, bus: Bus) -> None:
        self.family, self.link, self.rate, self.trace = bus.family, bus.link, bus.rate, bus.trace
        self.driver = copy(bus.driver)
        self.withheld: list[bytes] = []
        self._bus = bus
        self._written: set[int] = set()  # nodes; -1: all
        self._waited = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def run(self, runnable: Any, report: Any = None) -> Any:
        """Run a procedure without its writes. Raises what the procedure or the interlock raises."""
        if isinstance(runnable, Step):
            return self._step(runnable)
        value, error = None, None
        while True:
            try:
                step = runnable.throw(error) if error is not None else runnable.send(value)
            except StopIteration as end:
                return end.value
            value, error = None, None
            try:
                value = self._step(step)
            except Unforeseeable:
                runnable.close()
                raise
            except MotorbusError as failure:
                error = failure
            finally:
                discard(step)

    def _step(self, step: Any) -> Any:
        if isinstance(step, Request):
            return self._request(step)
        if isinstance(step, Exclusive | Shielded):
            return self.run(step.runnable)
        if isinstance(step, Gather):
            return tuple([self.run(one) for one in step.runnables])
        if isinstance(step, SetBitrate):  # on CAN, a host at another rate disturbs the bus
            return self._bus.run(step if self.family.link.kind == "bytes" else SetBitrate(0))
        if isinstance(step, Sleep):
            self._waited += step.seconds
            return self._bus.now() + self._waited
        return None  # `Emit`: no journal entry, nothing changes

    def _request(self, request: Request[Any]) -> Any:
        nodes = set() if request.expected is ANY else {one.node for one in request.expected}
        if is_poll(request):
            if self._written and (nodes | {-1}) & self._written:
                return _AsWritten()
            return self._bus.run(request)
        if self._bus.interlock is not None:
            self._bus.interlock.check(request, self._bus.now())
        self._written |= nodes or {-1}
        if request.effect is Effect.IDENTITY:
            self._written.add(-1)
        self.withheld.append(request.wire.flat() if isinstance(request.wire, CanFrame) else request.wire)
        return None


def carry_out(
    writing: Writing, target: Target | Bus, action: Callable[[Any], Any], question: str = ""
) -> Any:
    """Run `action(device or bus)`, after the question if there is one; gives its result.

    --dry-run prints the frames and gives None. Before a question, the action runs without its writes, so that what
    would be refused is refused first; an action that writes nothing needs no question.
    """
    real = getattr(target, "device", target)
    if writing.dry_run or (question and not writing.yes):
        bus: Any = getattr(target, "bus", target)
        overlay: Any = Overlay(bus)
        stand_in = overlay
        if real is not target:
            stand_in = overlay.family.devices.blocking(overlay, target.node)  # type: ignore[union-attr]
        try:
            action(stand_in)
        except Unforeseeable as error:
            if writing.dry_run:
                note(f"note: {error.summary}")
        finally:
            if bus.rate != overlay.rate:
                bus.run(SetBitrate(overlay.rate))
        if writing.dry_run:
            print_frames(overlay)
            return None
        if overlay.withheld:
            confirm(question, writing)
    return action(real)


def print_frames(overlay: Overlay) -> None:
    """Print each withheld frame and its meaning."""
    if not overlay.withheld:
        print("nothing would be written")
    for frame in overlay.withheld:
        for one in overlay.driver.decode(frame):
            print(f"would send {one.data.hex(' ').upper()}\n    {_meaning(one)}")


def _meaning(one: Explanation) -> str:
    """What a frame of the host says, without its framing and without what it could be from a device."""
    names = [part.name for part in one.parts]
    start = names.index("instruction") + 1 if "instruction" in names else 0
    parts = [
        f"{part.name} {part.meaning}"
        for part in one.parts[start:]
        if part.name not in FRAMING and not part.name.startswith("as an")
    ]
    return "; ".join([one.title.partition(" (or ")[0], *parts])


# -- robot ---------------------------------------------------------------------------------------------------------


class AxisPlan(Struct, frozen=True):
    """Start and goal of one axis."""

    start: str
    goal: str


class Plan(Struct, frozen=True, tag="plan"):
    """What a move would do; nothing was sent."""

    axes: dict[str, AxisPlan]
    duration: Annotated[float | None, Meta(extra={"unit": "s"})] = None
    limited_by: str = ""


def execute(writing: Writing, robot: Robot, command: Any) -> Any:
    """Carry out a command of a robot, after consent to a far move; --dry-run gives the plan."""
    goals = _goals(robot, command)
    if not writing.dry_run and (writing.yes or not goals):
        return robot.execute(command)
    places = robot.positions(list(goals)) if goals else {}
    if writing.dry_run:
        return _plan(robot, command, goals, places)
    far = []
    for name, goal in goals.items():
        config, place = robot.axes[name].config, places[name]
        if place is not None and abs((goal - place) * config.ratio) > FAR:
            far.append(f"{name} by {config.show(goal - place)}")
    if far:
        _plan(robot, command, goals, places)
        confirm(f"move {', '.join(far)}", writing)
    return robot.execute(command)


def _goals(robot: Robot, command: Any) -> dict[str, float]:
    goals = dict(getattr(command, "goals", {}))
    if type(command).__name__ == "Pose":
        goals = dict(robot.config.poses.get(command.name, {}))
    return goals


def _plan(robot: Robot, command: Any, goals: dict[str, float], places: dict[str, float | None]) -> Plan:
    from motorbus.motion.moves import check_reach
    from motorbus.motion.profile import Limits, Move, synchronize

    moves, shown = {}, {}
    for name, goal in goals.items():
        axis, place = robot.axes[name], places[name]
        if getattr(command, "relative", False):
            goal += place or 0.0
        check_reach(axis, goal)
        shown[name] = AxisPlan(
            "unknown" if place is None else axis.config.show(place), axis.config.show(goal)
        )
        if place is not None:
            speed = command.speed
            limits = Limits(axis.config.max_velocity * speed, axis.config.acceleration * speed**2)
            moves[name] = Move(place, goal, limits)
    if not moves:
        return Plan(shown)
    kind: Kind = getattr(command, "kind", "trapezoid")
    profile = synchronize(moves, kind=kind, duration=command.duration)
    return Plan(shown, profile.duration, profile.limited_by)
