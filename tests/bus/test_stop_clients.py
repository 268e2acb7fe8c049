"""Whoever asks for a stop from outside is served, whatever the clients beside it do; and nothing of it is left over."""

from __future__ import annotations

import errno
import json
import socket
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from threading import Thread
from typing import Any

from motorbus.bus.stop import Stopper, _listening
from tests.bus.responder import memory_bus, position


def stopper() -> Stopper:
    bus, _ = memory_bus()
    bus.run(position(1))
    return bus.stopper


def test_a_client_that_says_nothing_is_let_go() -> None:
    one = stopper()
    ours, theirs = socket.socketpair()
    with theirs:
        serving = Thread(target=one._asked, args=(ours,))
        serving.start()
        serving.join(5)
        waits = serving.is_alive()
    serving.join()
    assert not waits
    assert one.outcome is None
    assert ours.fileno() == -1, "closed"


def test_a_client_that_has_gone_before_the_answer_has_stopped_the_bus_all_the_same() -> None:
    one = stopper()
    ours, theirs = socket.socketpair()
    with theirs:
        theirs.sendall(b"estop\n")
    one._asked(ours)
    assert one.outcome is not None
    assert one.outcome.acknowledged == (1,)


class Full(socket.socket):
    """A listener of a process that has as many files open as it may."""

    def accept(self) -> Any:
        raise OSError(errno.EMFILE, "Too many open files")


def test_a_client_that_cannot_be_let_in_holds_up_nobody_who_is_in(tmp_path: Path) -> None:
    one = stopper()
    wish, waking = socket.socketpair()
    ours, theirs = socket.socketpair()
    outside, listener = socket.socket(socket.AF_UNIX), Full(socket.AF_UNIX)
    with wish, waking, theirs, outside, listener, DefaultSelector() as ready:
        listener.bind(str(tmp_path / "stop"))
        listener.listen(1)
        outside.connect(str(tmp_path / "stop"))
        theirs.sendall(b"estop\n")
        for end in (wish, listener, ours):
            ready.register(end, EVENT_READ)
        assert not one._look(ready, wish, listener)
        assert json.loads(theirs.recv(4096))["acknowledged"] == [1]


def test_where_its_file_was_removed_meanwhile_the_socket_ends_without_complaint(tmp_path: Path) -> None:
    path = tmp_path / "stop"
    with _listening(path, lambda: path) as listener:
        assert listener is not None
        path.unlink()
    assert listener.fileno() == -1, "closed"
