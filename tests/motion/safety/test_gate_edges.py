"""The gate at its edges: limits of one side, orders for several, what is handed over, and whom it tells of an order."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest

from motorbus.core.goal import Later, Stays, torque_on
from motorbus.core.operation import ANY, EVERY_LANE, Answer, Due, Effect, Exchange, Goal, Rank
from motorbus.errors import LimitExceeded, Refused
from motorbus.motion.safety.gate import ROUNDING, Gate
from motorbus.motion.safety.guard import Bounds, Guard
from motorbus.motion.safety.lease import Lease
from motorbus.motion.safety.track import FRESH

QUESTION: Exchange[Answer] = Exchange(b"?")


class Line:
    """A gate over some nodes, each as bounded as the others, what their bus has heard, and the time."""

    def __init__(self, *nodes: int, bounds: Bounds = Bounds(-1.0, 2.0, 0.5, 1.0)) -> None:  # noqa: B008 - a value
        self.gate = Gate()
        self.now = 10.0
        self.seen: dict[int, tuple[Exchange[Any], Answer]] = {}
        self.stops: dict[int, int] = {}
        self.told: list[tuple[int, bool]] = []
        self.gate.watch(self.seen, lambda: self.now, lambda node: self.stops.get(node, 0))
        for node in nodes or (1,):
            self.gate.guards[node] = self.guard(node, bounds)

    def guard(self, node: int, bounds: Bounds, **options: Any) -> Guard:
        return Guard(
            f"n{node}",
            bounds,
            ask=lambda: QUESTION,
            ordered=lambda moves: self.told.append((node, moves)),
            **options,
        )

    def reads(self, **places: float) -> None:
        """One answer that tells where these are: `n1=0.5`."""
        found = {int(name[1:]): value for name, value in places.items()}
        exchange: Exchange[Any] = Exchange(b"?", tells_position=lambda _: found)
        self.seen.update(dict.fromkeys(found, (exchange, Answer((), (), self.now))))

    def reason(self, *goals: Goal, effect: Effect = Effect.MOTION, **options: Any) -> str:
        """Why this order is refused; "" where it passes."""
        try:
            self.gate(Exchange(b"\x01", effect=effect, goals=goals, **options))
        except Refused as refusal:
            return refusal.reason
        return ""


def place(value: float, node: int = 1, low: float | None = -9.0, high: float | None = 9.0) -> Goal:
    return Goal(node, "position", value, low, high)


def goal(quantity: str, value: float, node: int = 1, stays: Stays | None = None) -> Goal:
    return Goal(node, quantity, value, -9.0, 9.0, stays)


def known(*nodes: int, **options: Any) -> Line:
    """One that has just heard that all its nodes are at 0."""
    line = Line(*nodes, **options)
    line.reads(**{f"n{node}": 0.0 for node in nodes or (1,)})
    return line


# --- limits of devices ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "low", "high", "fine"),
    [
        (0.9 * ROUNDING, -1.0, 0.0, True),
        (1.1 * ROUNDING, -1.0, 0.0, False),
        (-0.9 * ROUNDING, 0.0, 1.0, True),
        (-1.1 * ROUNDING, 0.0, 1.0, False),
        (1000 + 900 * ROUNDING, 0.0, 1000.0, True),
        (1000 + 1100 * ROUNDING, 0.0, 1000.0, False),
        (-1000 - 900 * ROUNDING, -1000.0, 0.0, True),
        (-1000 - 1100 * ROUNDING, -1000.0, 0.0, False),
        (ROUNDING, -1.0, 0.0, True),
        (-ROUNDING, 0.0, 1.0, True),
        (0.5, 0.5, 0.5, True),
        (1e300, -inf, inf, True),
        (2.0, -inf, 1.0, False),
        (-2.0, -1.0, inf, False),
        (2.0, -1.0, inf, True),
        (inf, -inf, inf, False),
        (-inf, -inf, inf, False),
        (nan, -inf, inf, False),
        (0.0, nan, 1.0, False),
        (0.0, inf, -inf, False),
        (0.0, None, 1.0, False),
        (0.0, -1.0, None, False),
        (0.0, None, None, False),
    ],
)
def test_a_limit_admits_itself_and_the_noise_of_a_conversion_and_nothing_beyond(
    value: float, low: float | None, high: float | None, fine: bool
) -> None:
    assert pytest.approx(1e-9) == ROUNDING
    order: Exchange[Answer] = Exchange(b"\x01", effect=Effect.MOTION, goals=(place(value, 1, low, high),))
    for gate in (Gate(), known(bounds=Bounds()).gate):
        if gate.guards and not abs(value) < 1.0:
            continue  # a guard has its own word on those
        if fine:
            gate(order)
            continue
        with pytest.raises(LimitExceeded, match="nothing was sent") as refusal:
            gate(order)
        assert ("expected" in str(refusal.value)) is (low is not None and high is not None)


def test_the_limits_of_a_device_hold_inside_the_bounds_of_a_guard() -> None:
    line = known()
    for to in (-0.3, 0.3):
        assert line.reason(place(to, low=-0.2, high=0.2)) == "limits"
    assert line.reason(place(0.2, low=-0.2, high=0.2)) == ""


# --- the quick way, and the long one --------------------------------------------------------------------------------


def test_the_last_thing_that_was_heard_counts_on_every_way() -> None:
    line = known()
    assert line.reason(place(0.1)) == ""
    line.now += 0.1
    line.reads(n1=0.4)
    assert line.reason(place(-0.2)) == "step"
    line.now += 0.4 + FRESH / 2
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=(place(0.4),))) == [QUESTION]
    line.reads(n1=0.4)
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=(place(0.4),))) == []
    line.reads(n1=2.0)
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=(place(0.4),))) == [QUESTION]
    assert line.reason(place(0.4)) == "suspect"


def test_what_is_known_of_one_is_not_of_another_that_was_not_heard() -> None:
    line = Line(1, 2)
    line.reads(n1=0.0)
    both = (place(0.1), place(0.1, node=2))
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=both)) == [QUESTION]
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=(place(0.1, node=9), both[1]))) == [
        QUESTION
    ]
    assert line.reason(*both) == "stale"


def test_an_answer_that_tells_of_many_is_read_once() -> None:
    line, read = Line(1, 2, 3), []

    def where(answer: Answer) -> dict[int, float]:
        read.append(answer)
        return dict.fromkeys((1, 2, 3), 0.0)

    exchange: Exchange[Any] = Exchange(b"?", tells_position=where)
    for _ in range(2):
        line.now += 0.1
        line.seen.update(dict.fromkeys((1, 2, 3), (exchange, Answer((), (), line.now))))
        assert line.reason(*(place(0.1, node) for node in (1, 2, 3))) == ""
    assert len(read) == 2


def test_of_what_has_no_end_a_number_that_would_be_a_fine_place_says_nothing() -> None:
    line = known()
    line.gate.attended = True
    assert line.reason(goal("velocity", 0.1)) == "unattended"
    assert line.reason(goal("velocity", 0.0)) == ""
    assert known().reason(goal("relative", 0.6)) == "step"
    bounded = known(bounds=Bounds(-9.0, 9.0, 9.0, 1.0))
    bounded.now += 0.1
    bounded.reads(n1=3.0)
    assert bounded.reason(goal("speed", 3.0)) == "limits"


def test_it_asks_whom_an_order_for_everyone_reaches_and_each_once() -> None:
    line, asked = Line(1, 2), []

    def ask() -> Exchange[Answer]:
        asked.append(2)
        return QUESTION

    line.gate.guards[2] = Guard("n2", Bounds(), ask=ask)
    line.reads(n1=0.0)
    everyone: Exchange[Answer] = Exchange(b"", effect=Effect.MOTION, goals=(place(0.1),), lane=EVERY_LANE)
    assert line.gate.look(everyone) == [QUESTION]
    twice = (place(0.1, node=2), place(0.2, node=2))
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=twice)) == [QUESTION]
    assert asked == [2, 2]


def test_it_asks_nobody_who_cannot_tell_or_goes_to_no_place_or_has_just_told() -> None:
    line = Line(1, 2)
    line.reads(n1=0.0)
    line.gate.guards[3] = Guard("of nobody", Bounds())
    for order in (goal("velocity", 0.5, node=2), place(0.1, node=3), place(0.1)):
        orders = (place(0.1, node=9), order)
        assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=orders)) == []


# --- whom it tells --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("goals", "told"),
    [
        ([place(0.1)], [(1, True)]),
        ([place(0.1), place(0.1, node=2)], [(1, True), (2, True)]),
        ([place(0.1), goal("speed", 0.5)], [(1, True)]),
        ([goal("position", 0.1, stays=Stays.STILL)], []),
        ([torque_on(2)], [(2, False)]),
        ([place(0.1, node=9)], []),
    ],
)
def test_each_is_told_once_of_what_it_was_ordered(goals: list[Goal], told: list[tuple[int, bool]]) -> None:
    line = known(1, 2)
    assert line.reason(*goals) == ""
    assert line.told == told


def test_an_order_for_everyone_is_told_to_everyone_and_judged_for_each() -> None:
    line = Line(1, 2)
    line.reads(n1=0.0)
    assert line.reason(place(0.1), lane=EVERY_LANE) == "stale"
    assert line.told == []
    line.reads(n1=0.0, n2=0.0)
    assert line.reason(place(0.1, node=9), goal("speed", 0.5, node=9), lane=EVERY_LANE) == ""
    assert line.told == [(1, True), (2, True)]


def test_nobody_is_told_of_what_is_refused_rehearsed_or_not_begun_yet() -> None:
    line = known()
    assert line.reason(place(0.6)) == "step"
    rehearsal = line.gate.rehearsing()
    for order in (place(0.1), goal("relative", 0.1)):
        rehearsal(Exchange(b"", effect=Effect.MOTION, goals=(order,)))
        assert line.reason(order, later=Later(1)) == ""
    assert line.reason(goal("velocity", 0.5), later=Later(1)) == ""
    assert line.told == []
    assert not line.gate.goes_on(1)


def test_only_what_has_no_end_goes_on() -> None:
    line = known()
    for order in (goal("relative", 0.1), place(0.2), goal("velocity", 0.0), goal("speed", 0.5)):
        assert line.reason(order) == ""
        assert not line.gate.goes_on(1)
    assert line.reason(goal("velocity", 0.5)) == ""
    assert line.gate.goes_on(1)


def test_one_of_which_nobody_keeps_account_by_readings_is_told_that_it_leaves() -> None:
    line, left = Line(), []
    line.gate.guards[1] = line.guard(1, Bounds(-1.0, 1.0), measures=False, leaves=lambda: left.append(1))
    line.reads(n1=0.0)
    assert line.reason(goal("relative", 0.1)) == line.reason(place(0.5)) == ""
    assert line.gate.look(Exchange(b"", effect=Effect.MOTION, goals=(place(0.5),))) == []
    assert left == [1, 1]
    assert line.reason(goal("relative", 2.1)) == "limits"
    assert left == [1, 1]


# --- what waits -----------------------------------------------------------------------------------------------------


def begins(node: int | None = 1) -> Later:
    return Later(node, begins=True)


def test_what_waits_is_judged_already_when_it_gives_torque_or_moves() -> None:
    for effect in (Effect.TORQUE, Effect.MOTION):
        line = known()
        line.gate.faults[1] = "gone"
        assert line.reason(place(0.1), effect=effect, later=Later(1)) == "fault"


def test_what_is_handed_over_without_an_effect_is_known_to_wait_also_where_nobody_counts_stops() -> None:
    line = known()
    line.gate.watch(line.seen, lambda: line.now)
    assert line.reason(place(0.1), effect=Effect.NONE, later=Later(1)) == ""
    assert line.told == []
    assert line.reason(later=begins()) == ""
    assert line.told == [(1, True)]
    bare = Gate()
    bare.guards[1] = line.gate.guards[1]
    bare(Exchange(b"", effect=Effect.NONE, later=Later(1)))


def test_a_fault_of_whom_it_is_handed_to_counts_though_nothing_else_names_him() -> None:
    line = Line()
    line.gate.faults[1] = "gone"
    assert line.reason(effect=Effect.TORQUE, later=Later(1), replies=ANY) == "fault"
    assert line.reason(effect=Effect.TORQUE, later=Later(2), replies=ANY) == ""
    assert line.reason(effect=Effect.TORQUE, later=Later(None), replies=ANY) == ""
    assert line.reason(effect=Effect.TORQUE, replies=(Due(1, 1, 6),)) == "fault"


@pytest.mark.parametrize("bounded", ["guard", "fault", "attended", "lease"])
def test_where_anything_bounds_what_moves_it_must_be_known_what_begins(bounded: str) -> None:
    line = Line()
    line.gate.guards.clear()
    assert line.reason(place(0.1), later=begins()) == ""
    if bounded == "guard":
        line.gate.guards[2] = line.guard(2, Bounds())
    line.gate.faults.update({2: "gone"} if bounded == "fault" else {})
    line.gate.attended = bounded == "attended"
    line.gate.lease = Lease(None) if bounded == "lease" else None
    assert line.reason(place(0.1), later=begins()) == "unknown"


@pytest.mark.parametrize(("node", "whom"), [(1, "wait in node 1, so"), (None, "anybody on this bus")])
def test_it_says_of_whom_nothing_is_known(node: int | None, whom: str) -> None:
    with pytest.raises(Refused, match=whom) as caught:
        Line().gate(Exchange(b"", effect=Effect.MOTION, later=begins(node)))
    assert caught.value.node == node


def test_a_stop_takes_back_what_was_handed_over_before_it_and_nothing_since() -> None:
    line = known()
    line.stops[1] = 3
    handed = Later(1)
    assert line.reason(place(0.1), later=handed) == ""
    handed.done = True
    assert line.reason(later=begins()) == "", "it was told to begin, and nobody knows whether it heard"
    assert line.reason(later=begins()) == ""
    line.stops[1] = 4
    assert line.reason(later=begins()) == line.reason(later=begins(None)) == "stopped"


def test_a_line_that_was_cut_leaves_nothing_known() -> None:
    line = known(1, 2)
    assert line.reason(place(0.1), later=Later(1)) == line.reason(place(0.1, node=2)) == ""
    line.gate.forget()
    assert line.reason(later=begins()) == "unknown"
    line.seen.clear()
    assert line.reason(place(0.1)) == line.reason(place(0.1, node=2)) == "stale"


# --- who may move ---------------------------------------------------------------------------------------------------


def test_an_order_of_which_only_a_part_stays_is_one_that_moves() -> None:
    line = known(1, 2)
    still = goal("position", 0.0, node=2, stays=Stays.STILL)
    line.gate.faults[1] = "gone"
    assert line.reason(still, place(0.1)) == "fault"
    assert line.reason(still) == ""
    assert line.reason(still, place(0.1), rank=Rank.STOP) == ""


def test_nobody_need_attend_where_nobody_asks_for_it() -> None:
    line = known()
    line.gate.guards[1] = Guard("of nobody", Bounds())
    assert line.reason(goal("velocity", 0.5)) == ""
    line.gate.guards.clear()
    line.gate.attended = True
    assert line.reason(goal("velocity", 0.5)) == "unattended"
    assert line.reason(goal("velocity", 0.0)) == ""


def test_who_attends_does_so_by_the_time_of_the_robot() -> None:
    line = Line()
    line.gate.origin, line.gate.attended = 9.0, True
    line.gate.lease = lease = Lease(0.5)
    lease.take("page", 0.9, attended=True)
    assert line.reason(goal("velocity", 0.5)) == ""


def test_everyone_is_ordered_what_is_said_first() -> None:
    line = known()
    order = (place(0.1, node=2), goal("time", 0.5, node=2))
    line.gate.guards[1] = line.guard(1, Bounds(-1.0, 0.05))
    assert line.reason(*order, lane=EVERY_LANE) == "limits"


@pytest.mark.parametrize(
    ("more", "fine"),
    [
        ([], False),
        ([goal("speed", 0.5)], True),
        ([goal("speed", 0.0)], True),
        ([goal("speed", 0.5, node=2)], False),
        ([goal("speed", 0.5), goal("time", 0.5)], False),
        ([goal("speed", 0.5), goal("time", 0.0)], True),
        ([goal("speed", 0.5), goal("time", 0.5, node=2)], True),
        ([goal("time", 0.0)], False),
        ([goal("time", 0.5)], False),
    ],
)
def test_far_it_goes_at_once_only_with_a_speed_and_no_time_of_its_own(more: list[Goal], fine: bool) -> None:
    line = known(bounds=Bounds(speed=1.0))
    assert line.reason(place(3.0), *more) == ("" if fine else "velocity")
