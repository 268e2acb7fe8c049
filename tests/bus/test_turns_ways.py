"""What turns do in corners: claims that are given up, windows, groups with a silent member, what a gate is told."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Timer
from motorbus.core.goal import Later
from motorbus.core.operation import CanFrame, Due, Effect, Exchange, Listen, Notice, Rank, Tune
from motorbus.errors import Interrupted, LinkLost, Refused, RequestError
from motorbus.families.feetech import wire
from tests.bus.lanes import GOAL, POSITION, READ, CanScript, frame, move, read, said
from tests.bus.script import Script, position, positions, reply


def claimed(script: Script, owner: object) -> Claim:
    claim = Claim(owner)
    script.turns.submit(claim, script.now)
    return claim


def order(effect: Effect, rank: Rank = Rank.POLL, later: Later | None = None) -> Exchange[Any]:
    return Exchange(
        wire.write(1, 40, b"\0"), (Due(1, 1, 6),), effect=effect, rank=rank, later=later, repeatable=True
    )


# --- who has it alone -----------------------------------------------------------------------------------------------


def test_a_claim_that_was_given_up_is_never_granted() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    script.turns.abandon(second)
    script.turns.release(first)
    assert script.turns.idle
    script.submit(position(1))
    assert script.sent()[2] == 1


def test_who_has_the_bus_and_gives_up_leaves_it_to_the_next() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    script.turns.abandon(first)
    assert script.send() is None
    assert second.done


def test_a_change_of_rate_that_has_no_turn_holds_up_nobody_who_has() -> None:
    script = Script()
    claimed(script, "a")
    script.turns.submit(Retune(Tune(500_000), "b", None), script.now)
    script.submit(position(1, rank=Rank.CONFIGURATION), "a")
    assert script.sent()[2] == 1


# --- how many at once -----------------------------------------------------------------------------------------------


def test_no_more_fly_than_the_window_allows_though_their_lanes_are_free() -> None:
    script = CanScript(window=2)
    for node in (1, 2, 3):
        script.submit(read(node))
    assert script.sent() == [1, 2]
    script.feed(said(1, READ, POSITION, 11))
    assert script.sent() == [3]


def test_a_bus_is_free_at_the_very_moment_when_the_bits_have_passed() -> None:
    script = Script(paced=True)
    for parameters in ((), (7,)):
        script.submit(Exchange(wire.action(*parameters)))
    script.sent()
    assert script.send() is None
    script.now = script.turns.due()
    assert script.now == script.turns.free_at < inf
    assert script.sent() == wire.action(7)


@pytest.mark.parametrize("paced", [True, None])
def test_the_short_path_waits_for_bits_only_where_they_surely_take_time(paced: bool | None) -> None:
    script = Script(paced=paced)
    script.submit(Exchange(wire.action()))
    script.sent()
    assert script.turns.idle
    assert script.now < script.turns.free_at
    went = script.turns.short(Flight(position(1)), script.now)
    assert (went is None) is bool(paced)


def test_what_was_handed_out_and_never_written_is_no_success() -> None:
    """An interrupt fell in between."""
    script = Script()
    flight = script.submit(Exchange(wire.action()))
    assert script.turns.send(script.now) == wire.action()
    assert script.turns.send(script.now) is None
    assert isinstance(flight.error, Interrupted)


def test_what_is_done_before_its_turn_leaves_the_queue_unsent() -> None:
    script = Script()
    flight = script.submit(position(1))
    flight.finish()
    assert script.send() is None
    assert script.turns.idle


# --- groups with somebody who is silent -----------------------------------------------------------------------------


def silent(script: Script, node: int) -> Any:
    """This node was probed in vain: its trust."""
    trust = script.turns.trust.of(node)
    trust.tainted = True
    script.turns.trust.stayed_silent(node, script.now, 0.01)
    return trust


def test_a_group_of_two_goes_without_the_one_who_is_silent_until_he_is_to_be_probed_again() -> None:
    for at_once in (True, False):
        script = Script()
        trust = silent(script, 2)
        group = positions(1, 2)
        script.submit(group)
        script.now += 0.0 if at_once else trust.probe_at - script.now
        assert (script.sent() == group.request) is at_once


def test_in_a_group_only_who_was_silent_is_left_out() -> None:
    script = Script()
    trust = silent(script, 2)
    trust.silent = 0  # it has answered since, and was damaged again
    group = positions(1, 2)
    script.submit(group)
    assert script.sent() != group.request


def test_one_by_himself_is_probed_however_silent_he_was() -> None:
    script = Script()
    silent(script, 2)
    script.submit(position(2))
    assert script.sent() != position(2).request


# --- what a gate is told --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("exchange", "told"),
    [
        (order(Effect.NONE), False),
        (order(Effect.NONE, later=Later(1)), True),
        (order(Effect.MOTION), True),
        (order(Effect.TORQUE), True),
        (order(Effect.TORQUE, Rank.STOP), False),
        (order(Effect.TORQUE, Rank.STOP, Later(1)), False),
    ],
)
def test_a_gate_is_told_of_what_moves_and_of_what_waits_and_of_no_stop(
    exchange: Exchange[Any], told: bool
) -> None:
    heard: list[object] = []
    script = Script(admit=heard.append)
    script.submit(exchange)
    script.sent()
    assert heard == [exchange] * told


def test_without_a_gate_what_waits_goes_and_what_moves_does_not() -> None:
    for exchange, goes in ((order(Effect.NONE, later=Later(1)), True), (order(Effect.MOTION), False)):
        script = Script(admit=None)
        flight = script.submit(exchange)
        assert (script.send() is not None) is goes
        assert isinstance(flight.error, RequestError) is not goes


def test_what_an_order_refuses_by_itself_no_gate_is_asked() -> None:
    heard: list[object] = []
    script = Script(admit=heard.append)
    refused: Exchange[Any] = Exchange(
        b"\x01",
        (Due(1, 1, 6),),
        effect=Effect.MOTION,
        refusal=lambda _: Refused("it was told to let go", reason="stopped"),
    )
    flight = script.submit(refused)
    assert script.send() is None
    assert isinstance(flight.error, Refused)
    assert heard == []


# --- the ends -------------------------------------------------------------------------------------------------------


def test_half_a_packet_of_the_old_rate_does_not_swallow_a_reply_of_the_new_one() -> None:
    script = Script()
    script.turns.feed([b"\xff\xff\x01\x30\x00"], script.now)
    script.turns.retuned(Retune(Tune(500_000), None, None))
    assert script.turns.rate == 500_000
    flight = script.submit(position(1))
    script.sent()
    script.feed(reply(1))
    assert flight.done
    assert not script.turns.statistics.other


def test_who_has_heard_enough_is_asked_no_more() -> None:
    script, asked = Script(), []

    def hears(notice: Notice) -> bool:
        asked.append(notice)
        return True

    listener = Listener(Listen(hears, 1.0), None, None)
    script.turns.submit(listener, script.now)
    listener.finish()
    script.turns._take(Notice(1, "x", b""), script.now)
    assert asked == []


def test_an_emergency_stop_holds_where_a_node_was_just_seen_to_be() -> None:
    script = CanScript()
    script.submit(move(1, 500))
    script.submit(read(2))
    script.sent()
    script.feed(said(2, READ, POSITION, 22), after=0.0)
    frames = script.turns.latch(script.now)
    requests = [exchange.request for exchange in frames.exchanges]
    assert frame(1, READ, POSITION) in requests, "nobody knows where it is by now"
    assert [one for one in requests if isinstance(one, CanFrame) and one.data[1] == GOAL] == [
        move(2, 22).request
    ]


def test_an_emergency_stop_leaves_nothing_awaited_and_says_why() -> None:
    script = Script()
    claimed(script, "a")
    timer, other = Timer(), claimed(script, "b")
    timer.deadline = script.now + 1.0
    script.turns.submit(timer, script.now)
    script.turns.latch(script.now)
    for ended in (timer, other):
        with pytest.raises(Interrupted, match="emergency stop is latched"):
            ended.result()
    assert script.turns.due() == inf
    assert other not in script.turns._claims.waiting


def test_what_a_lost_link_still_owes_is_known_when_it_comes_late() -> None:
    script = Script()
    script.submit(positions(1, 2))
    script.sent()
    script.turns.lost(LinkLost("gone"))
    for node in (1, 2):
        assert script.turns.trust.of(node).quiet_until > script.now
        script.feed(reply(node))
    assert script.turns.statistics.other == {"late": 2}


def test_whoever_gives_the_bus_back_hands_it_to_the_next_at_once() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    script.turns.release(first)
    assert second.done


def test_of_a_lost_link_nobody_gets_later_what_he_waited_for() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    handed = script.submit(Exchange(wire.action()), "a")
    assert script.turns.send(script.now) == wire.action()
    script.turns.lost(LinkLost("gone"))
    for ended in (second, handed):
        assert isinstance(ended.error, LinkLost)
    assert not script.turns.leaving
    script.turns.release(first)
    assert script.turns.idle
