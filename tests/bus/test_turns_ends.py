"""A change of rate, a link that is lost, what is tried again, and who hears a notice: the ends that turns can take."""

from __future__ import annotations

from math import inf
from typing import Any

from motorbus.bus.ticket import Claim, Flight, Listener, Retune, Timer
from motorbus.core.operation import Due, Effect, Exchange, Listen, Notice, Rank, Timeout, Tune
from motorbus.errors import Interrupted, LinkLost, RequestError
from motorbus.families.feetech import wire
from tests.bus.lanes import CanScript, read
from tests.bus.script import Script, ping, position, positions, reply


def torque(node: int, *, rank: Rank = Rank.POLL, effect: Effect = Effect.TORQUE) -> Any:
    return Exchange(wire.write(node, 40, b"\0"), (Due(node, node, 6),), effect=effect, rank=rank)


def claimed(script: Script, owner: object) -> Claim:
    claim = Claim(owner)
    script.turns.submit(claim, script.now)
    return claim


# --- another rate ---------------------------------------------------------------------------------------------------


def test_a_rate_that_is_there_already_is_no_change() -> None:
    script = Script()
    for tune in (Tune(1_000_000), Tune(0)):
        retune = Retune(tune, None, None)
        script.turns.submit(retune, script.now)
        assert script.send() is None
        assert retune.value == 1_000_000
        assert not script.turns.waiting


def test_to_listen_only_is_a_change_and_ends_with_the_next() -> None:
    script = Script()
    quiet, loud = (Retune(Tune(1_000_000, listen_only=only), None, None) for only in (True, False))
    for retune, listening in ((quiet, True), (loud, False)):
        script.turns.submit(retune, script.now)
        assert script.send() is retune
        script.turns.retuned(retune)
        assert script.turns.listening is listening
        flight = script.submit(position(1))
        assert (script.send() is None) is listening
        assert isinstance(flight.error, RequestError) is listening
        assert not (listening and script.turns.waiting)


def test_a_bus_that_was_opened_to_listen_goes_on_listening_at_another_rate() -> None:
    script = Script(listen_only=True)
    retune = Retune(Tune(500_000), None, None)
    script.turns.submit(retune, script.now)
    assert script.send() is retune
    script.turns.retuned(retune)
    assert script.turns.listening
    same = Retune(Tune(500_000), None, None)
    script.turns.submit(same, script.now)
    assert script.send() is None
    assert same.done


def test_half_a_reply_of_the_old_rate_is_forgotten_at_the_new_one() -> None:
    script = Script()
    script.turns.feed([b"\xff\xff\x01\x80"], script.now)
    retune = Retune(Tune(500_000), None, None)
    script.turns.retuned(retune)
    flight = script.submit(position(1))
    script.sent()
    script.feed(reply(1))
    assert flight.done
    assert flight.result().replies[0].data == reply(1)


def test_a_link_that_refuses_keeps_its_rate() -> None:
    script = Script()
    retune = Retune(Tune(500_000, listen_only=True), None, None)
    script.turns.retuned(retune, LinkLost("gone"))
    assert (script.turns.rate, script.turns.listening) == (1_000_000, False)
    assert isinstance(retune.error, LinkLost)


def test_nothing_of_its_queue_takes_off_before_a_change_of_rate_and_what_was_given_up_holds_up_nobody() -> (
    None
):
    script = CanScript(window=3)
    script.submit(read(1, rank=Rank.CONFIGURATION))
    assert script.sent() == [1]
    retune = Retune(Tune(250_000), None, None)
    script.turns.submit(retune, script.now)
    script.submit(read(2, rank=Rank.CONFIGURATION))
    assert script.turns.send(script.now) is None
    retune.finish()
    assert script.sent() == [2]


def test_a_change_of_rate_that_has_no_turn_holds_up_nobody_who_has() -> None:
    script = CanScript(window=3)
    script.turns.submit(Claim("a"), script.now)
    script.turns.submit(Retune(Tune(250_000), None, None), script.now)
    script.submit(read(2, rank=Rank.CONFIGURATION), "a")
    assert script.sent() == [2]


def test_no_more_fly_than_the_window_lets_however_many_lanes_are_free() -> None:
    script = CanScript(window=2)
    for node in (1, 2, 3):
        script.submit(read(node))
    assert script.sent() == [1, 2]


# --- listeners ------------------------------------------------------------------------------------------------------


def test_a_notice_is_told_to_listeners_and_to_no_timer() -> None:
    script = Script()
    timer, listener = Timer(), Listener(Listen(lambda _: True, 1.0), None, None)
    for ticket in (timer, listener):
        ticket.deadline = script.now + 1.0
        script.turns.submit(ticket, script.now)
    script.turns._take(Notice(1, "x", b""), script.now)
    assert listener.done
    assert not timer.done
    script.turns._take(Notice(1, "y", b""), script.now)
    assert listener.value.kind == "x"


def test_a_listener_that_fails_fails_alone_and_once() -> None:
    def fails(notice: Notice) -> bool:
        raise ZeroDivisionError

    script = Script()
    listener = Listener(Listen(fails, 1.0), None, None)
    script.turns.submit(listener, script.now)
    script.turns._take(Notice(1, "x", b""), script.now)
    assert isinstance(listener.error, ZeroDivisionError)
    assert script.turns._timers == []


# --- a lost link ----------------------------------------------------------------------------------------------------


def test_a_lost_link_leaves_nothing_behind_and_counts_what_it_cost() -> None:
    script = Script()
    script.submit(positions(1, 2))
    script.sent()
    timer, claim = Timer(), claimed(script, "a")
    timer.deadline = script.now + 1.0
    script.turns.submit(timer, script.now)
    script.turns.lost(LinkLost("gone"))
    assert isinstance(claim.error, LinkLost)
    assert script.turns.due() == inf
    for node in (1, 2):
        assert script.turns.statistics.of(node).errors["lost"] == 1
        assert script.turns.trust.of(node).tainted, "its answer may still come"
        assert script.turns.trust.of(node).quiet_until > script.now
    assert not script.turns.waiting


# --- again ----------------------------------------------------------------------------------------------------------


def test_what_fails_is_tried_twice_more() -> None:
    script = Script()
    flight = Flight(position(2))
    for again in (True, True, False):
        script.turns._failed(flight, "silence", script.now)
        assert flight.done is not again
        assert script.turns.waiting is again
        script.turns._queues[Rank.POLL].clear()
    assert script.turns.statistics.of(2).retries == 2


def test_a_probe_that_comes_damaged_is_asked_twice_more_and_one_that_stays_out_ends_it() -> None:
    for kind, failures in (("checksum", 3), ("silence", 1)):
        script = Script()
        parent = script.submit(position(1))
        for failed in range(1, failures + 1):
            probe = Flight(script.turns.trust.probe(1, script.now), parent=parent)
            probe.noise.append(("checksum", b"\x11"))
            script.turns._failed(probe, kind, script.now)
            assert parent.done is (failed == failures)
            assert bool(script.turns.trust.of(1).silent) is (failed == failures)
        assert parent.noise == [("checksum", b"\x11")]
        assert not script.turns.waiting


def test_a_group_goes_on_without_the_one_whose_probe_stays_out() -> None:
    script = Script()
    parent = script.submit(positions(1, 2))
    probe = Flight(script.turns.trust.probe(1, script.now), parent=parent)
    script.turns._failed(probe, "silence", script.now)
    assert not parent.done
    assert script.turns.waiting


def test_what_is_latched_is_not_tried_again() -> None:
    script = Script()
    flight = script.submit(position(1))
    script.sent()
    script.turns.latched = True
    script.time_out()
    assert flight.done


def test_a_stop_is_not_tried_again() -> None:
    script = Script()
    stop = script.submit(
        Exchange(
            wire.write(1, 40, b"\0"), (Due(1, 1, 6),), effect=Effect.TORQUE, rank=Rank.STOP, repeatable=True
        )
    )
    script.sent()
    script.time_out()
    assert stop.done


def test_a_scan_that_heard_its_own_echo_is_tried_again() -> None:
    script = Script()
    flight = script.submit(ping(1))
    script.sent()
    assert flight.exchange.timeout is Timeout.SCAN
    script.turns.flying.clear()
    script.turns._failed(flight, "echo", script.now)
    assert not flight.done
    assert script.turns.waiting
    flight = Flight(ping(2))
    script.turns._failed(flight, "silence", script.now)
    assert flight.done


def test_a_pair_believes_that_one_is_silent_until_he_is_asked_again() -> None:
    script = Script()
    for probed in (False, True, False):
        flight = script.submit(positions(1, 2))
        if probed:
            assert script.send() is None
            script.wait(script.turns.family.quiet_time(1_000_000))
            assert script.sent()[2] == 2
            script.time_out()
        assert script.sent() == wire.sync_read(56, 2, (1, 2))
        script.feed(reply(1))
        if not flight.done:
            script.time_out()
        assert flight.result().missing == (2,)
    script.now = script.turns.trust.of(2).probe_at
    script.submit(positions(1, 2))
    assert script.sent()[2] == 2


def test_what_was_handed_out_and_perhaps_never_written_is_not_waited_for() -> None:
    """An interrupt fell between the two."""
    script = Script()
    flight = Flight(position(1))
    script.turns.leaving.append(flight)
    assert script.send() is None
    assert isinstance(flight.error, Interrupted)
    assert not script.turns.leaving
