"""Health of axes that hold torque: restart, lost torque, overload, heat.

While a loop leads axes one device at a time is asked, each every 0.25 s, altogether with a tenth of what the wire
carries. The limits act before the protection of the servos: an STS3215 protects itself above 80 % of its torque after
2 s, above 3.25 A after 2 s and at 70 °C (memory table V3.6, registers 36, 35, 28, 38, 13).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final

from motorbus.bus.base import BaseBus
from motorbus.core.family import Health, State
from motorbus.core.request import Request
from motorbus.core.steps import catch, discard
from motorbus.errors import Faulted, MotorbusError, Overloaded
from motorbus.motion.axis import Axis
from motorbus.motion.program import LOST, OnBuses, run

PERIOD: Final = 0.25  # s after which an axis is asked again
SHARE: Final = 0.1  # of what the wire carries
LOAD: Final = 0.8  # share of the full torque
CURRENT: Final = 2.5  # A of the supply
OFF: Final = 0.1  # rad of the device off its goal; a servo at its highest load is 0.05 rad off
STRAIN_TIME: Final = 1.0  # s for which load, or current, and distance last
TURNING: Final = 0.5  # rad/s; the load of what turns faster is that of its speed
HOT: Final = 65.0  # °C
COOL: Final = 60.0  # °C below which a hot motor is no longer hot
PROTECTIVE: Final = frozenset(("sensor", "temperature", "current", "overload"))
"""Alarms with which a device switches its torque off to protect itself."""


@dataclass(slots=True)
class _Record:
    """What is known of the health of one axis. `stops`: stops of its node when torque was given; None: no torque."""

    stops: int | None = None
    blank: bool | None = None
    restarts: int | None = None
    strained_since: float | None = None
    hot: bool = False
    asked: float = -inf


class HealthMonitor:
    """Judges the health of the axes of a robot."""

    def __init__(self) -> None:
        self._records: dict[str, _Record] = {}
        self._free: dict[BaseBus, float] = {}  # when the wire may be used for health again (s)

    # -- torque ----------------------------------------------------------------------------------------------------

    async def check_kept(self, axis: Axis) -> None:
        """Procedure: an axis that was given torque must still have it. Raises Faulted."""
        if self._is_armed(axis):
            await self._ask(axis)

    async def arm(self, axis: Axis, stops: int) -> None:
        """Procedure: torque was given; `stops` is the number of stops of its node before that. Raises Faulted."""
        record = self._record(axis)
        record.stops, record.blank, record.strained_since = stops, None, None
        await self._ask(axis)

    def _is_armed(self, axis: Axis) -> bool:
        return axis.status.engaged and self._record(axis).stops == axis.bus.stop_count(axis.config.node)

    def _record(self, axis: Axis) -> _Record:
        return self._records.setdefault(axis.name, _Record())

    # -- looks -----------------------------------------------------------------------------------------------------

    async def look(self, axes: list[Axis], goals: dict[str, float]) -> None:
        """Program: ask the axis of each bus that is due. `goals`: rad of the device, by name.

        Raises Faulted for a device that has restarted or lost its torque, Overloaded for one that pushes too hard for
        too long or is too hot.
        """
        due: dict[BaseBus, tuple[Axis, Request[Health]]] = {}
        for axis in sorted(axes, key=lambda axis: self._record(axis).asked):
            now = axis.bus.now()
            if axis.bus in due or "health" not in axis.driver or now < self._free.get(axis.bus, -inf):
                continue
            if now < self._record(axis).asked + PERIOD:
                continue
            request = axis.driver.health(axis.device)
            if not isinstance(request, Request):
                discard(request)
                continue
            due[axis.bus] = axis, request
            self._free[axis.bus] = now + axis.bus.driver.air_time(request, axis.bus.rate) / SHARE
        if not due:
            return
        answers = await OnBuses({bus: catch(request) for bus, (_, request) in due.items()})
        for bus, (axis, _) in due.items():
            self._take(axis, answers[bus], goals.get(axis.name))

    async def examine(self, axis: Axis) -> None:
        """Program: ask an axis at once that does not follow its goals. Raises what is the matter, if that shows."""
        await run(axis.bus, self._ask(axis))

    async def _ask(self, axis: Axis) -> None:
        if "health" in axis.driver:
            self._take(axis, await catch(axis.driver.health(axis.device)), None)

    def is_due(self, axis: Axis) -> bool:
        """An axis that holds torque has not been asked lately."""
        return (
            "health" in axis.driver
            and self._is_armed(axis)
            and axis.bus.now() > self._record(axis).asked + PERIOD
        )

    async def note(self, axis: Axis) -> None:
        """Procedure: ask an axis that only holds. A fault is noted in its status and raises nothing."""
        if self.is_due(axis):
            await catch(self._ask(axis))

    # -- judgements -------------------------------------------------------------------------------------------------

    def _take(self, axis: Axis, answer: Health | MotorbusError, goal: float | None) -> None:
        record = self._record(axis)
        record.asked = axis.bus.now()
        if isinstance(answer, MotorbusError):
            if isinstance(answer, LOST):
                return
            raise answer
        state = answer.state
        axis.status.state = state
        reason = self._fault_reason(axis, record, answer)
        if reason:
            error = _faulted(axis, answer, reason)
            axis.status.set_fault(error.summary.partition(": ")[2])
            raise error
        if axis.config.monitor_load:
            self._judge_strain(axis, record, state, goal)

    def _fault_reason(self, axis: Axis, record: _Record, health: Health) -> str:
        before, record.restarts = record.restarts, health.restarts
        restarted = before is not None and health.restarts is not None and health.restarts > before
        was_blank = record.blank
        record.blank = health.blank if record.blank is None else record.blank
        if not self._is_armed(axis):
            return ""
        if restarted or (was_blank is False and health.blank is True):
            return "restart"
        if health.torque is not False:
            return ""
        return "torque_lost" if PROTECTIVE & set(health.state.alarm) or health.blank is False else "restart"

    def _judge_strain(self, axis: Axis, record: _Record, state: State, goal: float | None) -> None:
        if state.temperature is not None:
            record.hot = state.temperature >= (COOL if record.hot else HOT)
        here = state.position if state.position is not None else axis.status.position
        off = goal is not None and here is not None and abs(goal - here) > OFF
        turns = state.velocity is not None and abs(state.velocity) > TURNING
        pushes = state.load is not None and abs(state.load) >= LOAD and not turns
        pushes = pushes or (state.current is not None and abs(state.current) >= CURRENT)
        if not (off and pushes):
            record.strained_since = None
        elif record.strained_since is None:
            record.strained_since = state.at
        since = record.strained_since
        if since is not None and state.at - since >= STRAIN_TIME:
            raise Overloaded(
                f"{axis.name} has pushed too hard for {state.at - since:.1f} s: {_figures(state)}",
                reason="load",
                expected=f"below {LOAD:.0%} load and {CURRENT} A, or within {OFF} rad of its goal",
                cause="something blocks it, or the load is too heavy",
                advice="clear the way; it keeps its torque",
                node=axis.config.node,
            )
        if record.hot:
            raise Overloaded(
                f"{axis.name} is too hot: {_figures(state)}",
                reason="heat",
                expected=f"below {COOL:g} °C",
                advice="take the load off and let it cool; it keeps its torque",
                node=axis.config.node,
            )


def _figures(state: State) -> str:
    texts = {
        "load {:.0%}": None if state.load is None else abs(state.load),
        "{:.2f} A": None if state.current is None else abs(state.current),
        "{:.1f} V": state.voltage,
        "{:.0f} °C": state.temperature,
    }
    found = [text.format(value) for text, value in texts.items() if value is not None]
    return ", ".join([*found, *state.alarm])


def _faulted(axis: Axis, health: Health, reason: str) -> Faulted:
    what, cause = "restarted", "its supply dipped: too weak, a loose cable, or too much load at once"
    if reason == "torque_lost":
        what, cause = "lost its torque", "its own protection, or another program"
    figures = _figures(health.state)
    return Faulted(
        f"{axis.name}: {axis.config.device} has {what}{f' ({figures})' if figures else ''}",
        reason=reason,
        cause=cause,
        advice=f'it gets no torque by itself: check it, then robot.clear_fault("{axis.name}")',
        node=axis.config.node,
    )
