"""The queue in trouble: refusals, rudeness and loss stay with whoever caused them."""

from __future__ import annotations

from typing import Any

from motorbus.bus.ticket import Claim, Listener, Retune
from motorbus.core.operation import ANY, Due, Effect, Exchange, Goal, Listen, Notice, Rank, Tune
from motorbus.errors import LinkLost, NoReply, RequestError
from motorbus.families.feetech import wire
from tests.bus.script import Script, ping, position, reply


def write(node: int, *, effect: Effect = Effect.NONE, rank: Rank = Rank.POLL, repeatable: bool = True) -> Any:
    return Exchange(
        wire.write(node, 40, b"\0"), (Due(node, node, 6),), effect=effect, rank=rank, repeatable=repeatable
    )


def test_a_link_that_refuses_a_rate_fails_the_change_and_nothing_else() -> None:
    script = Script()
    retune = Retune(Tune(500_000), None, None)
    flight = script.submit(position(1))
    script.turns.submit(retune, script.now)
    script.sent()
    script.feed(reply(1))
    assert script.send() is retune
    script.turns.retuned(retune, RequestError("no"))
    assert script.turns.rate == 1_000_000
    assert isinstance(retune.error, RequestError)
    assert flight.error is None


def test_exchanges_that_waited_go_before_the_next_one_alone() -> None:
    script = Script()
    first, second = Claim(object()), Claim(object())
    script.turns.submit(first, script.now)
    script.submit(position(3))
    script.turns.submit(second, script.now)
    script.turns.release(first)
    assert not second.done, "the exchange has waited longer"
    assert script.sent()[2] == 3
    script.feed(reply(3))
    assert second.done


def test_what_a_listener_raises_is_its_own() -> None:
    script = Script()

    def fail(notice: Notice) -> bool:
        raise ZeroDivisionError

    bad, good = Listener(Listen(fail, 1.0), None, None), Listener(Listen(lambda n: True, 1.0), None, None)
    script.turns.submit(bad, script.now)
    script.turns.submit(good, script.now)
    script.turns._take(Notice(1, "end", b""), script.now)
    assert isinstance(bad.error, ZeroDivisionError)
    assert good.value == Notice(1, "end", b"", script.now)


def test_a_write_that_never_left_is_no_unknown_outcome() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    script.time_out()
    flight = script.submit(write(1, repeatable=False))
    script.wait(script.turns.family.quiet_time(1_000_000))
    script.sent()  # the probe
    script.time_out()
    script.send()
    if not flight.done:
        script.time_out()
    assert isinstance(flight.error, NoReply)


def test_a_broadcast_is_not_answered_by_what_was_asked_before() -> None:
    script = Script()
    script.submit(ping(7))
    script.sent()
    script.time_out()
    flight = script.submit(Exchange(wire.ping(254, broadcast=True), ANY))
    script.sent()
    script.feed(wire.encode_status(7, 0), wire.encode_status(1, 0))
    script.time_out()
    assert [r.key for r in flight.result().replies] == [1]


def test_the_ledger_balances_when_the_link_is_lost() -> None:
    script = Script()
    script.submit(position(1))
    script.sent()
    script.turns.lost(LinkLost("gone"))
    ledger = script.turns.statistics.of(1)
    assert ledger.sent == ledger.ok + sum(ledger.errors.values()) == 1


def test_whoever_is_ordered_to_move_is_known_to_the_stop() -> None:
    script = Script()
    script.submit(Exchange(wire.action(), effect=Effect.MOTION, goals=(Goal(9, "position", 0.0, -1.0, 1.0),)))
    script.sent()
    replies = [exchange.replies for exchange in script.turns.known.frames.exchanges]
    assert [due.node for dues in replies if isinstance(dues, tuple) for due in dues] == [9]
