"""Waiting for bytes, below and above the descriptor that select stops at."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from motorbus.link import waiting
from motorbus.link.waiting import is_readable, wait_any, wait_readable


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture(params=["select", "poll"], autouse=True)
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "poll":
        monkeypatch.setattr(waiting, "LIMIT", 0)


def test_what_is_there_is_seen(pipe: tuple[int, int]) -> None:
    os.write(pipe[1], b"x")
    assert wait_readable(pipe[0], float("inf"))


def test_nothing_is_nothing(pipe: tuple[int, int]) -> None:
    assert not wait_readable(pipe[0], 0.001)


def test_a_look_sees_what_is_there_and_what_has_ended(pipe: tuple[int, int]) -> None:
    assert not is_readable(pipe[0])
    os.write(pipe[1], b"x")
    assert is_readable(pipe[0])
    reader, writer = os.pipe()
    os.close(writer)
    assert is_readable(reader)
    os.close(reader)
    with pytest.raises((OSError, ValueError)):
        is_readable(-1)


def test_the_end_of_the_other_side_is_seen(pipe: tuple[int, int]) -> None:
    reader, writer = os.pipe()
    os.close(writer)
    assert wait_readable(reader, float("inf"))
    assert os.read(reader, 1) == b""
    os.close(reader)


def test_of_several_those_are_told_that_have_something(pipe: tuple[int, int]) -> None:
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


def test_a_number_that_is_no_descriptor_is_refused(pipe: tuple[int, int]) -> None:
    with pytest.raises((OSError, ValueError)):
        wait_any([pipe[0], -1], 1.0)
