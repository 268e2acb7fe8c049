"""Others on the bus while a straight flight is in the air: who polls the same servo, and who stops it."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any

import pytest

from motorbus.bus import loosed, straight
from motorbus.bus.loosed import Loosed
from motorbus.bus.pump import Bus
from motorbus.core.operation import Data
from motorbus.errors import MotorbusError
from motorbus.link.base import Delivery, Side
from tests.bus.struck import FAULTS, Struck, kept, order, struck_bus
from tests.conftest import Figures, Rounds


def together(*calls: Any, within: float = 60) -> list[BaseException]:
    """Call these in threads of their own, each of which has to end within so many s; what went wrong in them."""
    wrong: list[BaseException] = []

    def carry_out(call: Any) -> None:
        try:
            call()
        except BaseException as error:
            wrong.append(error)

    threads = [threading.Thread(target=carry_out, args=(call,), daemon=True) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(within)
    assert not any(thread.is_alive() for thread in threads)
    return wrong


def no_silence(bus: Bus) -> None:
    for ledger in bus.statistics.nodes.values():
        assert not ledger.errors["silence"]
        assert ledger.sent == ledger.ok + sum(ledger.errors.values())


def test_threads_that_poll_one_servo_get_its_values_and_nobody_is_called_silent(rounds: Any) -> None:
    bus, _, _ = struck_bus(virtual=False)
    one, group = kept(1), kept(1, 2, 3)
    count = rounds(5_000, 100)

    def poll(exchange: Any, expected: Any) -> None:
        for _ in range(count):
            assert bus.run(exchange) == expected

    alone: Any = ([(1, 0, 1, 0)], ())
    all_: Any = ([(node, 0, node, 0) for node in (1, 2, 3)], ())
    calls = [(one, alone), (one, alone), (kept(1), alone), (group, all_)]
    wrong = together(*(lambda call=call: poll(*call) for call in calls))
    assert wrong == []
    no_silence(bus)
    assert bus.statistics.nodes[1].ok >= 4 * count
    bus.close()


class Changing(Struck):
    """What servo 1 tells is the number of the request that it answers; every so many-th time its reply is struck.

    Now and then it is silent for so long that whoever asks gives up.
    """

    EVERY, SILENT, LONG = 17, 150, 6

    def __init__(self, memory: Any) -> None:
        super().__init__()
        self.memory = memory
        self.heard = self.struck = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.heard += 1
            self.memory[57] = self.heard % 251
            if self.heard % self.EVERY == 0:
                self.fault = ONCE[self.heard // self.EVERY % len(ONCE)]
                self.struck += 1
            if self.EVERY < self.SILENT and self.heard % self.SILENT < self.LONG:
                self.fault = "drop"
                self.struck += 1
        return super().carry(sender, data, at)


ONCE = [fault for fault in FAULTS if fault != "echo"]
"""A line does not begin to echo of a sudden and cease again."""


class Launches:
    """Counts what leaves by the straight way."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.straight = 0
        launched = straight.launched_now

        def counted(*given: Any) -> Any:
            course = launched(*given)
            self.straight += course is not None
            return course

        monkeypatch.setattr(straight, "launched_now", counted)


@pytest.mark.timeout(600)
def test_l16_two_threads_that_share_one_kept_exchange_get_values_true_inside_their_call_and_errors_of_their_own(
    rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, simulator, _ = struck_bus(virtual=False)
    line = bus.link.line = Changing(simulator.memory[1])  # type: ignore[attr-defined]
    shared, left = kept(1), Launches(monkeypatch)
    count = rounds(20_000, 200)
    told: list[BaseException] = []
    wrong: list[str] = []

    def poll(rest: float) -> None:
        asked = 0
        # how often they meet is the affair of the machine, so they go on, and one of them rests in between
        while asked < count or (left.straight < count / 10 and asked < 100 * count):
            if asked >= count:
                time.sleep(rest)
            asked += 1
            before = line.heard
            try:
                (((_, _, _, value),), _) = bus.run(shared)
            except MotorbusError as error:
                told.append(error)
                continue
            true = [number % 251 for number in range(before + 1, line.heard + 1)]
            if value not in true:
                wrong.append(f"{value}, and it was one of {true}")

    assert together(partial(poll, 0.0), partial(poll, 0.005), within=rounds(580, 60)) == []
    ledger = bus.statistics.nodes[1]
    assert wrong == []
    assert line.struck >= 2 * count // Changing.EVERY
    assert len({id(error) for error in told}) == len(told), "nobody is told what another one was told"
    assert ledger.sent == ledger.ok + sum(ledger.errors.values())
    assert len(told) + ledger.retries <= sum(ledger.errors.values())
    assert told
    assert left.straight >= count / 10, f"{left.straight} have left by the straight way"
    assert not bus.turns.waiting
    assert bus.relay.pumper is None
    line.EVERY = 1 << 30
    assert bus.run(shared) == ([(1, 0, 1, line.heard % 251)], ())
    figures(
        "L16 two threads that share one exchange, the straight way", family="feetech", reads=2 * count,
        faults=line.struck, wrong=len(wrong), failed=len(told), straight=left.straight,
    )  # fmt: skip
    bus.close()


class Held(Struck):
    """A line on which the next answer stays until somebody lets it go, or the next request is under way."""

    def __init__(self) -> None:
        super().__init__()
        self.holds = False
        self.asked = threading.Event()
        self.stopped = threading.Event()

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE and self.holds:
            self.holds = False
            self.asked.set()
            return [Delivery(at + 0.01, Side.HOST, data)]
        return super().carry(sender, data, at)


def test_a_stop_from_another_thread_gets_past_what_is_in_the_air() -> None:
    bus, simulator, _ = struck_bus(virtual=False)
    line = bus.link.line = Held()  # type: ignore[attr-defined]
    exchange = kept(1, 2)
    bus.run(order())  # from now on there is a stop thread
    for _ in range(5):
        bus.run(exchange)
    stopped: list[Any] = []

    def poll() -> None:
        line.holds = True
        bus.run(exchange)

    def stop() -> None:
        assert line.asked.wait(20)
        stopped.append(bus.estop())

    wrong = together(poll, stop)
    (outcome,) = stopped
    assert set(outcome.acknowledged) == {1, 2, 3, 4, 5, 6}
    assert outcome.silent == ()
    assert all(isinstance(error, MotorbusError) for error in wrong)
    assert bus.relay.pumper is None
    bus.reset()
    for node in (1, 2):
        simulator.memory[node][57] = 99
    assert bus.run(exchange) == ([(1, 0, 1, 99), (2, 0, 2, 99)], ())
    bus.close()


def test_a_latched_bus_lets_no_order_through_straight() -> None:
    bus, _, line = struck_bus()
    exchange = kept(1, 2)
    for _ in range(3):
        bus.volley(order(), exchange)
    bus.estop()
    line.sent.clear()
    with pytest.raises(MotorbusError, match="stop"):
        bus.run(order())
    with pytest.raises(MotorbusError, match="stop"):
        bus.volley(order(), exchange)
    assert line.sent == []


def test_who_was_interrupted_takes_nothing_from_who_lets_the_same_loose_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Between letting go of the bus and raising another thread may have its turn."""
    bus, _, _ = struck_bus()
    question = kept(1)
    for _ in range(6):
        bus.run(question)
    others: list[Loosed] = []
    recover, landed = bus.relay.recover, straight.brought

    def anothers_turn() -> None:
        recover()
        if not others:
            assert together(lambda: bus.run(question), lambda: others.append(Loosed(bus, (question,)))) == []

    def struck(*given: Any) -> None:
        landed(*given)
        raise KeyboardInterrupt

    mine = Loosed(bus, (question,))
    monkeypatch.setattr(bus.relay, "recover", anothers_turn)
    monkeypatch.setattr(loosed, "brought", struck)
    with pytest.raises(KeyboardInterrupt):
        mine.land()
    monkeypatch.undo()
    assert others[0].land() == [([(1, 0, 1, 0)], ())]
