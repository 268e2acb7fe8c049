"""The ways by which a stop is asked for: from outside, under another name, and again after whatever went wrong."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.bus.stop import TRIES, _listening, request_estop
from motorbus.errors import LinkError, PortNotFound
from tests.bus.responder import memory_bus, position


@pytest.fixture
def real() -> Iterator[Bus]:
    """A bus in real time, whose stop thread is there."""
    bus, _ = memory_bus(virtual=False)
    bus.run(position(1))
    bus.stopper.start()
    yield bus
    bus.close()


# --- whatever interrupts it -----------------------------------------------------------------------------------------


def test_a_stop_that_is_cut_short_again_and_again_says_so_and_leaves_the_bus_usable() -> None:
    bus, _ = memory_bus()
    bus.run(position(1))
    cuts: list[float] = []

    def cut(now: float) -> Any:
        bus.turns.lock.acquire()
        bus.turns.stopping = True
        cuts.append(now)
        raise KeyboardInterrupt

    bus.turns.latch = cut  # type: ignore[method-assign]
    outcome, interruption = bus.stopper._insist()
    assert outcome == ((), (1,), 0, "nothing: it was cut short again and again")
    assert isinstance(interruption, KeyboardInterrupt)
    assert len(cuts) == TRIES
    assert not bus.turns.stopping
    free: list[bool] = []
    other = Thread(target=lambda: free.append(bus.turns.lock.acquire(blocking=False)))
    other.start()
    other.join()
    assert free == [True]


def test_whatever_goes_wrong_in_the_thread_the_next_wish_is_heard(real: Bus) -> None:
    stopper = real.stopper
    look, wrong = stopper._look, [True]

    def fails(*arguments: Any) -> bool:
        if wrong:
            wrong.pop()
            raise ZeroDivisionError
        return look(*arguments)

    stopper._look = fails  # type: ignore[method-assign, assignment]
    assert real.estop().acknowledged == (1,)
    real.reset()
    assert real.estop().acknowledged == (1,)
    assert wrong == []


# --- its name -------------------------------------------------------------------------------------------------------


def test_the_socket_goes_by_the_name_it_is_given(tmp_path: Path) -> None:
    bus, _ = memory_bus()
    old, new = tmp_path / "old", tmp_path / "new"
    bus.stopper.socket_path = old
    old.touch()
    bus.stopper.move(new)
    assert bus.stopper.socket_path == new
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    bus.stopper.move(None)
    assert bus.stopper.socket_path == tmp_path / f".{os.getpid()}-new"
    assert list(tmp_path.iterdir()) == [bus.stopper.socket_path]


def test_a_socket_that_nobody_serves_or_that_has_no_name_is_moved_without_complaint(tmp_path: Path) -> None:
    bus, _ = memory_bus()
    bus.stopper.move(tmp_path / "new")
    assert bus.stopper.socket_path is None
    bus.stopper.socket_path = tmp_path / "old"
    bus.stopper.move(tmp_path / "new")
    assert bus.stopper.socket_path == tmp_path / "new"
    assert list(tmp_path.iterdir()) == []


def test_what_a_dead_process_has_left_gives_way_and_nothing_is_left_at_the_end(tmp_path: Path) -> None:
    path, moved = tmp_path / "old", tmp_path / "new"
    path.touch()
    with _listening(path, lambda: None) as listener:
        assert listener is not None
        assert path.is_socket()
    assert not path.exists()
    with _listening(path, lambda: moved):
        path.replace(moved)
        path.touch()
    assert not moved.exists()
    assert path.exists(), "what is called so by now is somebody else's"


# --- who asks from outside ------------------------------------------------------------------------------------------


def test_where_a_socket_is_left_and_nobody_listens_the_request_says_so(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(tmp_path / "x"))
        with pytest.raises(PortNotFound):
            request_estop(tmp_path / "x")


def test_a_process_that_does_not_answer_is_not_waited_for_for_ever(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as mute:
        mute.bind(str(tmp_path / "x"))
        mute.listen(1)
        with pytest.raises(LinkError, match="did not answer"):
            request_estop(tmp_path / "x", timeout=0.02)


def test_the_request_is_one_line_and_so_is_the_answer(tmp_path: Path) -> None:
    heard: list[bytes] = []

    def serve() -> None:
        with server.accept()[0] as client:
            heard.append(client.recv(64))
            client.sendall(b'{"acknowledged": [1, 2], "silent": [3], "rounds": 5, "promise": "limp"}\n')

    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "x"))
        server.listen(1)
        thread = Thread(target=serve)
        thread.start()
        assert request_estop(tmp_path / "x") == ((1, 2), (3,), 5, "limp")
        thread.join()
    assert heard == [b"estop\n"]
