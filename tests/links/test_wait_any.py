"""Wait for bytes at descriptors, also above the highest number that select takes."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator

import pytest

from motorbus.link.stream import wait_any


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


def test_a_descriptor_above_the_limit_of_select(pipe: tuple[int, int]) -> None:
    high = fcntl.fcntl(pipe[0], fcntl.F_DUPFD, 1500)
    try:
        assert wait_any((high,), 0.001) == []
        os.write(pipe[1], b"x")
        assert wait_any((high,), float("inf")) == [high]
    finally:
        os.close(high)
    with pytest.raises(ValueError, match="closed"):
        wait_any((high,), 1.0)


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
