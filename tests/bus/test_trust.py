"""Taint belongs to a node, and only an accepted reply takes it off."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from motorbus.bus.trust import ATTEMPTS, EQUAL_RUN, FORGOTTEN_AFTER, LONGEST_BACK_OFF, Trust
from motorbus.core.operation import Due, Exchange
from motorbus.families.feetech import FAMILY
from motorbus.families.kst import FAMILY as KST
from motorbus.families.kst.wire import encode_upload, upload_due
from motorbus.families.stepper import FAMILY as STEPPER
from tests.bus.script import position

DUE = Due(1, 1, 8)
QUIET = 0.04


def asked() -> Trust:
    trust = Trust(FAMILY)
    trust.ask(position(1), 10.0)
    return trust


def test_asking_taints_before_anything_else() -> None:
    assert asked().of(1).tainted


def test_an_accepted_reply_clears_and_a_missed_one_does_not() -> None:
    trust = asked()
    trust.believe(DUE, barrier=False)
    assert not trust.of(1).tainted
    trust.ask(position(1), 11.0)
    trust.missed(0, DUE, 11.0, QUIET)
    trust.ask(position(1), 11.1)
    trust.believe(DUE, barrier=False)
    assert trust.of(1).tainted, "one reply is still outstanding; only a probe vouches for the node"
    trust.believe(DUE, barrier=True)
    assert not trust.of(1).tainted


def test_a_probe_never_has_the_shape_of_an_outstanding_reply() -> None:
    trust = asked()
    shapes = set()
    for _ in range(12):
        probe = trust.probe(1, 10.0)
        assert isinstance(probe.replies, tuple)
        due = probe.replies[0]
        assert (due.key, due.length) not in shapes
        assert due.length != len(probe.request), "its echo must differ from its answer"
        shapes.add((due.key, due.length))
        trust.missed(0, due, 10.0, QUIET)


def test_an_old_request_is_forgotten() -> None:
    trust = asked()
    trust.missed(0, DUE, 10.0, QUIET)
    trust.probe(1, 10.0 + FORGOTTEN_AFTER + 0.1)
    assert not trust.of(1).outstanding


def test_a_late_reply_is_known_once_and_by_its_lane() -> None:
    trust = asked()
    trust.missed(0, DUE, 10.0, QUIET)
    assert not trust.late(1, 1, 8)
    assert not trust.late(0, 1, 9)
    assert trust.late(0, 1, 8)
    assert not trust.late(0, 1, 8)


def test_doubt_falls_on_those_asked_within_the_quiet_time() -> None:
    trust = Trust(FAMILY)
    for node, at in ((1, 10.0), (2, 10.5)):
        trust.ask(position(node), at)
        trust.believe(Due(node, node, 8), barrier=False)
    trust.doubt(10.51, QUIET)
    assert not trust.of(1).tainted
    assert trust.of(2).tainted
    assert trust.of(2).quiet_until == 10.51 + QUIET


def test_doubt_about_one_lane_leaves_the_others_alone() -> None:
    trust = Trust(FAMILY)
    for node in (1, 2):
        trust.ask(Exchange(b"\x01", (Due(node, node, 8),), lane=node), 10.0)
        trust.believe(Due(node, node, 8), barrier=False)
    trust.doubt(10.01, QUIET, lane=2)
    assert (trust.of(1).tainted, trust.of(2).tainted) == (False, True)


def test_more_doubt_does_not_put_the_probe_off() -> None:
    trust = asked()
    trust.missed(0, DUE, 10.0, QUIET)
    trust.doubt(10.03, QUIET)
    assert trust.of(1).quiet_until == 10.0 + QUIET


def test_a_silent_node_is_probed_ever_less_often() -> None:
    trust = asked()
    waits = []
    for _ in range(10):
        trust.stayed_silent(1, 10.0, QUIET)
        waits.append(trust.of(1).probe_at - 10.0)
    assert waits == sorted(waits)
    assert waits[-1] == LONGEST_BACK_OFF


def test_many_equal_replies_on_can_must_be_vouched_for_by_a_probe() -> None:
    trust = Trust(KST)
    due = upload_due(0x25, 0x6002)
    exchange: Exchange[object] = Exchange(encode_upload(0x25, 0x6002), (due,), lane=0x25)
    for _ in range(EQUAL_RUN - 1):
        trust.ask(exchange, 1.0)
        trust.believe(due, barrier=False)
        assert not trust.of(0x25).tainted
    trust.ask(exchange, 1.0)
    trust.believe(due, barrier=False)
    assert trust.of(0x25).tainted
    trust.believe(upload_due(0x25, 0x3000), barrier=True)
    assert not trust.of(0x25).tainted


def looked_for(trust: Trust, attempt: int, outstanding: dict[Any, float]) -> Exchange[bool]:
    """The probe that is found by looking at one after the other: the first that is free, else the oldest."""
    oldest: tuple[float, Exchange[bool]] | None = None
    for number in range(attempt, attempt + ATTEMPTS):
        probe = trust.family.probe(1, number % ATTEMPTS)
        due = probe.replies[0]  # type: ignore[index]  # a probe has exactly one reply
        asked_at = outstanding.get((probe.lane, due.key, due.length))
        if asked_at is None:
            return probe
        if oldest is None or asked_at < oldest[0]:
            oldest = asked_at, probe
    assert oldest is not None
    return oldest[1]


@pytest.mark.parametrize("family", [FAMILY, KST, STEPPER])
@given(
    st.lists(
        st.tuples(
            st.sampled_from(("miss",) * 12 + ("late", "believe", "lost", "old")),
            st.sampled_from((0.0, 0.02, 0.3, 2.0)),
        ),
        max_size=150,
    )
)
@example([("miss", 0.02)] * 150)
@example([("miss", 0.0)] * 150)
def test_a_probe_is_the_one_that_looking_at_all_would_find(
    family: Any, steps: list[tuple[str, float]]
) -> None:
    trust, now = Trust(family), 10.0
    for what, later in steps:
        now += later
        one = trust.of(1)
        fresh = {kind: at for kind, at in one.outstanding.items() if now - at <= FORGOTTEN_AFTER}
        wanted = looked_for(trust, one.attempt, fresh)
        probe = trust.probe(1, now)
        assert one.outstanding == fresh
        assert (probe.request, probe.replies, probe.lane) == (wanted.request, wanted.replies, wanted.lane)
        due = probe.replies[0]  # type: ignore[index]  # a probe has exactly one reply
        if what == "late":
            trust.late(probe.lane, due.key, due.length)
        elif what == "believe":
            trust.believe(due, barrier=True)
        elif what == "lost":
            trust.doubt_everyone(now, QUIET)
        else:
            trust.missed(probe.lane, due, now - (1.0 if what == "old" else 0.0), QUIET)
