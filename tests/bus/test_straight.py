"""The straight way and the usual way are the same way: same bytes, same values and errors, same doubts, same counts."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.bus import loosed, pump, volley
from motorbus.bus.loosed import Loosed
from motorbus.bus.pump import Bus
from motorbus.bus.trust import GROUP_RUN
from motorbus.core.operation import UNLIKE, Answer, Operation, Tune, Unlike
from motorbus.errors import MotorbusError
from tests.bus.responder import position
from tests.bus.struck import FAULTS, Landings, kept, one_behind_the_other, order, passing, struck_bus

Step = tuple[str, str, float]
VOLLEYS = (
    *("volley group", "volley one", "loosed group", "loosed one"),
    *("behind group", "behind one", "later group", "later one", "between overlap", "between inside"),
)
READS = {
    "one": (1,),
    "two": (2,),
    "five": (5,),
    "group": (1, 2, 3),
    "overlap": (2, 3, 4),
    "inside": (2, 1),
    "disjoint": (4, 5),
    "far": (6, 5),
}


def said(call: Any) -> Any:
    try:
        return call()
    except MotorbusError as error:
        return type(error), str(error)


def test_what_nobody_answers_takes_its_time_at_the_rate_of_now() -> None:
    bus, _, _ = struck_bus()
    for rate in (1_000_000, 1_000_000, 500_000, 500_000, 1_000_000):
        bus.run(iter(Tune(rate)))
        bus.run(kept(1))
        for _ in range(2):
            free = max(bus.turns.free_at, bus.link.now())
            bus.run(order())
            assert bus.turns.free_at == pytest.approx(free + bus.family.air_time(order(), rate), abs=1e-12)
            free = max(bus.turns.free_at, bus.link.now())
            bus.volley(order(), kept(1))
            assert bus.turns.free_at == pytest.approx(free + bus.family.air_time(order(), rate), abs=1e-12)


def known_of(bus: Bus) -> Any:
    """All that anybody can see of a bus."""
    nodes = {
        node: (one.sent, one.ok, one.retries, dict(one.errors), list(one.latency))
        for node, one in bus.statistics.nodes.items()
    }
    trust = {
        node: (one.tainted, one.length, one.run, [*one.outstanding], one.silent)
        for node, one in bus.turns.trust.nodes.items()
    }
    known, now = bus.turns.known, bus.link.now()
    seen = {node: plain(answer) for node, (_, answer) in known.seen.items()}
    heard = {node: plain(answer) for node, answer in known.items()}
    fresh = {node: plain(answer) for node, answer in known.fresh(now).items()}
    return nodes, trust, seen, heard, fresh, dict(bus.statistics.other), known.rate, round(now, 9)


def plain(answer: Answer | None) -> Any:
    """What an answer says, whoever made it."""
    return None if answer is None else (round(answer.at, 9), answer.replies, answer.missing)


def carried_out(steps: list[Step], *, looks: bool = False) -> Any:
    """What came of each step, all that left, and what is known in the end; or after each step."""
    bus, simulator, line = struck_bus(start=100.0)
    reads: dict[str, Any] = {name: kept(*nodes) for name, nodes in READS.items()}
    reads["plain"], told = position(1), []
    for number, (what, fault, rest) in enumerate(steps):
        line.fault = fault
        for node, memory in simulator.memory.items():
            memory[57] = (number + node) % 251  # an answer to an older question has another value
        if (
            what == "look, cast"
        ):  # a cast alone does not look at the line: what is left over is seen a little later
            told.append(said(lambda: bus.run(position(6))))
        if what.endswith("cast"):
            told.append(said(lambda: bus.run(order())))
        elif what.startswith("volley"):
            told.append(said(lambda read=what[7:]: bus.volley(order(), reads[read])))
        elif what.startswith("loosed"):
            told.append(said(lambda read=what[7:]: Loosed(bus, (order(), reads[read])).land()))
        elif what.startswith("behind"):
            bus.turns.passes = passing
            told.append(said(lambda read=what[7:]: one_behind_the_other(bus, reads[read])))
        elif what.startswith("later"):
            bus.turns.passes = passing
            told.append(said(lambda read=what[6:]: one_behind_the_other(bus, reads[read], inf)))
        elif what.startswith("between"):
            bus.turns.passes = passing
            told.append(
                said(lambda read=what[8:]: one_behind_the_other(bus, reads[read], inf, reads["group"]))
            )
        else:
            told.append(said(lambda what=what: bus.run(reads[what])))
        bus.link.advance(rest)  # type: ignore[attr-defined]
        if looks:
            told.append(known_of(bus))
    return told, line.sent, known_of(bus)


def never(*_: Any) -> Unlike:
    return UNLIKE


def nothing(*_: Any) -> None:
    return None


def usually(steps: list[Step], **options: Any) -> Any:
    """The same without the straight way."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((pump, "fly"), (pump, "cast"), (volley, "fly")):
            patch.setattr(module, name, never)
        patch.setattr(loosed, "_loose", nothing)
        return carried_out(steps, **options)


def compare(steps: list[Step], **options: Any) -> None:
    for one, other in zip(carried_out(steps, **options), usually(steps, **options), strict=True):
        assert one == other


STEPS = st.lists(
    st.tuples(
        st.sampled_from((*READS, *READS, "plain", "look, cast", *VOLLEYS, "volley far")),
        st.sampled_from(("",) * 2 * len(FAULTS) + FAULTS),
        st.sampled_from((0.0, 0.0, 0.001, 0.1)),
    ),
    min_size=1,
    max_size=24,
)


@given(STEPS)
def test_both_ways_are_the_same(steps: list[Step]) -> None:
    compare(steps)


@given(STEPS)
def test_both_ways_are_the_same_whenever_somebody_looks(steps: list[Step]) -> None:
    compare(steps, looks=True)


CLEAN = st.lists(st.sampled_from((*READS, "cast", *VOLLEYS)), min_size=1, max_size=12)


@given(CLEAN, st.integers(1, 3 * GROUP_RUN))
def test_loops_of_groups_and_single_ones_are_the_same(cycle: list[str], cycles: int) -> None:
    compare([(what, "", 0.001) for what in cycle] * cycles)


@pytest.mark.parametrize(
    "cycle",
    [
        ("group",),
        ("group", "overlap"),
        ("group", "disjoint"),
        ("two", "group", "five"),
        ("group", "one", "disjoint", "five", "inside"),
        ("volley group", "volley far", "one"),
        ("loosed group", "loosed far", "one"),
        ("behind group",),
        ("later group",),
        ("between overlap",),
    ],
)
def test_groups_go_straight_and_take_turns_with_their_other_form(
    cycle: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = [(what, "", 0.001) for what in cycle] * (3 * GROUP_RUN)
    landings = Landings(monkeypatch)
    straight = carried_out(steps)
    reads = [what for what in cycle if what != "cast"] * 3 * GROUP_RUN
    # The first of a kind may find that the bus has still to be looked at.
    assert len(landings.ids) >= len(reads) - len(set(cycle)) - 2
    groups = [what for what in reads if len(READS[what.split()[-1]]) > 1]
    assert len(landings.groups) >= len(groups) - len(set(cycle)) - 2
    assert {8, 9} <= set(landings.lengths)
    before = len(landings.ids)
    assert usually(steps) == straight
    assert len(landings.ids) == before


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("at", [GROUP_RUN - 1, GROUP_RUN, GROUP_RUN + 1, GROUP_RUN + 2])
def test_a_fault_beside_the_change_of_form_is_met_the_same_way(fault: str, at: int) -> None:
    steps = [("group", "", 0.0)] * 3 * GROUP_RUN
    steps[at] = ("group", fault, 0.0)
    compare(steps)


def test_who_was_heard_at_another_rate_is_stopped_at_that_one() -> None:
    def tuned() -> Operation[None]:
        yield Tune(500_000)

    bus, _, _ = struck_bus()
    read = kept(1)
    for _ in range(3):
        bus.run(read)
    bus.run(tuned())
    for _ in range(3):
        bus.run(read)
    assert bus.turns.known.rate == 500_000


@pytest.mark.parametrize("nodes", [(1,), (1, 2, 3)])
def test_an_answer_that_waited_for_a_host_that_was_held_up_is_as_old_on_both_ways(
    nodes: tuple[int, ...],
) -> None:
    def found() -> Any:
        bus, _, _ = struck_bus(start=100.0)
        link: Any = bus.link
        exchange, read = kept(*nodes), link.read
        for _ in range(3):
            bus.run(exchange)

        def held_up(until: float) -> Any:
            arrived = read(until)
            if arrived:
                link.read = read
                link.advance(2.0)
            return arrived

        link.read = held_up
        return bus.run(exchange), known_of(bus)[2:5]

    straight = found()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pump, "fly", never)
        assert straight == found()


@pytest.mark.timeout(1800)
def test_the_same_at_length(rounds: Any) -> None:
    from random import Random

    random = Random(10)
    for _ in range(rounds(20_000, 20)):
        names = random.choices((*READS, "plain", "look, cast", "volley group", *VOLLEYS[2:]), k=4)
        faults = ("",) * 4 * len(FAULTS) + FAULTS
        compare(
            [(random.choice(names), random.choice(faults), random.choice((0.0, 0.03))) for _ in range(60)]
        )
