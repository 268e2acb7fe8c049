"""What nobody waits for goes on all the same: along with whoever pumps, or in a thread of its own."""

from __future__ import annotations

from threading import Thread
from typing import Any

import pytest

import motorbus
from motorbus.bus.background import Background
from motorbus.bus.crank import crank
from motorbus.bus.run import Run
from motorbus.core.operation import Alone, Operation, Pause, Report, Together
from motorbus.errors import Interrupted, NoReply
from motorbus.families.feetech import Servo


def twice(bus: Any, node: int, found: list[object]) -> Operation[str]:
    """Two questions with a pause between them; what came is kept as well."""
    for _ in range(2):
        found.append((yield from Servo.position.function(Servo(bus, node))))
        yield from Pause(1.0)
    return "done"


def test_whoever_pumps_carries_it_along_and_no_further_than_time_goes() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []
        one = Background(bus, lambda: twice(bus, 1, found))
        one.along()
        assert found == []
        bus.run(iter(Pause(0.5)))
        assert len(found) == 1
        Servo(bus, 2).position()
        bus.run(iter(Pause(2.0)))
        assert len(found) == 2
        assert one.run.result() == "done"
        assert not bus.turns.chores


def test_an_error_of_it_is_nobody_elses() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        sim[1].unplug()
        one = Background(bus, lambda: twice(bus, 1, []))
        one.along()
        for _ in range(3):
            Servo(bus, 2).position()
            bus.run(iter(Pause(0.5)))
        with pytest.raises(NoReply):
            one.run.result()
        assert not bus.turns.chores


def test_a_thread_carries_it_out_by_itself() -> None:
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []
        told: list[str] = []
        thread = Thread(target=lambda: told.append(Background(bus, lambda: twice(bus, 1, found)).carried()))
        thread.start()
        Servo(bus, 1).position()
        thread.join(60)
        assert (told, len(found)) == (["done"], 2)


def test_a_listener_that_uses_the_bus_holds_up_what_reports_to_it() -> None:
    """It pumps, and so it comes by what is waiting for it."""
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        told: list[object] = []

        def listens(event: object) -> None:
            told.append((event, Servo(bus, 2).position()))

        def reports() -> Operation[None]:
            yield from Report("one")
            told.append((yield from Alone(Servo.position.function(Servo(bus, 1)))))
            yield from Report("two")

        one = Background(bus, reports)
        one.run.report = listens
        one.along()
        bus.run(iter(Pause(1.0)))
        found = [Servo(bus, node).position() for node in (1, 2)]
        assert told == [("one", found[1]), found[0], ("two", found[1])]
        assert one.run.root.finished
        assert not bus.turns.chores


@pytest.mark.parametrize("line", [1, 3, 5])
def test_one_more_that_falls_into_what_deals_with_the_first_is_dealt_with(
    line: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with motorbus.simulate("feetech", ids="1-3") as sim, motorbus.open(sim.url) as bus:
        cleaned: list[float] = []
        throw, thrown = Run._throw, iter(range(1, 100))

        def stops() -> Operation[None]:
            try:
                yield from Pause(1e9)
            finally:
                cleaned.append((yield from Servo.position.function(Servo(bus, 3))))

        def struck() -> Operation[None]:
            yield from Pause(1.0)
            raise MemoryError("first")

        begun: list[int] = []

        def both() -> Operation[None]:
            begun.append(1)
            yield from Together([stops(), stops(), struck()] if len(begun) == 1 else [])

        def struck_again(run: Run[None], *given: Any) -> None:
            if next(thrown) == line:
                raise KeyboardInterrupt("second")
            throw(run, *given)

        monkeypatch.setattr(Run, "_throw", struck_again)
        Background(bus, both).along()
        with pytest.raises(MemoryError, match="first"):
            bus.run(iter(Pause(1.5)))
        bus.run(iter(Pause(0.5)))
        assert len(cleaned) == 2


def test_an_emergency_stop_does_not_end_it() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []

        def goes_on() -> Operation[None]:
            while len(found) < 3:
                try:
                    yield from Pause(0.2)
                except Interrupted as error:
                    found.append(error)
                found.append(None)

        one = Background(bus, goes_on)
        one.along()
        bus.run(iter(Pause(0.1)))
        bus.estop()
        bus.run(iter(Pause(1.0)))
        assert one.run.root.finished
        assert len(found) == 3


def test_a_pause_of_it_can_be_ended() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []
        one = Background(bus, lambda: twice(bus, 1, found))
        one.hurry()
        one.along()
        bus.run(iter(Pause(0.1)))
        assert len(found) == 1
        one.hurry()
        bus.run(iter(Pause(0.1)))
        assert len(found) == 2


def test_it_can_be_dropped_before_it_has_begun_and_where_it_pauses() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []
        for told in (0, 1):
            one = Background(bus, lambda: twice(bus, 1, found))
            one.along()
            if told:
                bus.run(iter(Pause(0.1)))
            one.drop()
            one.drop()
            bus.run(iter(Pause(5.0)))
            assert (len(found), bus.turns.chores) == (told, [])


def test_where_it_is_at_work_it_goes_on_when_it_is_dropped() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []

        def asked() -> Operation[None]:
            one.drop()
            found.append((yield from Servo.position.function(Servo(bus, 1))))

        one: Background[None] = Background(bus, asked)
        one.along()
        bus.run(iter(Pause(1.0)))
        assert (len(found), bus.turns.chores) == (1, [])


@pytest.mark.parametrize("beside", [False, True])
def test_an_interruption_that_falls_into_it_is_raised_by_whoever_pumps_and_it_begins_anew(
    beside: bool,
) -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        found: list[str] = []

        def struck() -> Operation[None]:
            yield from Servo.position.function(Servo(bus, 1))
            if len(found) == 1:
                raise KeyboardInterrupt("once")

        def waits() -> Operation[None]:
            try:
                yield from Pause(1.0)
            finally:
                found.append("over")

        def work() -> Operation[None]:
            found.append("begun")
            yield from Together([struck(), waits()]) if beside else struck()

        one = Background(bus, work)
        one.along()
        with pytest.raises(KeyboardInterrupt, match="once"):
            bus.run(iter(Pause(5.0)))
        bus.run(iter(Pause(5.0)))
        assert found == (["begun", "over", "begun", "over"] if beside else ["begun", "begun"])
        assert (one.run.root.error, bus.turns.chores, bus.turns.idle) == (None, [], True)
        assert Servo(bus, 2).position()


def test_one_that_falls_into_a_thread_of_its_own_is_raised_there() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:

        def struck() -> Operation[None]:
            yield from Servo.position.function(Servo(bus, 1))
            raise MemoryError("once")

        def both() -> Operation[None]:
            yield from Together([struck(), iter(Pause(1e9))])

        with pytest.raises(MemoryError, match="once"):
            Background(bus, both).carried()
        assert bus.turns.idle
        assert Servo(bus, 2).position()


def test_one_that_falls_beside_it_into_its_thread_has_it_clean_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Want of memory may fall into the waiting as into the work."""
    with motorbus.simulate("feetech", ids="1", clock="real") as sim, motorbus.open(sim.url) as bus:
        found: list[object] = []
        short = [MemoryError("once")]

        def stopping() -> Operation[str]:
            try:
                return (yield from twice(bus, 1, found))
            finally:
                found.append("cleaned")
                yield from Servo.position.function(Servo(bus, 1))
                found.append("up")

        def without_memory(*given: Any) -> None:
            if found and short:
                raise short.pop()
            crank(*given)

        monkeypatch.setattr("motorbus.bus.background.crank", without_memory)
        with pytest.raises(MemoryError, match="once"):
            Background(bus, stopping).carried()
        assert found[1:] == ["cleaned", "up"]
        assert bus.turns.idle


def test_a_second_interruption_in_what_cleans_up_is_raised_too() -> None:
    """By whoever pumps then: the first one is long raised."""
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        begun: list[int] = []

        def cleans() -> Operation[None]:
            try:
                yield from Pause(1e9)
            finally:
                yield from Pause(0.1)
                raise KeyboardInterrupt("second")

        def struck() -> Operation[None]:
            yield from Pause(1.0)
            raise MemoryError("first")

        def both() -> Operation[None]:
            begun.append(1)
            yield from Together([cleans(), struck()] if len(begun) == 1 else [iter(Pause(1e9))])

        Background(bus, both).along()
        with pytest.raises(MemoryError, match="first"):
            bus.run(iter(Pause(2.0)))
        with pytest.raises(KeyboardInterrupt, match="second"):
            bus.run(iter(Pause(2.0)))
        bus.run(iter(Pause(2.0)))
        assert begun == [1, 1], "and it begins anew"


def test_who_was_dropped_does_not_begin_anew() -> None:
    with motorbus.simulate("feetech", ids="1") as sim, motorbus.open(sim.url) as bus:
        begun: list[None] = []

        def struck() -> Operation[None]:
            begun.append(None)
            yield from Servo.position.function(Servo(bus, 1))
            one.drop()
            raise KeyboardInterrupt("once")

        one = Background(bus, struck)
        one.along()
        with pytest.raises(KeyboardInterrupt, match="once"):
            bus.run(iter(Pause(1.0)))
        bus.run(iter(Pause(1.0)))
        assert (len(begun), bus.turns.chores) == (1, [])


def test_one_that_is_struck_each_time_leaves_the_others_their_turns() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:

        def struck() -> Operation[None]:
            yield from Pause(0)
            raise MemoryError("always")

        one = Background(bus, struck)
        one.along()
        with pytest.raises(MemoryError, match="always"):
            bus.run(iter(Pause(1.0)))
        assert bus.estop().acknowledged
        one.drop()


def test_it_begins_anew_also_where_its_cleaning_up_fails() -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        sim[2].unplug()
        begun: list[None] = []

        def struck() -> Operation[None]:
            yield from Pause(0.1)
            raise KeyboardInterrupt("once")

        def waits() -> Operation[None]:
            try:
                yield from Pause(1.0)
            finally:
                yield from Servo.position.function(Servo(bus, 2))

        def work() -> Operation[None]:
            begun.append(None)
            if len(begun) == 1:
                yield from Together([waits(), struck()])

        one = Background(bus, work)
        one.along()
        with pytest.raises(KeyboardInterrupt, match="once"):
            bus.run(iter(Pause(5.0)))
        bus.run(iter(Pause(5.0)))
        assert (len(begun), bus.turns.chores) == (2, [])
