"""The gate lets through what lies inside known limits, and nothing else that moves."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.request import EVERY_LANE, Effect, Expected, Priority, Request, Response
from motorbus.core.setpoint import Setpoint, Stays, torque_on
from motorbus.errors import LimitExceeded, Refused
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.lease import Lease, Standing
from motorbus.motion.safety.track import FRESH


def motion(*goals: Setpoint, priority: Priority = Priority.POLL) -> Request[Response]:
    return Request(b"\x01", effect=Effect.MOTION, setpoints=goals, priority=priority)


@pytest.mark.parametrize("value", [-1.0, 0.0, 1.0])
def test_inside_the_limits_passes(value: float) -> None:
    Gate()(motion(Setpoint(1, "position", value, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (Setpoint(3, "position", nan, -1.0, 1.0), "not a finite number"),
        (Setpoint(3, "position", inf, -1.0, 1.0), "not a finite number"),
        (Setpoint(3, "position", 1.01, -1.0, 1.0), "lies outside -1 to 1"),
        (Setpoint(3, "position", -1.01, -1.0, 1.0), "lies outside -1 to 1"),
        (Setpoint(3, "position", 0.0), "limits are not known"),
        (Setpoint(3, "position", 0.0, -1.0, None), "limits are not known"),
    ],
)
def test_everything_else_is_refused_with_the_reason(goal: Setpoint, why: str) -> None:
    with pytest.raises(LimitExceeded, match=why) as caught:
        Gate()(motion(Setpoint(1, "position", 0.0, -1.0, 1.0), goal))
    assert caught.value.node == 3
    assert "nothing was sent" in str(caught.value)


def test_motion_that_does_not_say_where_to_is_refused() -> None:
    with pytest.raises(LimitExceeded, match="does not say where"):
        Gate()(motion())


@pytest.mark.parametrize("effect", [Effect.NONE, Effect.PERSISTENT, Effect.IDENTITY, Effect.TORQUE])
def test_what_does_not_move_passes(effect: Effect) -> None:
    Gate()(Request(b"\x01", effect=effect))


def test_a_stop_always_passes() -> None:
    Gate()(motion(priority=Priority.STOP))


@given(st.floats(), st.floats(-100, 100), st.floats(0, 100))
def test_a_goal_passes_exactly_when_it_lies_inside(value: float, low: float, width: float) -> None:
    slack = 1e-6
    try:
        Gate()(motion(Setpoint(1, "position", value, low, low + width)))
        passed = True
    except LimitExceeded:
        passed = False
    if low <= value <= low + width:
        assert passed
    if not low - slack <= value <= low + width + slack:
        assert not passed


# -- guards, faults, leases ----------------------------------------------------------------------------------------


def place(value: float, node: int = 1) -> Setpoint:
    return Setpoint(node, "position", value, -9.0, 9.0)


class Line:
    """A gate over node 1, the readings that its bus has heard, and the time."""

    def __init__(self, bounds: Bounds = Bounds(-1.0, 2.0, 0.5, 3.0)) -> None:  # noqa: B008 - a value
        self.gate = Gate()
        self.now = 0.0
        self.seen: dict[int, tuple[Request[Any], Response]] = {}
        self.told: list[bool] = []
        self.gate.watch(self.seen, lambda: self.now)
        self.gate.guards[1] = Guard("elbow", bounds, ask=lambda: QUESTION, ordered=self.told.append)

    def reads(self, value: float, at: float | None = None) -> None:
        self.now = self.now if at is None else at
        self.seen[1] = Request(b"?", reports_position=lambda _: {1: value}), Response((), (), self.now)

    def passes(self, *goals: Setpoint, **options: Any) -> bool:
        try:
            self.gate(motion(*goals, **options))
        except Refused:
            return False
        return True

    def reason(self, *goals: Setpoint, effect: Effect = Effect.MOTION) -> str:
        try:
            self.gate(Request(b"\x01", effect=effect, setpoints=goals))
        except Refused as refusal:
            return refusal.reason
        return ""


QUESTION: Request[Response] = Request(b"?")


def test_a_guard_wants_to_know_where_it_is_and_looks_by_itself_at_what_the_bus_heard() -> None:
    line = Line()
    assert line.reason(place(0.1)) == "stale"
    line.reads(0.0, 1.0)
    assert line.passes(place(0.1))
    assert line.reason(place(0.6)) == "step"
    line.reads(0.2, 1.2)
    assert line.passes(place(0.6))
    line.now = 1.9
    assert line.reason(place(0.3)) == "stale"


def test_one_goal_of_several_that_is_refused_holds_back_all() -> None:
    line = Line()
    line.reads(0.0, 1.0)
    assert line.passes(place(9.0, node=2), place(0.1))
    assert not line.passes(place(0.1), place(0.6))


def test_an_order_for_everyone_is_one_for_those_whom_it_does_not_name() -> None:
    line = Line()
    line.reads(0.0, 1.0)
    everyone = {"effect": Effect.MOTION, "lane": EVERY_LANE}
    line.gate(Request(b"\x01", setpoints=(place(0.4, node=2),), **everyone))  # type: ignore[arg-type]
    order: Request[Response] = Request(b"\x01", setpoints=(place(0.6, node=2),), **everyone)  # type: ignore[arg-type]
    with pytest.raises(LimitExceeded, match="elbow: this is 0.6 rad"):
        line.gate(order)
    line.now = 9.0
    assert line.gate.required_reads(order) == [QUESTION]


def test_it_says_what_must_be_asked_before_an_order_can_be_judged() -> None:
    line = Line()
    order = motion(place(0.1), Setpoint(1, "speed", 1.0, -9.0, 9.0), place(0.0, node=2))
    assert line.gate.required_reads(order) == [QUESTION]
    assert line.gate.required_reads(motion(place(0.1), priority=Priority.STOP)) == []
    assert line.gate.required_reads(motion(Setpoint(1, "position", 0.1, 0.1, 0.1, Stays.STILL))) == []
    assert line.gate.required_reads(Request(b"")) == []
    line.reads(0.0, 1.0)
    assert line.gate.required_reads(order) == []
    line.reads(1.5, 1.001)
    assert line.gate.required_reads(order) == [QUESTION]
    assert line.reason(place(0.1)) == "suspect"
    line.reads(1.5, 1.002)
    assert line.gate.required_reads(order) == []


def test_staying_is_always_allowed_and_a_number_it_must_be() -> None:
    line = Line()
    line.gate.faults[1] = "gone"
    line.gate.lease = Lease()
    assert line.passes(Setpoint(1, "position", 7.0, 7.0, 7.0, Stays.STILL))
    assert line.passes(Setpoint(1, "velocity", 0.0, 0.0, 0.0, Stays.STILL))
    assert not line.passes(Setpoint(1, "position", nan, nan, nan, Stays.STILL))


def test_a_goal_stays_because_it_is_marked_so_and_not_because_its_limits_leave_one_place() -> None:
    line = Line()
    only, on = Setpoint(1, "position", 7.0, 7.0, 7.0), torque_on(1)
    assert line.gate.required_reads(motion(only)) == [QUESTION]
    assert line.reason(only) == "stale"
    line.reads(0.0, 1.0)
    assert line.reason(only) == "limits"
    assert line.passes(on)
    line.gate.lease = Lease()
    assert line.reason(only) == line.reason(on) == line.reason(on, effect=Effect.TORQUE) == "lease"
    line.gate.faults[1] = "gone"
    assert line.reason(only) == line.reason(on) == line.reason(on, effect=Effect.TORQUE) == "fault"


def test_an_order_for_everyone_is_refused_while_anybody_of_them_is_at_fault() -> None:
    line = Line()
    line.reads(0.0, 1.0)
    line.gate.faults[3] = "gone"
    assert line.passes(place(0.1))
    for effect in (Effect.MOTION, Effect.TORQUE):
        with pytest.raises(Refused, match="node 3 is at fault"):
            line.gate(Request(b"\x01", effect=effect, setpoints=(place(0.1),), lane=EVERY_LANE))


def test_a_node_at_fault_neither_moves_nor_gets_torque_and_others_do() -> None:
    line = Line()
    line.reads(0.0, 1.0)
    line.gate.faults[1] = "it has lost its supply"
    assert line.reason(place(0.1)) == "fault"
    torque: Request[Response] = Request(b"\x01", (Expected(1, 1, 6),), effect=Effect.TORQUE)
    with pytest.raises(Refused, match="node 1 is at fault: it has lost its supply"):
        line.gate(torque)
    line.gate(Request(b"\x01", (Expected(1, 1, 6),), effect=Effect.TORQUE, priority=Priority.STOP))
    line.gate(Request(b"\x01", (Expected(1, 1, 6),), effect=Effect.PERSISTENT))
    line.gate(Request(b"\x01", (Expected(2, 2, 6),), effect=Effect.TORQUE))
    assert line.passes(place(0.1, node=2))


def test_with_a_lease_only_its_holder_moves_anything_and_while_he_is_there() -> None:
    line = Line()
    line.reads(0.0, 1.0)
    line.gate.lease = lease = Lease()
    assert line.reason(place(0.1)) == line.reason(effect=Effect.TORQUE) == "lease"
    lease.take("page", 1.0)
    assert line.passes(place(0.1))
    line.now = 1.51
    assert line.reason(place(0.1)) == "lease"
    assert lease.standing(1.51) is Standing.LOST


@pytest.mark.parametrize("quantity", ["velocity", "load", "current"])
def test_what_has_no_end_of_its_own_needs_somebody_who_attends(quantity: str) -> None:
    line = Line()
    goal = Setpoint(1, quantity, 0.5, -9.0, 9.0)
    assert line.passes(goal)
    line.gate.attended = True
    assert line.reason(goal) == "unattended"
    line.gate.lease = lease = Lease()
    lease.take("page", 0.0)
    assert line.reason(goal) == "unattended"
    lease.attend("page", 0.0)
    assert line.passes(goal)
    assert line.passes(goal._replace(value=0.0))
    other = goal._replace(node=2)  # which is no axis that is open: nobody would stop it
    assert line.reason(other) == "unattended"
    line.gate.guards[2] = Guard("wrist", Bounds())
    assert line.reason(other) == "unattended"


def test_a_velocity_keeps_its_bound_whether_it_turns_or_only_bounds() -> None:
    line = Line()
    for quantity in ("velocity", "speed"):
        assert line.passes(Setpoint(1, quantity, -3.0, -9.0, 9.0))
        assert line.reason(Setpoint(1, quantity, -4.0, -9.0, 9.0)) == "limits"


@given(
    st.floats(-3, 3),
    st.floats(0, 1),
    st.sampled_from(["position", "relative"]),
    st.floats(allow_nan=True, allow_infinity=True),
)
def test_whatever_passes_is_inside_near_and_was_read_lately(
    here: float, age: float, quantity: str, value: float
) -> None:
    line = Line()
    line.reads(here, 5.0)
    line.now = 5.0 + age
    if line.passes(Setpoint(1, quantity, value, -inf, inf)):
        to = value if quantity == "position" else here + value
        assert age <= FRESH
        assert min(-1.0, here) - 0.004 <= to <= max(2.0, here) + 0.004
        assert abs(to - here) <= 0.504


# -- what goes on without an end, and why something ended ----------------------------------------------------------


def test_it_knows_what_goes_on_until_a_stop_or_an_order_to_rest_was_accepted() -> None:
    line, stops, accepted = Line(), {1: 0}, {1: 0}
    line.gate.watch(line.seen, lambda: line.now, stops.__getitem__, accepted.__getitem__)
    turn = Setpoint(1, "velocity", 0.5, -9.0, 9.0)
    for ended in (Setpoint(1, "velocity", 0.0, 0.0, 0.0, Stays.STILL), turn._replace(value=0.0)):
        assert not line.gate.goes_on(1)
        assert line.passes(turn)
        assert line.passes(ended)
        stops[1] += 1
        assert line.gate.goes_on(1)  # it has left, and may have been lost
        accepted[1] += 1
    assert not line.gate.goes_on(1)


def test_what_is_refused_does_not_go_on_and_a_rehearsal_notes_nothing() -> None:
    line = Line()
    line.gate.attended = True
    turn = Setpoint(1, "velocity", 0.5, -9.0, 9.0)
    assert line.reason(turn) == "unattended"
    assert not line.gate.goes_on(1)
    rehearsal = line.gate.rehearsing()
    rehearsal(Request(b"", effect=Effect.MOTION, setpoints=(turn,)))
    assert not line.gate.goes_on(1)
    with pytest.raises(LimitExceeded):
        rehearsal(Request(b"", effect=Effect.MOTION, setpoints=(turn._replace(value=8.0),)))


def test_a_lease_has_the_time_of_the_robot() -> None:
    line = Line()
    line.gate.lease = lease = Lease()
    line.now, line.gate.origin = 100.0, 99.0
    lease.take("page", 1.0)
    assert line.reason(effect=Effect.TORQUE) == ""
    assert line.gate.loss() is None
    line.now = 101.0
    assert line.gate.loss() is not None


def test_a_gate_that_was_told_of_no_clock_takes_whatever_was_seen_for_old() -> None:
    gate, guard = Gate(), Guard("elbow", Bounds())
    gate.guards[1] = guard
    assert guard.track is not None
    guard.track.take(0.0, 1e9)
    with pytest.raises(Refused, match="inf s ago") as caught:
        gate(motion(place(0.1)))
    assert caught.value.reason == "stale"
