"""Who goes first after a wait, what is no longer awaited, and what the short path leaves to the queue."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Timer
from motorbus.core.goal import Later
from motorbus.core.operation import Due, Effect, Exchange, Listen, Rank, Tune
from motorbus.errors import Interrupted, RequestError
from motorbus.families.feetech import wire
from tests.bus.lanes import POSITION, READ, CanScript, read, said
from tests.bus.script import Script, position, reply


def torque(node: int, *, rank: Rank = Rank.POLL, effect: Effect = Effect.TORQUE) -> Any:
    return Exchange(wire.write(node, 40, b"\0"), (Due(node, node, 6),), effect=effect, rank=rank)


def claimed(script: Script, owner: object) -> Claim:
    claim = Claim(owner)
    script.turns.submit(claim, script.now)
    return claim


# --- one alone, and who waited for him ------------------------------------------------------------------------------


def test_who_waited_for_one_alone_goes_before_the_next_and_who_comes_later_does_not() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    for node in (1, 2):
        script.submit(position(node))
    assert script.send() is None
    script.turns.release(first)
    later = script.submit(position(3))
    for node in (1, 2):
        assert not second.done
        assert script.sent()[2] == node
        script.feed(reply(node))
    assert second.done
    assert script.send() is None
    script.turns.release(second)
    assert script.sent()[2] == 3
    script.feed(reply(3))
    assert later.done


def test_the_first_claim_waits_for_nobody_who_is_only_queued() -> None:
    script = Script()
    script.submit(position(1))
    assert claimed(script, "a").done
    assert script.send() is None


def test_who_has_given_up_meanwhile_is_not_waited_for() -> None:
    script = Script()
    first = claimed(script, "a")
    waiting = script.submit(position(1))
    script.turns.release(first)
    script.turns.abandon(waiting)
    assert claimed(script, "b").done


def test_a_claim_that_is_given_up_lets_the_others_go() -> None:
    script = Script()
    first, second = claimed(script, "a"), claimed(script, "b")
    script.turns.abandon(second)
    assert isinstance(second.error, Interrupted)
    script.submit(position(1))
    script.turns.release(first)
    assert script.sent()[2] == 1
    script.feed(reply(1))
    script.submit(position(2))
    assert script.sent()[2] == 2


def test_who_has_it_and_gives_up_has_it_no_longer() -> None:
    script = Script()
    script.turns.abandon(claimed(script, "a"))
    script.submit(position(1))
    assert script.sent()[2] == 1


def test_a_claim_that_nobody_has_handed_on_is_granted_with_the_next_look() -> None:
    """Whoever was to do it was interrupted."""
    script = Script()
    claim = Claim("a")
    script.turns._claims.waiting.append(claim)
    script.submit(position(1))
    assert script.send() is None
    assert claim.done


def test_a_claim_is_not_granted_while_something_flies() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    claim = claimed(script, "a")
    assert script.send() is None
    assert not claim.done


def test_a_stop_goes_whoever_has_the_bus_alone() -> None:
    script = Script()
    claimed(script, "a")
    script.submit(torque(1, rank=Rank.STOP))
    assert script.sent()[2] == 1


def test_a_stop_goes_before_a_claim_that_waits() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    claim = claimed(script, "a")
    script.submit(torque(2, rank=Rank.STOP))
    script.turns.flying.clear()
    script.turns._claims.waiting.clear()
    script.turns._claims.waiting.append(claim)
    assert script.turns._has_turn(Flight(torque(2, rank=Rank.STOP)))
    assert not script.turns._has_turn(Flight(position(2)))


# --- idle, and the short path ---------------------------------------------------------------------------------------


def test_a_bus_is_idle_when_nothing_waits_nothing_flies_and_nobody_has_it() -> None:
    script = Script()
    assert script.turns.idle
    flight = script.submit(position(1))
    assert not script.turns.idle
    script.sent()
    assert not script.turns.idle
    script.feed(reply(1))
    assert flight.done
    assert script.turns.idle
    claim = claimed(script, "a")
    assert not script.turns.idle
    script.turns.release(claim)
    assert script.turns.idle
    script.turns.latch(script.now)
    assert not script.turns.idle
    script.turns.reset()
    assert script.turns.idle


def test_what_waits_for_one_alone_keeps_the_bus_busy() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    claimed(script, "a")
    script.turns.flying.clear()
    assert not script.turns.idle


def test_the_short_path_takes_no_bus_that_is_anybodys() -> None:
    script = Script()
    claim = claimed(script, "a")
    assert script.turns.short(Flight(position(1)), script.now) is None
    script.turns.release(claim)
    waiting = script.submit(position(2))
    assert script.turns.short(Flight(position(1)), script.now) is None
    script.turns.abandon(waiting)
    assert script.turns.short(Flight(position(1)), script.now) is not None


def test_the_short_path_does_not_speak_where_nobody_may() -> None:
    script = Script(listen_only=True)
    assert script.turns.short(Flight(position(1)), script.now) is None


def test_the_short_path_asks_a_node_again_that_has_answered() -> None:
    script = Script()
    for _ in range(2):
        assert script.turns.short(Flight(position(1)), script.now) is not None
        script.feed(reply(1))


def test_the_short_path_refuses_what_the_gate_refuses() -> None:
    script = Script(admit=None)
    flight = Flight(torque(1))
    assert script.turns.short(flight, script.now) is None
    assert isinstance(flight.error, RequestError)


@pytest.mark.parametrize("paced", [True, False, None])
def test_a_link_that_takes_bit_time_is_free_when_the_bits_have_passed(paced: bool | None) -> None:
    """Over one that may not take it, what follows need not wait."""
    script = Script(paced=paced)
    script.submit(Exchange(wire.action()))
    script.submit(Exchange(wire.action(7)))
    script.sent()
    free = script.turns.free_at
    if paced:
        assert free > script.now
        assert script.send() is None
        assert script.turns.due() == free
        script.turns._queues[Rank.POLL].clear()
        assert script.turns.short(Flight(position(1)), script.now) is None
        script.now = free
        assert script.turns.short(Flight(position(1)), script.now) is not None
    else:
        assert script.sent() == wire.action(7)
        assert script.now < free
        assert script.turns.short(Flight(position(1)), script.now) is not None


def test_bit_time_is_certain_only_where_the_link_says_so() -> None:
    assert Script().turns.pace is None
    shows, says = Script(paced=None).turns.pace, Script(paced=True).turns.pace
    assert shows is not None
    assert says is not None
    assert (shows.certain, says.certain) == (False, True)


# --- no longer awaited ----------------------------------------------------------------------------------------------


def test_what_is_given_up_leaves_the_queue() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.turns.abandon(flight)
    assert not script.turns.waiting
    assert script.turns.idle
    with pytest.raises(Interrupted):
        flight.result()


def test_a_moment_that_is_given_up_is_not_looked_at_and_may_be_given_up_late() -> None:
    script = Script()
    for ticket in (Timer(), Listener(Listen(lambda _: True, 1.0), None, None)):
        ticket.deadline = script.now + 1.0
        script.turns.submit(ticket, script.now)
        assert script.turns.due() == ticket.deadline
        script.turns.abandon(ticket)
        assert script.turns.due() == inf
        script.turns.abandon(ticket)


def test_what_is_refused_while_latched_is_not_queued_and_what_is_done_is_not_taken() -> None:
    script = Script()
    script.turns.latch(script.now)
    script.submit(torque(1))
    assert not script.turns.waiting
    done = Flight(position(1))
    done.finish()
    script.turns.submit(done, script.now)
    assert not script.turns.waiting


def test_what_is_settled_otherwise_leaves_the_queue_with_the_next_look() -> None:
    script = Script()
    script.submit(position(1)).finish()
    assert script.send() is None
    assert not script.turns.waiting


def test_after_a_stop_readings_are_asked_and_movements_refused() -> None:
    script = Script()
    script.turns.latch(script.now)
    script.turns.stopped()
    flight = script.submit(position(1))
    assert flight.error is None
    assert script.sent()[2] == 1


def test_a_stop_takes_back_movements_and_leaves_the_rest() -> None:
    script = Script()
    move, look = script.submit(torque(1, effect=Effect.MOTION)), script.submit(position(1))
    retune = Retune(Tune(500_000), None, None)
    script.turns.submit(retune, script.now)
    script.submit(torque(1, rank=Rank.STOP))
    assert isinstance(move.error, Interrupted)
    assert not look.done
    assert not retune.done


def test_an_emergency_stop_ends_what_is_awaited_and_lets_the_rest_of_a_reply_pass() -> None:
    script = Script(latency=0.005)
    claimed(script, "a")
    flight = script.submit(position(1), "a")
    script.sent()
    timer, other = Timer(), claimed(script, "b")
    timer.deadline = script.now + 9.0
    retune = Retune(Tune(500_000), None, None)
    script.submit(position(2))
    for ticket in (timer, retune):
        script.turns.submit(ticket, script.now)
    due = flight.deadline
    script.turns.latch(script.now)
    for ended in (flight, timer, other):
        assert isinstance(ended.error, Interrupted)
        assert "reset" in f"{ended.error.summary} {ended.error.advice}"
    assert flight.abandoned
    assert script.now + 0.005 < flight.deadline == script.turns.due() <= due
    assert not retune.done
    assert [*script.turns._queues[Rank.POLL]] == []
    assert script.turns._timers == []
    assert other not in script.turns._claims.waiting


def test_an_emergency_stop_has_the_frames_of_the_moment_or_those_before() -> None:
    script = CanScript(window=3)
    script.submit(read(1))
    script.sent()
    script.feed(said(1, READ, POSITION, 7))
    frames = script.turns.latch(script.now)
    assert [one.effect for one in frames.exchanges] == [Effect.MOTION], "held where it was"
    assert script.turns.known.frames is frames
    assert frames.promise == "each holds where it was"

    def fails(nodes: object) -> Any:
        raise ZeroDivisionError

    script.turns.family.stop = fails  # type: ignore[method-assign]
    assert script.turns.latch(script.now) is frames


# --- the gate -------------------------------------------------------------------------------------------------------


def test_a_stop_passes_where_there_is_no_gate() -> None:
    script = Script(admit=None)
    script.submit(torque(1, rank=Rank.STOP))
    assert script.sent()[2] == 1


def test_a_gate_is_told_of_what_will_wait_in_a_device_though_it_moves_nothing_yet() -> None:
    later: Exchange[Any] = Exchange(wire.write(1, 40, b"\0"), (Due(1, 1, 6),), later=Later(1))
    told: list[Any] = []
    script = Script(admit=told.append)
    script.submit(later)
    script.submit(position(2))
    script.sent()
    script.feed(wire.encode_status(1, 0))
    script.sent()
    assert told == [later]
    script = Script(admit=None)
    script.submit(later)
    assert script.sent()[2] == 1
