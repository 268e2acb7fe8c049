"""The queue: who goes first, when a request may leave, what a stop does to it."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Timer
from motorbus.bus.turns import RETRIES
from motorbus.core.operation import (
    ANY,
    Due,
    Effect,
    Exchange,
    Listen,
    Notice,
    Rank,
    Tune,
)
from motorbus.errors import Interrupted, LimitExceeded, LinkLost, NoReply, OutcomeUnknown, RequestError
from motorbus.families.feetech import wire
from tests.bus.script import Script, admit_all, ping, position, positions, reply


def write(node: int, *, effect: Effect = Effect.NONE, rank: Rank = Rank.POLL, repeatable: bool = True) -> Any:
    return Exchange(
        wire.write(node, 40, b"\0"), (Due(node, node, 6),), effect=effect, rank=rank, repeatable=repeatable
    )


def test_one_exchange_at_a_time_in_the_order_asked() -> None:
    script = Script()
    first, second = script.submit(position(1)), script.submit(position(2))
    assert script.sent() == wire.read(1, 56, 2)
    assert script.send() is None
    script.feed(reply(1, 1304))
    assert first.done
    assert first.result().replies[0].data == reply(1, 1304)
    assert script.sent() == wire.read(2, 56, 2)
    script.feed(reply(2))
    assert second.done


def test_the_higher_rank_goes_first() -> None:
    script = Script()
    for rank in (Rank.CONFIGURATION, Rank.POLL, Rank.CONTROL, Rank.STOP):
        script.submit(position(1 + rank, rank=rank))
    order = []
    for _ in Rank:
        order.append(script.sent()[2] - 1)
        script.feed(reply(order[-1] + 1))
    assert order == [Rank.STOP, Rank.CONTROL, Rank.POLL, Rank.CONFIGURATION]


def test_an_exchange_without_reply_is_done_when_sent() -> None:
    script = Script()
    flight = script.submit(Exchange(wire.action()))
    assert script.sent() == wire.action()
    assert flight.done
    assert flight.result().replies == ()


def test_every_reply_that_comes_belongs_to_any() -> None:
    script = Script()
    flight = script.submit(Exchange(wire.ping(254, broadcast=True), ANY))
    script.sent()
    script.feed(wire.encode_status(1, 0), wire.encode_status(4, 0))
    assert not flight.done
    script.time_out()
    assert [r.key for r in flight.result().replies] == [1, 4]


def test_silence_is_tried_again_only_after_a_probe_was_answered() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    script.time_out()
    assert not flight.done
    script.clear(1)
    assert script.sent() == wire.read(1, 56, 2)
    script.feed(reply(1, 7))
    assert flight.result().replies[0].data == reply(1, 7)
    assert script.turns.statistics.of(1).retries == 1


def test_a_silent_node_fails_without_further_tries() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    script.time_out()
    script.wait(script.turns.family.quiet_time(1_000_000))
    script.sent()  # the probe
    script.time_out()
    with pytest.raises(NoReply, match="node 1 did not answer"):
        flight.result()


def test_noise_is_retried_no_more_than_it_says() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    bad = reply(1)[:-1] + b"\0"
    requests = 0
    while not flight.done:
        script.feed(bad)
        script.time_out()
        if flight.done:
            break
        script.send()
        script.wait(script.turns.family.quiet_time(1_000_000))
        requests += 1
        script.sent()
    assert requests <= 2 * RETRIES
    with pytest.raises(Exception, match="damaged"):
        flight.result()


def test_what_must_not_be_repeated_is_not_and_its_outcome_is_unknown() -> None:
    script = Script()
    flight = script.submit(write(1, repeatable=False))
    script.sent()
    script.time_out()
    with pytest.raises(OutcomeUnknown, match="not known"):
        flight.result()
    assert script.send() is None


def test_a_dead_node_does_not_hold_the_others() -> None:
    script = Script()
    dead = script.submit(position(1))
    alive = script.submit(position(2))
    script.sent()
    script.time_out()
    assert script.sent() == wire.read(2, 56, 2), "the other goes while the first is left alone"
    script.feed(reply(2))
    assert alive.done
    assert not dead.done


def test_a_group_does_not_wait_for_a_node_known_to_be_silent() -> None:
    script = Script()
    first = script.submit(positions(1, 2, 3))
    script.sent()
    script.feed(reply(1) + reply(3))
    script.time_out()
    assert first.result().missing == (2,)
    second = script.submit(positions(1, 2, 3))
    assert script.send() is None, "node 2 gets its quiet time and its probe, once"
    script.wait(script.turns.family.quiet_time(1_000_000))
    assert script.sent()[2] == 2
    script.time_out()
    assert script.sent() == wire.sync_read(56, 2, (1, 2, 3))
    script.feed(reply(1) + reply(3))
    assert second.done, "complete at once, without waiting for the deadline"
    assert second.result().missing == (2,)


def test_a_group_believes_a_node_again_after_its_probe() -> None:
    script = Script()
    script.submit(positions(1, 2))
    script.sent()
    script.feed(reply(1))
    script.time_out()
    flight = script.submit(positions(1, 2))
    script.clear(2)
    script.sent()
    script.feed(reply(1) + reply(2, 99))
    answer = flight.result()
    assert answer.missing == ()
    assert answer.replies[1].data == reply(2, 99)


def test_a_scan_takes_silence_for_an_answer() -> None:
    script = Script()
    for node in (1, 2):
        flight = script.submit(ping(node))
        script.sent()
        script.time_out()
        assert flight.error is not None
    again = script.submit(ping(1))
    assert script.sent() == wire.ping(1), "no quiet time, no probe"
    script.feed(wire.encode_status(1, 0))
    assert again.error is None


def test_alone_lets_only_its_owner_send() -> None:
    script = Script()
    mine, theirs = object(), object()
    claim = Claim(mine)
    script.turns.submit(claim, script.now)
    assert claim.done
    script.submit(position(1), theirs)
    assert script.send() is None
    script.submit(position(2), mine)
    assert script.sent()[2] == 2
    script.feed(reply(2))
    assert script.send() is None
    script.turns.release(claim)
    assert script.sent()[2] == 1


def test_alone_waits_for_what_is_in_the_air_and_holds_back_the_rest() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    claim = Claim(object())
    script.turns.submit(claim, script.now)
    script.submit(position(2))
    assert not claim.done
    script.feed(reply(1))
    assert claim.done
    assert script.send() is None


def test_a_timer_ends_at_its_moment_and_a_listener_at_its_notice() -> None:
    script = Script()
    timer, listener = Timer(), Listener(Listen(lambda n: n.kind == "end", 1.0), None, None)
    timer.deadline, listener.deadline = script.now + 0.5, script.now + 1.0
    script.turns.submit(timer, script.now)
    script.turns.submit(listener, script.now)
    script.wait(0.49)
    assert not timer.done
    script.wait(0.01)
    assert timer.done
    assert timer.value == script.now
    script.turns._take(Notice(1, "other", b""), script.now)
    assert not listener.done
    script.turns._take(Notice(1, "end", b""), script.now)
    assert listener.value == Notice(1, "end", b"", script.now)
    assert script.turns.due() == inf


def test_the_rate_changes_when_nothing_is_in_the_air() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    retune = Retune(Tune(500_000), None, None)
    script.turns.submit(retune, script.now)
    assert script.send() is None
    script.feed(reply(1))
    assert script.send() is retune
    assert script.turns.rate == 1_000_000, "not before the link has taken it"
    script.turns.retuned(retune)
    assert script.turns.rate == 500_000
    assert retune.value == 1_000_000


def test_without_a_gate_nothing_moves_and_with_one_it_decides() -> None:
    script = Script(admit=None)
    flight = script.submit(write(1, effect=Effect.TORQUE))
    assert script.send() is None
    with pytest.raises(RequestError, match="no gate"):
        flight.result()

    def refuse(exchange: Exchange[Any]) -> None:
        raise LimitExceeded("no")

    script = Script(admit=refuse)
    flight = script.submit(write(1, effect=Effect.MOTION))
    assert script.send() is None
    assert isinstance(flight.error, LimitExceeded)


def test_an_emergency_stop_drops_the_queue_and_refuses_motion_until_reset() -> None:
    script = Script()
    flying, queued = script.submit(position(1)), script.submit(position(2))
    lock = script.submit(write(3, effect=Effect.PERSISTENT))
    script.sent()
    script.turns.latch(script.now)
    assert isinstance(flying.error, Interrupted)
    assert isinstance(queued.error, Interrupted)
    assert not lock.done, "what closes a lock follows the stop"
    refused = script.submit(write(1, effect=Effect.MOTION))
    assert isinstance(refused.error, Interrupted)
    script.time_out()
    assert script.send() is None, "nothing but the stop may go now"
    stop = script.submit(write(1, effect=Effect.TORQUE, rank=Rank.STOP))
    assert script.sent() == stop.exchange.request
    script.feed(wire.encode_status(1, 0))
    script.turns.stopped()
    assert script.sent() == lock.exchange.request
    script.feed(wire.encode_status(3, 0))
    script.turns.reset()
    script.submit(write(1, effect=Effect.MOTION))
    script.clear(1)  # the exchange the stop cut short left node 1 in doubt


def test_a_stop_waits_at_most_for_the_rest_of_the_reply() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    before = script.now
    script.turns.latch(script.now)
    script.submit(write(1, effect=Effect.TORQUE, rank=Rank.STOP))
    assert script.send() is None
    script.time_out()
    script.sent()
    assert script.now - before < 0.001


def test_a_late_acknowledgement_is_not_taken_for_that_of_the_stop() -> None:
    script = Script()
    script.submit(write(1, repeatable=False))
    script.sent()
    script.time_out()
    stop = script.submit(write(1, effect=Effect.TORQUE, rank=Rank.STOP))
    script.sent()
    script.feed(wire.encode_status(1, 0))
    assert not stop.done, "this one answers the first write"
    script.feed(wire.encode_status(1, 0))
    assert stop.done


def test_a_lost_link_fails_everything() -> None:
    script = Script()
    flights = [script.submit(position(1)), script.submit(position(2))]
    script.sent()
    timer = Timer()
    script.turns.submit(timer, script.now)
    script.turns.lost(LinkLost("gone"))
    assert all(isinstance(ticket.error, LinkLost) for ticket in [*flights, timer])
    assert script.turns.idle


def test_the_short_path_is_only_for_an_idle_bus_and_a_clean_node() -> None:
    script = Script()
    flight = Flight(position(1))
    assert script.turns.short(flight, script.now) == wire.read(1, 56, 2)
    assert script.turns.short(Flight(position(2)), script.now) is None
    script.time_out()
    script.turns._queues[Rank.POLL].clear()
    assert script.turns.short(Flight(position(1)), script.now) is None, "node 1 is tainted"
    assert script.turns.short(Flight(position(2)), script.now) is not None


def test_an_abandoned_exchange_keeps_the_line_until_it_lands() -> None:
    script = Script(admit=admit_all)
    flight = script.submit(position(1))
    script.sent()
    script.turns.abandon(flight)
    script.submit(position(2))
    assert script.send() is None
    script.feed(reply(1))
    assert script.sent()[2] == 2
