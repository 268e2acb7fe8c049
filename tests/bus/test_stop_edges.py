"""The parts of an emergency stop one by one: its thread, its rounds, and who counts as having obeyed."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from motorbus.bus import obedience, stop
from motorbus.bus.known import FRESH
from motorbus.bus.pump import Bus
from motorbus.bus.stop import BREATH, Stopper, _listening
from motorbus.bus.ticket import Flight
from motorbus.core.operation import ANY, Answer, Due, Effect, Exchange, Operation, Pause, Rank
from motorbus.errors import DeviceError, LinkLost, NoReply
from motorbus.families.feetech import wire
from tests.bus.lanes import can_bus, move, read
from tests.bus.responder import memory_bus, position


def torque_off(node: int = 1, **options: Any) -> Exchange[Answer]:
    return Exchange(
        wire.write(node, 40, b"\0"), (Due(node, node, 6),), effect=Effect.TORQUE, rank=Rank.STOP, **options
    )


@pytest.fixture
def real() -> Iterator[Bus]:
    """A bus in real time, which has a stop thread once it is wanted."""
    bus, _ = memory_bus(virtual=False)
    yield bus
    bus.close()


def stopper(**options: Any) -> Stopper:
    return memory_bus(**options)[0].stopper


# --- the thread -----------------------------------------------------------------------------------------------------


def test_the_thread_is_ready_when_start_returns_and_does_not_keep_the_process(real: Bus) -> None:
    real.stopper.start()
    thread = real.stopper._thread
    assert thread is not None
    assert thread.daemon
    assert thread.is_alive()
    assert real.stopper._ready.is_set()
    real.stopper.start()
    assert real.stopper._thread is thread


def test_there_is_no_thread_in_virtual_time_nor_after_the_end(real: Bus) -> None:
    virtual = stopper()
    virtual.start()
    assert virtual._thread is None
    real.close()
    real.stopper.start()
    assert real.stopper._thread is None


def test_who_triggers_a_stop_after_the_end_hears_nothing(real: Bus) -> None:
    real.stopper.start()
    real.close()
    real.stopper.trigger()


def test_a_thread_that_gives_no_sign_is_told_as_that(real: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    real.run(position(1))
    real.stopper.start()
    with monkeypatch.context() as patched, real.turns.lock:
        patched.setattr(stop, "PATIENCE", 0.02)
        outcome = real.estop()
    assert outcome == ((), (1,), 0, "nothing: the stop thread gave no sign")


def test_whatever_an_interrupt_leaves_held_is_let_go() -> None:
    bus, _ = memory_bus()
    bus.run(position(1))
    latch, cut = bus.turns.latch, [True]

    def interrupted(now: float) -> Any:
        if cut.pop() if cut else False:
            bus.turns.lock.acquire()
            raise KeyboardInterrupt
        return latch(now)

    bus.turns.latch = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        bus.stopper.stop()
    assert bus.turns.latched
    got: list[bool] = []
    other = Thread(target=lambda: got.append(bus.turns.lock.acquire(blocking=False)))
    other.start()
    other.join()
    assert got == [True]


def test_where_there_are_no_local_sockets_nobody_is_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(socket, "AF_UNIX")
    with _listening(tmp_path / "x", lambda: None) as listener:
        assert listener is None


# --- rounds ---------------------------------------------------------------------------------------------------------


def test_a_stop_that_everyone_obeys_takes_no_longer_than_its_frames() -> None:
    bus, _ = can_bus(pace=True)
    for node in (1, 2):
        bus.run(read(node))
    begun = bus.link.now()
    assert bus.estop().acknowledged == (1, 2)
    assert bus.link.now() - begun < BREATH / 2


def test_who_has_obeyed_has_accepted_to_stop_and_who_is_silent_has_not() -> None:
    bus, responder = memory_bus()
    for node in (1, 2):
        bus.run(position(node))
    responder.dead = {2}
    before = [bus.turns.known.accepts(node) for node in (1, 2)]
    assert bus.estop().acknowledged == (1,)
    after = [bus.turns.known.accepts(node) for node in (1, 2)]
    assert after[0] > before[0]
    assert after[1] == before[1]


def test_a_round_lasts_longer_by_the_time_of_each_of_its_frames() -> None:
    one = stopper()
    took = one._time(torque_off())
    flights: list[Flight] = []
    assert one._submit([torque_off(1), torque_off(2)], flights, 100.0) == pytest.approx(100.0 + 2 * took)
    assert [flight.done for flight in flights] == [False, False]
    family, rate = one.turns.family, one.turns.rate
    least = family.air_time(torque_off(), rate) + family.turnaround(torque_off())
    assert took > least
    one.turns.latency += 0.25
    assert one._time(torque_off()) == pytest.approx(took + 0.25)


@pytest.mark.parametrize(
    ("error", "gone", "again"),
    [
        (None, None, True),
        (NoReply("silent"), None, True),
        (LinkLost("gone"), None, False),
        (LinkLost("gone"), LinkLost("gone"), True),
    ],
)
def test_over_a_link_that_is_gone_for_good_nothing_is_sent_again(
    error: Exception | None, gone: LinkLost | None, again: bool
) -> None:
    one = stopper()
    flight = Flight(torque_off())
    flight.error, one.turns.gone = error, gone
    assert one._may_come(flight) is again


# --- who has said where it is ---------------------------------------------------------------------------------------


def test_a_node_that_has_said_where_it_is_is_held_there() -> None:
    bus, _ = can_bus(pace=True)
    bus.run(read(1))
    (frame,) = bus.stopper._following(Flight(read(1)))
    assert frame.request == move(1, 100).request
    assert frame.effect is Effect.MOTION


def test_a_node_that_has_not_said_where_it_is_is_not_asked_in_the_same_round() -> None:
    bus, _ = can_bus(pace=True)
    bus.run(read(1))
    assert bus.stopper._following(Flight(read(2))) == []
    failed = Flight(read(1))
    failed.error = NoReply("silent")
    assert bus.stopper._following(failed) == []


def test_for_a_question_that_nobody_in_particular_answers_no_frames_are_made() -> None:
    bus, _ = can_bus(pace=True)
    bus.run(read(1))
    made = len(bus.turns.family.stops)  # type: ignore[attr-defined]
    assert bus.stopper._following(Flight(Exchange(read(1).request, ANY))) == []
    assert len(bus.turns.family.stops) == made  # type: ignore[attr-defined]


def test_a_node_whose_position_has_grown_old_meanwhile_is_not_asked_in_the_same_round() -> None:
    bus, _ = can_bus(pace=True)
    bus.run(read(1))

    def wait() -> Operation[None]:
        yield from Pause(FRESH + 1.0)

    bus.run(wait())
    assert bus.stopper._following(Flight(read(1))) == []


def test_what_goes_to_everyone_does_not_follow_an_answer_of_one() -> None:
    bus, _ = memory_bus()
    bus.run(position(1))
    following = bus.stopper._following(Flight(position(1)))
    assert [obedience.nodes(one) for one in following] == [[1]]


def test_a_family_that_fails_in_the_middle_of_a_stop_is_asked_again_in_the_next_round() -> None:
    def fails(nodes: object) -> Any:
        raise ZeroDivisionError

    bus, _ = can_bus(pace=True)
    bus.run(read(1))
    bus.turns.family.stop = fails  # type: ignore[method-assign]
    assert bus.stopper._following(Flight(read(1))) == []


# --- who counts -----------------------------------------------------------------------------------------------------


def refuses(_: Answer) -> Any:
    raise DeviceError("no")


def answered(exchange: Exchange[Any]) -> Flight:
    flight = Flight(exchange)
    flight.finish(Answer((), (), 0.0))
    return flight


def test_only_an_answer_that_does_not_refuse_settles_a_frame() -> None:
    one = stopper()
    assert one._settled(answered(torque_off()))
    assert not one._settled(answered(torque_off(read=refuses)))
    assert not one._settled(answered(Exchange(wire.write(254, 40, b"\0"), effect=Effect.TORQUE)))
    assert not one._settled(answered(Exchange(wire.ping(254, broadcast=True), ANY)))
    failed = Flight(torque_off())
    failed.finish(error=NoReply("silent"))
    assert not one._settled(failed)


def test_what_is_not_answered_by_the_end_of_a_round_is_given_up() -> None:
    one = stopper()
    flight = Flight(torque_off())
    one.turns.submit(flight, one.link.now())
    assert not one._settled(flight)
    assert flight.abandoned
    assert not one.turns.waiting
    done = answered(torque_off())
    one._settled(done)
    assert not done.abandoned


def test_who_must_give_two_kinds_of_reply_has_obeyed_with_both_and_counts_once() -> None:
    both = [Flight(torque_off()), Flight(move(1, 5))]
    asks = Flight(read(1))
    everyone = Flight(Exchange(wire.write(254, 40, b"\0"), ANY, effect=Effect.TORQUE))
    flights = [*both, asks, everyone]
    assert obedience.obeyed(flights, [asks], []) == [1]
    assert obedience.obeyed(flights, [both[1]], []) == []
    assert obedience.obeyed(flights, [], [1]) == []
    assert obedience.obeyed([asks, everyone], [], []) == []
