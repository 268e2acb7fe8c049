"""The thread of the stop comes once, before it is needed; where none is to be had the stop goes through without."""

from __future__ import annotations

import atexit
import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any

import pytest

from motorbus.bus import stop
from motorbus.bus.pump import Bus
from motorbus.errors import LinkError
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, memory_bus, position
from tests.bus.script import admit_all


@pytest.fixture
def real() -> Iterator[Bus]:
    """A bus in real time that knows a node and has no stop thread yet."""
    bus, _ = memory_bus(virtual=False)
    bus.run(position(1))
    yield bus
    bus.close()


@pytest.fixture
def no_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """The system gives none, until this is undone."""

    def refused(thread: Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patched:
        patched.setattr(Thread, "start", refused)
        yield patched


# --- there is one ---------------------------------------------------------------------------------------------------


def test_a_stop_before_anything_was_moved_has_a_thread_all_the_same(real: Bus) -> None:
    assert real.stopper._thread is None
    assert real.estop().acknowledged == (1,)
    assert real.stopper._thread is not None


def test_whoever_has_started_it_can_be_reached_by_other_processes_at_once(
    real: Bus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited, listening = Event(), stop._listening

    class Awaited(Event):
        def wait(self, timeout: float | None = None) -> bool:
            waited.set()
            return super().wait(timeout)

    @contextlib.contextmanager
    def late(*arguments: Any) -> Iterator[Any]:
        waited.wait(20)  # the thread comes no farther before somebody waits for it
        with listening(*arguments) as listener:
            yield listener

    monkeypatch.setattr(stop, "_listening", late)
    real.stopper.socket_path, real.stopper._ready = tmp_path / "stop", Awaited()
    real.stopper.start()
    there = real.stopper.socket_path.is_socket()
    waited.set()
    assert there


def test_two_who_start_it_at_the_same_moment_have_one_thread_between_them(real: Bus) -> None:
    class Overtaken:
        """A lock before which somebody else comes first."""

        def __enter__(self) -> None:
            real.stopper._starting = Lock()
            real.stopper.start()

        def __exit__(self, *_: object) -> None: ...

    before = set(threading.enumerate())
    real.stopper._starting = Overtaken()  # type: ignore[assignment]
    real.stopper.start()
    assert set(threading.enumerate()) - before == {real.stopper._thread}


def test_a_bus_that_is_closed_in_the_moment_its_thread_begins_leaves_it_nothing_to_do(
    real: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Late(threading.Thread):
        def start(self) -> None:
            real.stopper.close()
            super().start()

    wrong: list[object] = []
    monkeypatch.setattr(threading, "excepthook", wrong.append)
    monkeypatch.setattr(stop, "Thread", Late)
    monkeypatch.setattr(
        stop, "PATIENCE", 0.05
    )  # which a signal handler that closes the bus waits for in vain
    real.stopper.start()
    assert real.stopper._ready.is_set(), "nobody waits for what does not come"
    assert real.stopper._thread is not None
    real.stopper._thread.join(5.0)
    assert not real.stopper._thread.is_alive()
    assert wrong == []


def test_a_bus_that_another_thread_closes_while_its_own_is_being_started_leaves_no_thread(
    real: Bus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    closing = Thread(target=real.stopper.close)
    pair = socket.socketpair

    def disturbed() -> tuple[socket.socket, socket.socket]:
        closing.start()
        closing.join(0.2)
        return pair()

    monkeypatch.setattr(socket, "socketpair", disturbed)
    real.stopper.socket_path = tmp_path / "stop"
    real.stopper.start()
    closing.join(5)
    assert real.stopper._thread is not None
    real.stopper._thread.join(30)
    assert not real.stopper._thread.is_alive()
    assert not real.stopper.socket_path.exists()


def test_once_it_is_there_a_stop_waits_for_nobody_who_is_still_starting_it(real: Bus) -> None:
    """A signal handler may interrupt `start` where it waits for the thread, and ask for the stop."""
    real.stopper.start()
    with real.stopper._starting:
        asking = Thread(target=real.estop)
        asking.start()
        asking.join(5)
        waits = asking.is_alive()
    asking.join()
    assert not waits
    assert real.stopper.outcome is not None
    assert real.stopper.outcome.acknowledged == (1,)


def test_a_process_that_ends_lets_a_stop_that_has_begun_come_to_its_end_first(
    real: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_exit: list[Callable[[], None]] = []
    monkeypatch.setattr(atexit, "register", at_exit.append)
    monkeypatch.setattr(atexit, "unregister", lambda call: at_exit.remove(call) if call in at_exit else None)
    real.stopper.start()
    real.trigger_estop()
    for call in at_exit[:]:  # each takes itself off
        call()
    assert real.stopper.outcome is not None
    assert real.stopper.outcome.acknowledged == (1,)
    assert at_exit == [], "of what is closed nothing is left to do"


# --- there is none --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("no_threads")
def test_without_a_thread_whoever_asks_for_the_stop_does_its_work(real: Bus) -> None:
    assert real.estop().acknowledged == (1,)
    assert real.turns.latched


@pytest.mark.usefixtures("no_threads")
def test_without_a_thread_whoever_would_move_something_is_told(real: Bus) -> None:
    with pytest.raises(LinkError, match="no more threads"):
        real.stopper.start()
    assert real.stopper._thread is None


def test_a_stop_that_was_triggered_before_a_thread_was_to_be_had_comes_with_the_thread(
    real: Bus, no_threads: pytest.MonkeyPatch
) -> None:
    with pytest.raises(LinkError):
        real.stopper.start()
    real.trigger_estop()
    no_threads.undo()
    real.stopper.start()
    real.stopper.close()  # the end comes after what was asked for before
    assert real.stopper.outcome is not None
    assert real.stopper.outcome.acknowledged == (1,)


# --- who waits ------------------------------------------------------------------------------------------------------


def test_everyone_who_waits_for_a_stop_is_told_what_came_of_one() -> None:
    bus, responder = memory_bus()
    bus.run(position(1))
    wishes = [stop.Wish(), stop.Wish()]
    bus.stopper._wishes += wishes
    heard = len(responder.heard)
    outcome = bus.stopper._stop_and_tell()
    assert [wish.outcome for wish in wishes] == [outcome, outcome]
    assert [wish.fulfilled.is_set() for wish in wishes] == [True, True]
    assert [packet.id for packet in responder.heard[heard:]] == [254, 1]
    assert bus.stopper.outcome == outcome


def test_a_caller_waits_as_long_as_the_stop_of_many_silent_servos_lasts() -> None:
    responder = Responder(range(1, 31))
    bus = Bus(MemoryLink(responder), FAMILY, admit=admit_all)
    bus.turns.latency = 0.016  # s; so long many a serial adapter holds bytes back
    for node in responder.memory:
        bus.run(position(node))
    responder.dead = set(responder.memory)
    begun = bus.link.now()
    assert len(bus.estop().silent) == 30
    assert bus.link.now() - begun < stop.PATIENCE


def test_five_may_wait_while_the_thread_is_at_work(tmp_path: Path) -> None:
    """Nobody answers them here. A sixth is refused by Linux, and so are those of a flood."""
    with contextlib.ExitStack() as kept, stop._listening(tmp_path / "stop", lambda: None) as listener:
        assert listener is not None

        def connects() -> bool:
            client = kept.enter_context(socket.socket(socket.AF_UNIX))
            client.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                client.connect(str(tmp_path / "stop"))
                return True
            return False

        assert [connects() for _ in range(6)] == [True] * 5 + [False]
