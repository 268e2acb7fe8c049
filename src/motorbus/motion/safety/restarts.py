"""When an axis is at fault: its device let go, or has restarted, without having been told to.

A servo whose supply dips starts anew and answers again at once, as if nothing had been. It is limp then, or follows the
next goal at full speed, and everything it was told is gone. So an axis that was given torque from here is looked at
again and again: is its torque still on, does it still know what it was told, has it said that it starts? What else it
tells decides about the words. An axis at fault gets no torque by itself: where it is is forgotten, and every order to
move it is refused until somebody has seen to it and says so. Stop and torque off are always allowed.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.core.family import Health
from motorbus.core.steps import Emit, catch
from motorbus.errors import Faulted, Refused
from motorbus.motion.safety.gate import Gate

if TYPE_CHECKING:
    from motorbus.motion.capabilities import AxisVerbs

HEALTH: Final = 0.25
"""s after which an axis is asked again how it fares."""
UNTRUSTED: Final = "untrusted: "
"""How the reason of a fault begins that only `motorbus recover` ends."""
RESTART: Final = "restart"
LET_GO: Final = "let go"
PROTECTIVE: Final = frozenset(("sensor", "temperature", "current", "overload"))
"""Alarms for which a device lets go to protect itself; of one of its supply nobody knows what came first."""


class FaultNoted(NamedTuple):
    """An event: this axis is at fault, and `why`."""

    axis: str
    why: str


class RestartDetector:
    """What is known of one axis by which a restart of its device shows. `at` is when it was looked at last (s);
    `fell` is true where it had torque from here when it came to be at fault, until it is given some again."""

    __slots__ = ("_before", "_blank", "_restarts", "_stops", "at", "fell")

    def __init__(self) -> None:
        self.at = -inf
        self.fell = False
        self._before: int | None = None
        self._stops: int | None = None
        self._blank: bool | None = None
        self._restarts: int | None = None

    def prepare(self, stops: int) -> None:
        """It is about to be given torque; so many stops have left for it by now."""
        self._before = stops

    def arm(self) -> None:
        """It has been given torque: from here on torque that is gone is a fault, unless it was stopped meanwhile."""
        self._stops, self._blank, self.fell = self._before, None, False

    def disarm(self) -> None:
        """It was let go, or is at fault: what its torque does is no news."""
        self._stops = self._blank = None

    def is_armed(self, stops: int) -> bool:
        """Whether it was given torque, and no stop has left for it since."""
        return self._stops == stops

    def take(self, health: Health, *, armed: bool, led: bool) -> str:
        """Judge how a device fares: "" or the reason of a fault. Each sample once.

        While it is `led` nobody but who leads it tells it how fast to be, so that may not be lost.
        """
        self.at = health.state.at
        before, self._restarts = self._restarts, health.restarts
        said = before is not None and health.restarts is not None and health.restarts > before
        lost = led and self._blank is False and health.blank is True
        if led and self._blank is None:
            self._blank = health.blank
        if said or lost:
            return RESTART
        if not armed or health.torque is not False:
            return ""
        protects = PROTECTIVE & frozenset(health.state.alarm)
        return LET_GO if protects or health.blank is False else RESTART


# -- at fault ----------------------------------------------------------------------------------------------------------


def looked_at(axis: AxisVerbs, health: Health, *, led: bool = False) -> Faulted | None:
    """Judge a sample of an axis; when that shows a fault the axis is at fault from here on, and this is the error."""
    reason = axis.restarts.take(health, armed=holds(axis), led=led)
    if not reason or not (axis.engaged or axis.under_way):
        return None
    error = _faulted(axis, health, reason)
    fault(axis, error.summary.partition(": ")[2])
    return error


async def looked_after(axis: AxisVerbs, now: float) -> None:
    """Of an axis that was given torque from here: ask how it fares, unless that was done lately.

    A fault is noted and reported, and raises nothing; an answer that was lost tells nothing.
    """
    if not axis.engaged or "health" not in axis.able or now - axis.restarts.at < HEALTH:
        return
    found = await catch(axis.able.health(axis.device))
    if isinstance(found, Health) and looked_at(axis, found) is not None:
        await Emit(FaultNoted(axis.name, why(axis)))


async def unbroken(axis: AxisVerbs) -> None:
    """Of an axis that is to get torque: raise Faulted where it had some from here, and its device has not kept it.

    One that was given none from here, or was let go since, is not asked.
    """
    if holds(axis):
        await kept(axis)


def holds(axis: AxisVerbs) -> bool:
    """Whether it was given torque from here, and nothing has left since that may have let it go."""
    return axis.engaged and axis.restarts.is_armed(_stops(axis))


async def kept(axis: AxisVerbs) -> None:
    """Of an axis that was told to hold: raise Faulted where its device has not kept its torque."""
    if "health" not in axis.able:
        return
    found = await catch(axis.able.health(axis.device))
    if isinstance(found, Health) and (error := looked_at(axis, found)) is not None:
        await Emit(FaultNoted(axis.name, why(axis)))
        raise error


def expected(axis: AxisVerbs) -> None:
    """It is about to be given torque from here. A stop that comes from now on explains why it has none."""
    axis.restarts.prepare(_stops(axis))


def armed(axis: AxisVerbs) -> None:
    """It has been given torque from here, since it was `expected`."""
    axis.restarts.arm()


def fault(axis: AxisVerbs, why: str) -> None:
    """It is at fault from here on: nothing of it moves or gets torque, and where it is is not known any more.

    Nothing is sent. Who had the command over it has lost it, so no goal of it leaves that was made before.
    """
    gate = _gate(axis)
    if gate is not None:
        gate.faults[axis.spec.node] = why
        guard = gate.guards.get(axis.spec.node)
        if guard is not None and guard.track is not None:
            guard.track.forget()
    axis.track.forget()
    if axis.reckoning is not None:
        axis.reckoning.forget(why)
    axis.restarts.disarm()
    axis.restarts.fell = axis.restarts.fell or axis.engaged
    axis.orders += 1
    axis.engaged = axis.under_way = False


def unknown(axis: AxisVerbs) -> None:
    """The line to its device was cut, and is there again: where it is, and how it fares, is to be asked anew.

    Nothing is sent. Whoever is to move it, or to give it torque, asks first whether it has kept that it had.
    """
    axis.track.forget()
    axis.restarts.at = -inf
    if axis.reckoning is not None:
        axis.reckoning.forget("the port of its bus was gone for a while")


def cleared(axis: AxisVerbs) -> None:
    """Somebody has seen to it: it may be given torque and moved again. Nothing is sent."""
    gate = _gate(axis)
    if gate is not None:
        gate.faults.pop(axis.spec.node, None)


def why(axis: AxisVerbs) -> str:
    """Why it is at fault; "" when it is not."""
    gate = _gate(axis)
    return "" if gate is None else gate.faults.get(axis.spec.node, "")


def check(axis: AxisVerbs) -> None:
    """Raise Refused while it is at fault: before anything is sent that would move it or give it torque."""
    if text := why(axis):
        see = f'see to it, then robot.clear_fault("{axis.name}"), or open the machine anew'
        raise Refused(
            f"{axis.name} is at fault: {text}",
            reason="fault",
            advice=f"{'end that change first' if text.startswith(UNTRUSTED) else see}; nothing was sent",
            node=axis.spec.node,
        )


def _faulted(axis: AxisVerbs, health: Health, reason: str) -> Faulted:
    supply = "" if health.state.voltage is None else f", and its supply is {health.state.voltage:.1f} V now"
    alarms = f"; alarms: {', '.join(health.state.alarm)}" if health.state.alarm else ""
    if reason == RESTART:
        said = f"{axis.spec.device} has restarted{supply}{alarms}"
        cause = "its supply dipped or was cut for a moment: too weak, a loose cable, or too much load at once"
    elif PROTECTIVE & frozenset(health.state.alarm):
        said = f"{axis.spec.device} has let go to protect itself{supply}{alarms}"
        cause = "it pushed too hard for too long, or became too hot"
    else:
        said = f"{axis.spec.device} has let go, and was not told to from here{supply}{alarms}"
        cause = "another program or another host switched its torque off"
    return Faulted(
        f"{axis.name} is at fault: {said}",
        reason=reason,
        expected="a device that keeps its torque until it is told to let go",
        cause=cause,
        advice=f"it gets no torque by itself, and is not moved: see to it, then robot.clear_fault({axis.name!r})",
        node=axis.spec.node,
    )


def _gate(axis: AxisVerbs) -> Gate | None:
    gate = getattr(axis.bus, "interlock", None)
    return gate if isinstance(gate, Gate) else None


def _stops(axis: AxisVerbs) -> int:
    """How many stops have left for it on its bus, whoever sent them."""
    count: int = axis.bus.stop_count(axis.spec.node)
    return count
