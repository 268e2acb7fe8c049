"""Waiting for bytes, below and above the descriptor that select stops at."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from threading import Thread

import pytest

from motorbus.link import wait
from motorbus.link.wait import Readiness, wait_any, wait_readable


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture(params=["select", "poll"], autouse=True)
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "poll":
        monkeypatch.setattr(wait, "SELECT_LIMIT", 0)


def test_data_is_seen(pipe: tuple[int, int]) -> None:
    os.write(pipe[1], b"x")
    assert wait_readable(pipe[0], float("inf"))


def test_a_time_out(pipe: tuple[int, int]) -> None:
    assert not wait_readable(pipe[0], 0.001)


def test_a_registered_descriptor_waits_the_same(pipe: tuple[int, int]) -> None:
    ready = Readiness(pipe[0])
    begin = time.monotonic()
    assert not ready.wait(begin + 0.0015)
    assert time.monotonic() - begin >= 0.0015
    assert not ready.wait(0.0)
    assert not ready.wait(float("-inf"))
    os.write(pipe[1], b"x")
    assert ready.wait(0.0)
    assert ready.wait(float("inf"))


def test_two_threads_may_wait_for_one_descriptor(pipe: tuple[int, int]) -> None:
    ready = Readiness(pipe[0])
    found: list[bool] = []
    threads = [Thread(target=lambda: found.append(ready.wait(time.monotonic() + 30.0))) for _ in range(3)]
    for thread in threads:
        thread.start()
    time.sleep(0.01)
    os.write(pipe[1], b"x")
    for thread in threads:
        thread.join()
    assert found == [True] * 3


def test_a_descriptor_above_the_limit_of_select(pipe: tuple[int, int]) -> None:
    high = fcntl.fcntl(pipe[0], fcntl.F_DUPFD, 1500)
    try:
        ready = Readiness(high)
        assert not ready.wait(time.monotonic() + 0.0005)
        os.write(pipe[1], b"x")
        assert ready.wait(float("inf"))
    finally:
        os.close(high)


def test_the_end_of_the_other_side_is_seen(pipe: tuple[int, int]) -> None:
    reader, writer = os.pipe()
    os.close(writer)
    assert wait_readable(reader, float("inf"))
    assert os.read(reader, 1) == b""
    os.close(reader)


def test_of_several_the_readable_ones_are_returned(pipe: tuple[int, int]) -> None:
    reader, writer = os.pipe()
    try:
        assert wait_any([pipe[0], reader], 0.001) == []
        os.write(writer, b"x")
        assert wait_any([pipe[0], reader], float("inf")) == [reader]
        os.write(pipe[1], b"x")
        assert wait_any([pipe[0], reader], float("inf")) == [pipe[0], reader]
    finally:
        os.close(writer)
    os.close(pipe_end := reader)
    with pytest.raises((OSError, ValueError)):
        wait_any([pipe[0], pipe_end], 1.0)


def test_an_invalid_descriptor_raises(pipe: tuple[int, int]) -> None:
    with pytest.raises((OSError, ValueError)):
        wait_any([pipe[0], -1], 1.0)
