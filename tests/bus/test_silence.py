"""A silent node that is asked again: its straight way and the usual way are the same way, whatever comes in between."""

from __future__ import annotations

from itertools import count
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from motorbus.bus import relay
from motorbus.bus.pump import Bus
from motorbus.bus.silence import Silence
from motorbus.core.operation import Operation
from motorbus.errors import LinkLost, NoReply
from tests.bus.responder import position
from tests.bus.struck import FAULTS, struck_bus
from tests.bus.test_straight import known_of, said
from tests.bus.test_straight_ends import has_the_lock, in_another_thread, interrupted

Step = tuple[str, int, str, float]
NODES = (1, 2, 30)
"""Two that are there, and one that never was."""


def asked(node: int) -> Operation[int]:
    return (yield from position(node))


def carried_out(steps: list[Step]) -> Any:
    """What came of each step, what is known after it, and all that left."""
    bus, simulator, line = struck_bus(start=100.0)
    told = []
    for what, node, fault, rest in steps:
        line.fault = fault
        if what == "die":
            simulator.dead.add(node)
        elif what == "live":
            simulator.dead.discard(node)
        elif what == "ask":
            told.append(said(lambda node=node: bus.run(position(node))))
        else:
            told.append(said(lambda node=node: bus.run(asked(node))))
        bus.link.advance(rest)  # type: ignore[attr-defined]
        told.append((known_of(bus), probing(bus, node)))
    return told, line.sent


def probing(bus: Any, node: int) -> Any:
    """What is known of a node that must be probed, to the last number."""
    trust = bus.turns.trust.of(node)
    return (
        *(trust.attempt, trust.silent, trust.asked_at, trust.quiet_until, trust.probe_at),
        *(dict(trust.outstanding), bus.turns.settled, dict(bus.turns.flying), bus.relay.pumper),
    )


def usually(steps: list[Step]) -> Any:
    """The same without the straight way."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(relay, "asked_again", lambda *_: False)
        return carried_out(steps)


STEPS = st.lists(
    st.tuples(
        st.sampled_from(("ask", "ask", "ask in an operation", "die", "live")),
        st.sampled_from(NODES),
        st.sampled_from(("",) * len(FAULTS) + FAULTS),
        st.sampled_from((0.0, 0.0, 0.001, 0.1, 6.0)),
    ),
    min_size=1,
    max_size=24,
)


@given(STEPS)
@example([("ask", 30, "", 0.0)] * 90)
@example([("ask", 1, "late", 0.0)] * 4)
def test_both_ways_are_the_same(steps: list[Step]) -> None:
    for one, other in zip(carried_out(steps), usually(steps), strict=True):
        assert one == other


def test_a_silent_node_is_asked_again_on_the_straight_way(monkeypatch: pytest.MonkeyPatch) -> None:
    unanswered: list[bool] = []
    judge = Silence.is_unanswered

    def judged(self: Any, *given: Any) -> bool:
        unanswered.append(judge(self, *given))
        return unanswered[-1]

    monkeypatch.setattr(Silence, "is_unanswered", judged)
    carried_out([("ask", 30, "", 0.0)] * 5)
    assert unanswered == [True] * len(unanswered)
    assert len(unanswered) >= 4


def test_an_answer_that_comes_at_last_is_taken() -> None:
    bus, simulator, _ = struck_bus(start=100.0)
    simulator.dead.add(1)
    for _ in range(3):
        with pytest.raises(NoReply):
            bus.run(position(1))
    simulator.dead.clear()
    assert bus.run(position(1)) == 1
    assert not bus.turns.trust.of(1).tainted


@pytest.mark.parametrize("looks", range(1, 5))
def test_a_link_that_is_lost_at_any_look_fails_what_was_asked(looks: int) -> None:
    bus = silent_bus()
    link: Any = bus.link
    true, left = link.read, [True] * looks

    def gone(until: float) -> Any:
        left.pop()
        if not left:
            raise LinkLost("the adapter was unplugged")
        return true(until)

    link.read = gone
    before = bus.statistics.nodes[30].errors["lost"]
    with pytest.raises(LinkLost, match="unplugged"):
        bus.run(position(30))
    assert not left
    assert not bus.turns.flying
    assert not bus.turns.waiting
    assert bus.relay.pumper is None
    assert bus.statistics.nodes[30].errors["lost"] - before == (looks > 2)


def silent_bus() -> Bus:
    """A bus on which node 30 is known to be silent."""
    bus, _, _ = struck_bus(start=100.0)
    for _ in range(2):
        with pytest.raises(NoReply):
            bus.run(position(30))
    return bus


@pytest.mark.parametrize("ask", [position, asked])
def test_an_interrupt_at_any_line_leaves_the_bus_usable_and_believes_nobody(ask: Any) -> None:
    for at in count(1):
        bus = silent_bus()
        if not interrupted(lambda: said(lambda: bus.run(ask(30))), at):  # noqa: B023 - called at once
            break
        assert bus.relay.pumper is None, f"line {at}"
        assert in_another_thread(lambda: has_the_lock(bus)), f"line {at}"  # noqa: B023 - called at once
        assert bus.turns.trust.of(30).tainted, f"line {at}"
        assert in_another_thread(lambda: bus.run(position(2))) == 2, f"line {at}"  # noqa: B023 - called at once
        with pytest.raises(NoReply):
            bus.run(position(30))
        assert bus.turns.idle, f"line {at}"
    assert at > 100
