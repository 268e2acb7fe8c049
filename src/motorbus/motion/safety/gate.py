"""The one gate that every motion command passes, whatever face or spelling it comes from.

The bus asks it before anything leaves whose row says that writing it moves a motor or switches its torque
(decision record 0014). What it cannot judge it refuses: a goal that is not finite, lies outside the limits the
device itself declares, or comes without limits. Where somebody has set a guard over a node, its goals keep within that
as well, and it must be known where the node is, by a reading that is fresh and can be believed.

The gate judges and never changes: when it is asked, the bytes are made. It reads no clock and asks no device; what the
bus has heard lately is what it knows. A stop passes whatever happens, and so does an order to stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from math import inf, isfinite
from typing import Any, Final

from motorbus.core.request import EVERY_LANE, Effect, Priority, Request, Response, Stops
from motorbus.core.setpoint import Deferred, Setpoint, Stays
from motorbus.core.steps import Runnable
from motorbus.errors import LimitExceeded, Refused
from motorbus.motion.safety.flock import Flocks
from motorbus.motion.safety.guard import ENDLESS, PLACES, Guard, untold
from motorbus.motion.safety.lease import Lease
from motorbus.motion.safety.refusing import nobody_stops, nothing_known, stopped_since
from motorbus.motion.safety.track import FRESH
from motorbus.motion.safety.turning import Turning
from motorbus.motion.safety.waiting import Handed, Waiting

ROUNDING = 1e-9  # relative; a limit converted to its unit and back still admits itself

Seen = Mapping[int, "tuple[Request[Any], Response]"]
"""By node, the last exchange that told where it is, and its answer."""


class Gate:
    """Called with an exchange before it is sent; raises Refused, as a rule LimitExceeded, else does nothing.

    `guards` by node are what bounds it beyond the limits of its device. `faults` by node are reasons for which nothing
    of it may move or get torque. With a `lease`, only its holder moves anything; the time of that was 0 when the clock
    of the link showed `origin` (s). `attended`: endless motion, which only its stop ends, needs a lease whose holder
    attends.
    """

    def __init__(self) -> None:
        self.guards: Final[dict[int, Guard]] = {}
        self.faults: Final[dict[int, str]] = {}
        self.lease: Lease | None = None
        self.attended = False
        self.origin = 0.0
        self.turning = Turning()
        self._tells = True
        self._waiting = Waiting()
        self._flocks: Final = Flocks()
        self._stops: Stops = _none
        self._seen: Seen = {}
        self._now: Callable[[], float] = _never
        self._answer: Response | None = None
        self._places: Mapping[int, float] = {}

    def watch(
        self,
        seen: Seen,
        now: Callable[[], float],
        stops: Stops | None = None,
        accepted: Stops | None = None,
    ) -> None:
        """Look there for what nodes have told of their positions; `now` gives the time on the link's clock (s), `stops`
        how many stops have left for a node, `accepted` how many it has accepted."""
        self._seen, self._now, self._stops = seen, now, stops or self._stops
        self.turning.accepted = accepted or self.turning.accepted

    def rehearsing(self) -> Gate:
        """A gate that judges as this one, for orders that nobody is going to send: nobody has to attend those."""
        found = copy(self)
        found._tells = False
        found.attended, found.turning, found._waiting = False, Turning(), self._waiting.copy()
        return found

    def goes_on(self, node: int) -> bool:
        """Whether it was told to go on without an end, as far as this gate knows, and has accepted no stop since."""
        return self.turning.goes_on(node)

    def forget(self) -> None:
        """The line to the nodes was cut, and is there again: where they are, and what waits in them, nobody knows."""
        self._waiting = Waiting()
        for guard in self.guards.values():
            guard.forget()

    def loss(self) -> Refused | None:
        """The error for a lease that is lost; None where it is not, or there is none."""
        return None if self.lease is None else self.lease.loss(self._now() - self.origin)

    def required_reads(self, request: Request[Any]) -> list[Runnable[Any]]:
        """What must be asked before this order can be judged: where those are whose position is not known well enough.

        Whoever carries out orders asks for it and carries it out; what came of it the gate sees by itself.
        """
        if not self.guards or request.priority is Priority.STOP:
            return []
        if request.deferred is not None and request.deferred.begins:
            goals = _goals(self._waiting.of(request.deferred))
        elif request.effect is not Effect.MOTION:
            return []
        else:
            goals = request.setpoints
        found: dict[int, Runnable[Any]] = {}
        everyone, now = request.lane == EVERY_LANE, self._now()
        if not everyone and self._are_known(goals, now):
            return []
        for goal in self._of_everyone(goals) if everyone else goals:
            guard = self.guards.get(goal.node)
            if guard is None or guard.track is None or guard.ask is None:
                continue
            if goal.quantity not in PLACES or _stays(goal):
                continue
            self._look(goal.node, guard)
            if goal.node not in found and guard.track.why_not(now):
                found[goal.node] = guard.ask()
        return list(found.values())

    def check(self, request: Request[Any], now: float) -> None:
        """Raise Refused if this must not leave now."""
        if not (request.prechecked and self.passes(request)):
            self(request)

    def stopped(self, nodes: Iterable[int]) -> None:
        """A stop of these nodes is about to leave; nothing is to be done for it here."""

    def lets_move(self) -> bool:
        """Whether anybody may be moved at this moment: nobody is at fault, and a lease that there is holds."""
        return not self.faults and (self.lease is None or self.lease.lets_move(self._now() - self.origin))

    def passes(self, request: Request[Any]) -> bool:
        """Whether this may surely leave: then it is noted as given. Else nothing is, and the caller looks closely.

        It is the quick way of the orders of a control loop, and agrees with `required_reads` and a call of the gate.
        """
        if not request.prechecked or not self.lets_move():
            return False
        if not self.guards:
            return not self.attended
        goals, now = request.setpoints, self._now()
        flock = self._flocks.of(request.group, self.guards)
        if flock is not None and flock.are_fine(goals, self._seen, self._told_by, now):
            if self._tells:
                flock.tell()
            return True
        if not self._are_fine(goals, now):
            return False
        if self._tells:
            for goal in goals:
                self.guards[goal[0]].ordered(True)
        return True

    def __call__(self, request: Request[Any]) -> None:
        later = request.deferred
        if request.priority is Priority.STOP or (later is None and request.effect < Effect.TORQUE):
            return
        if later is None:
            self._judge(request, request.setpoints)
        elif later.begins:
            self._judge(request, self._begun(request, later))
            self._waiting.begin(later)
        else:
            if request.effect >= Effect.TORQUE:
                self._judge(request, request.setpoints, obeyed=False)
            if later.node is not None:
                self._waiting.take(later, request.setpoints, self._stops(later.node))

    def _judge(self, request: Request[Any], goals: tuple[Setpoint, ...], *, obeyed: bool = True) -> None:
        """Judge it by these goals; those that are not `obeyed` yet set nothing moving and end nothing."""
        if (
            obeyed
            and goals
            and not self.faults
            and request.lane != EVERY_LANE
            and self._are_fine(goals, self._now())
        ):
            if self.lease is not None:
                self._check_standing(request, goals)
            if self._tells:
                for goal in goals:
                    self.guards[goal[0]].ordered(True)
            return
        if request.effect is Effect.MOTION and not goals:
            raise LimitExceeded(
                "this write moves a motor and does not say where to",
                sent=request.wire,
                cause="the driver made an exchange with effect motion and without goals",
                advice="use a move, or a write by register name; nothing was sent",
            )
        for goal in goals:
            _check(goal)
        if self.faults or self.lease is not None:
            self._check_standing(request, goals)
        if self.guards or self.attended:
            now = self._now()
            leaving: list[tuple[Guard, Setpoint]] = []
            for goal in self._of_everyone(goals) if request.lane == EVERY_LANE else goals:
                guard = self.guards.get(goal.node)
                if guard is not None:
                    self._look(goal.node, guard)
                    if goal.quantity == "position" and guard.is_fine(goal.value, now):
                        continue
                if not _stays(goal):
                    self._check_guarded(guard, goal, now, goals)
                    if guard is not None and obeyed:
                        leaving.append((guard, goal))
            for guard, goal in leaving:  # once all are judged: where it is is forgotten when it leaves
                self._leaves(guard, goal)
        if self._tells and obeyed:
            for goal in self._of_everyone(goals) if request.lane == EVERY_LANE else goals:
                if goal.node in self.guards:
                    self.guards[goal.node].told(goal)

    def _are_fine(self, goals: tuple[Setpoint, ...], now: float) -> bool:
        """Whether each of these leads to a place that is surely allowed, in one pass; else who asks looks closely."""
        guards, seen = self.guards, self._seen
        for node, quantity, value, low, high, stays in goals:
            guard = guards.get(node)
            if guard is None or quantity != "position" or stays is not None or low is None or high is None:
                return False
            heard = seen.get(node)
            if heard is not None and heard[1] is not guard.answer:
                self._look(node, guard)
            if not (low <= value <= high and guard.is_fine(value, now)):
                return False
        return True

    def _are_known(self, goals: tuple[Setpoint, ...], now: float) -> bool:
        """Whether it is known where each of these is, in one pass; else `look` finds out whom to ask."""
        guards, seen = self.guards, self._seen
        for goal in goals:
            node = goal.node
            guard = guards.get(node)
            if guard is None or (track := guard.track) is None:
                return False
            heard = seen.get(node)
            if heard is not None and heard[1] is not guard.answer:
                self._look(node, guard)
            sample = track.sample
            if sample is None or track.suspect is not None or now - sample.at > FRESH:
                return False
        return True

    def _leaves(self, guard: Guard, goal: Setpoint) -> None:
        """It is told to move: whoever reckons where it is must know, and whether this goes on without an end."""
        guard.leaves()
        if goal.quantity in ENDLESS and goal.value:
            self.turning.begins(goal.node)

    # -- what waited -------------------------------------------------------------------------------------------------

    def _begun(self, request: Request[Any], later: Deferred) -> tuple[Setpoint, ...]:
        """The goals that begin. Where anything bounds what may move it must be known what that is, and wanted still."""
        if not (self.guards or self.faults or self.attended or self.lease is not None):
            return request.setpoints
        found = self._waiting.of(later)
        if found is None:
            raise nothing_known(later)
        for one in found:
            node = one.later.node
            if node is not None and one.goals and self._stops(node) > one.stops:
                raise stopped_since(node)
        return _goals(found)

    # -- whether anything may move -----------------------------------------------------------------------------------

    def _check_standing(self, request: Request[Any], goals: tuple[Setpoint, ...]) -> None:
        if goals and all(goal.stays is Stays.STILL for goal in goals):
            return
        everyone = request.lane == EVERY_LANE
        for node in () if not self.faults else list(self.faults) if everyone else _named(request, goals):
            if node in self.faults:
                raise Refused(
                    f"node {node} is at fault: {self.faults[node]}",
                    reason="fault",
                    advice="see to it, then reset the fault; nothing was sent",
                    node=node,
                )
        if self.lease is not None:
            self.lease.check(self._now() - self.origin)

    # -- guards --------------------------------------------------------------------------------------------------------

    def _check_guarded(
        self, guard: Guard | None, goal: Setpoint, now: float, all_: tuple[Setpoint, ...]
    ) -> None:
        endless = goal.quantity in ENDLESS
        if endless and goal.value:
            self._check_attended(goal, now)
            if self.attended and (guard is None or guard.ordered is untold):
                raise nobody_stops(goal)
        if guard is None:
            return
        if goal.quantity in ("velocity", "speed"):
            guard.check_speed(goal)
        elif goal.quantity in PLACES:
            guard.check_known(goal.node, now)
            guard.check_goal(goal, paced=_paced(goal.node, all_))

    def _of_everyone(self, goals: tuple[Setpoint, ...]) -> tuple[Setpoint, ...]:
        """What an order for everyone says to those with a guard as well whom it does not name: it moves them too."""
        named = {goal.node for goal in goals}
        more = (goals[0]._replace(node=node) for node in self.guards if node not in named) if goals else ()
        return (*goals, *more)

    def _check_attended(self, goal: Setpoint, now: float) -> None:
        if self.attended and (self.lease is None or not self.lease.is_attended(now - self.origin)):
            raise Refused(
                f"node {goal.node}: goal {goal.quantity} has no end of its own, and nobody attends",
                reason="unattended",
                cause="a host that dies, or a cable that breaks, leaves the motor turning",
                advice="order it inside `robot.attended()`, or order a move, which ends by itself; nothing was sent",
                node=goal.node,
            )

    def _look(self, node: int, guard: Guard) -> None:
        """Take in what the node has told since it was looked at last."""
        found = self._seen.get(node)
        if found is None or guard.track is None or found[1] is guard.answer:
            return
        request, answer = found
        place = self._told_by(request, answer).get(node)
        if place is not None:
            guard.track.take(place, answer.at)
        # last, so that an interrupt between these lines leaves it to be taken in once more
        guard.answer = answer

    def _told_by(self, request: Request[Any], answer: Response) -> Mapping[int, float]:
        """Where those are (rad) whom this answer tells of; that of the last one is kept."""
        if answer is not self._answer:
            where = request.reports_position
            self._places = {} if isinstance(where, bool) else where(answer)
            self._answer = answer
        return self._places


def _stays(goal: Setpoint) -> bool:
    """It is told to stay where it stands, or to rest: no guard has anything against that. What its numbers are says
    nothing: a device may have one place only that it allows."""
    return goal.stays is not None


def _paced(node: int, goals: Iterable[Setpoint]) -> bool:
    """Whether what is ordered of it says how fast it goes there at most, and no time by which it is to be there."""
    told = {goal.quantity for goal in goals if goal.node == node and (goal.quantity != "time" or goal.value)}
    return "speed" in told and "time" not in told


def _none(_: int) -> int:
    """The stops of a gate that was not told where they are counted."""
    return 0


def _never() -> float:
    """The time of a gate that was told of no clock: whatever was seen is old."""
    return inf


def _named(request: Request[Any], goals: tuple[Setpoint, ...]) -> set[int]:
    """Whom it orders something, and who answers it."""
    nodes = {goal.node for goal in goals}
    if request.deferred is not None and request.deferred.node is not None:
        nodes.add(request.deferred.node)
    if isinstance(request.expected, tuple):
        nodes |= {due.node for due in request.expected}
    return nodes


def _goals(handed: Iterable[Handed] | None) -> tuple[Setpoint, ...]:
    return tuple(goal for one in handed or () for goal in one.goals)


def _check(goal: Setpoint) -> None:
    if not isfinite(goal.value):
        raise _refusal(goal, f"{goal.value} is not a finite number", "give a number")
    if goal.low is None or goal.high is None:
        raise _refusal(
            goal, "its limits are not known", "read the device's limits first, for example by identify()"
        )
    if not goal.low - _slack(goal.low) <= goal.value <= goal.high + _slack(goal.high):
        raise _refusal(
            goal,
            f"{goal.value:.6g} lies outside {goal.low:.6g} to {goal.high:.6g} {_unit(goal)}".rstrip(),
            "stay inside the limits, or change the limit registers of the device",
        )


def _unit(goal: Setpoint) -> str:
    return {"position": "rad", "relative": "rad", "velocity": "rad/s", "current": "A"}.get(goal.quantity, "")


def _slack(limit: float) -> float:
    return ROUNDING * max(abs(limit), 1.0)


def _refusal(goal: Setpoint, why: str, advice: str) -> LimitExceeded:
    return LimitExceeded(
        f"node {goal.node}: goal {goal.quantity} refused: {why}",
        expected=""
        if goal.low is None or goal.high is None
        else f"{goal.low:.6g} to {goal.high:.6g} {_unit(goal)}".rstrip(),
        advice=f"{advice}; nothing was sent",
        node=goal.node,
    )
