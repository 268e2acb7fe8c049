"""An interruption that falls into one of several operations at once, or between them: it ends them all, and is told."""

from __future__ import annotations

import asyncio

import pytest

from motorbus.bus.run import Branch, Run
from motorbus.core.operation import Alone, Operation, Pause, Report, Together, afterwards, outcome
from motorbus.errors import MotorbusError
from tests.bus.responder import memory_bus, position, write


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
@pytest.mark.parametrize("deep", [False, True])
def test_an_interruption_of_one_ends_those_beside_it(error: type[BaseException], deep: bool) -> None:
    """They may wait for what it will never do."""
    bus, _ = memory_bus()
    cleaned: list[float] = []

    def fails() -> Operation[None]:
        yield from position(1)
        raise error("once")

    def waits() -> Operation[None]:
        try:
            while True:
                yield from Pause(1.0)
        finally:
            cleaned.append((yield from position(2)))

    def both() -> Operation[None]:
        yield from Together([waits(), iter(Alone(fails())) if deep else fails(), waits()])

    with pytest.raises(error, match="once") as caught:
        bus.run(both())
    assert not hasattr(caught.value, "__notes__")
    assert cleaned == [2, 2]
    assert bus.link.now() < 1.0
    assert bus.turns.idle


def test_one_that_falls_into_the_last_of_them_is_not_lost_to_an_error_of_another() -> None:
    """Their parent would go on after an error of ours."""
    bus, responder = memory_bus()
    responder.dead = {1}
    found: list[object] = []

    def last() -> Operation[None]:
        yield from Pause(1.0)
        raise KeyboardInterrupt("once")

    def both() -> Operation[None]:
        try:
            yield from Together([iter(position(1)), last()])
        except MotorbusError as error:
            found.append(error)

    with pytest.raises(KeyboardInterrupt, match="once") as caught:
        bus.run(both())
    assert found == []
    assert caught.value.__notes__ == ["node 1 did not answer (2 tries)"]
    assert bus.turns.idle


@pytest.mark.parametrize("alone", [False, True])
def test_one_that_falls_behind_the_last_of_them_is_told_to_whoever_waited_for_them(
    alone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, _ = memory_bus()
    join, cut = Run._join, [KeyboardInterrupt("once")]
    told: list[BaseException] = []

    def joined(run: Run[None], branch: Branch) -> None:
        if cut:
            raise cut.pop()
        join(run, branch)

    def goes_on() -> Operation[None]:
        try:
            yield from Alone(position(1)) if alone else Together([position(1), position(2)])
            while True:
                yield from position(3)
        except BaseException as error:
            told.append(error)
            raise

    monkeypatch.setattr(Run, "_join", joined)
    with pytest.raises(KeyboardInterrupt, match="once") as caught:
        bus.run(goes_on())
    assert told == [caught.value]
    assert bus.turns.statistics.nodes.get(3) is None, "nothing is asked any more"
    assert bus.turns.idle


def test_a_parent_that_goes_on_after_an_error_does_not_go_on_after_an_interruption() -> None:
    """One has failed before, one is cut off, one still cleans up: what is behind them is not begun."""
    bus, responder = memory_bus()
    responder.dead = {1}
    told: list[BaseException] = []
    cleaned: list[float] = []

    def fails() -> Operation[None]:
        yield from Pause(1.0)
        raise KeyboardInterrupt("once")

    def cleans() -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            yield from Together([pause(0.1), deep()])

    def pause(seconds: float) -> Operation[None]:
        yield from Pause(seconds)

    def deep() -> Operation[None]:
        yield from Alone(cleaning())

    def cleaning() -> Operation[None]:
        cleaned.append((yield from Alone(position(2))))
        cleaned.extend((yield from Together([position(3), position(5)])))

    def goes_on() -> Operation[None]:
        while True:
            try:
                yield from Together([iter(position(1)), fails(), cleans()])
            except BaseException as error:
                told.append(error)
                if not isinstance(error, MotorbusError):
                    raise
            yield from position(4)

    with pytest.raises(KeyboardInterrupt, match="once") as caught:
        bus.run(goes_on())
    assert told == [caught.value]
    assert caught.value.__notes__ == ["node 1 did not answer (2 tries)"]
    assert cleaned == [2, 3, 5], "what is begun to clean up ends, however deep it goes"
    assert bus.turns.statistics.nodes.get(4) is None
    assert bus.turns.idle


def test_what_a_clean_up_failed_with_is_told_though_it_was_only_a_value() -> None:
    """Whoever asks several for their outcomes, to raise them behind the last, is interrupted before he can."""
    bus, responder = memory_bus()
    responder.dead = {1, 2}

    def turns() -> Operation[None]:
        yield from Pause(1e9)

    def struck() -> Operation[None]:
        yield from Pause(1.0)
        raise KeyboardInterrupt("once")

    def both() -> Operation[None]:
        polled = outcome(position(2))  # nobody's clean-up: what it fails with is for whoever asked
        yield from Together([polled, outcome(afterwards(turns(), lambda: position(1))), struck()])

    with pytest.raises(KeyboardInterrupt, match="once") as caught:
        bus.run(both())
    assert caught.value.__notes__ == ["node 1 did not answer (2 tries)"]


def test_an_interrupt_in_who_listens_to_a_clean_up_leaves_the_rest_of_it_its_time() -> None:
    bus, responder = memory_bus()

    def reports() -> Operation[None]:
        try:
            yield from Pause(1e9)
        finally:
            yield from afterwards(told(), lambda: write(3, 20, 1))

    def told() -> Operation[None]:
        yield from Report("stopping")

    def struck() -> Operation[None]:
        yield from Pause(1.0)
        raise KeyboardInterrupt("once")

    def both() -> Operation[None]:
        yield from Together([reports(), struck()])

    def listens(event: object) -> None:
        raise KeyboardInterrupt("again")

    with pytest.raises(KeyboardInterrupt, match="once"):
        bus.run(afterwards(both(), lambda: write(4, 20, 1)), report=listens)
    assert [packet.id for packet in responder.heard] == [3, 4]
    assert bus.link.now() < 1.1


@pytest.mark.parametrize("within", [False, True])
def test_ctrl_c_while_a_cancelled_one_cleans_up_is_what_is_raised(within: bool) -> None:
    """Where it falls into the operation as well as where it falls between its steps."""
    bus, _ = memory_bus()

    def waits() -> Operation[None]:
        try:
            yield from Pause(1.0)
        finally:
            yield from position(2)
            if within:
                raise KeyboardInterrupt("once")

    run = Run(bus.turns, waits(), now=bus.link.now, report=None, wake=lambda: None)
    run.advance()
    run.interrupt(asyncio.CancelledError())
    if not within:
        run.interrupt(KeyboardInterrupt("once"))
    while not run.advance():
        bus.relay.turn()
    with pytest.raises(KeyboardInterrupt, match="once"):
        run.result()
