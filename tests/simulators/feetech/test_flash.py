"""Cells that take their time: what is committed when, what a cut leaves, and how often each was programmed."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.families.feetech.simulator.flash import Commit, Flash


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 10.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def flash(clock: Clock, torn: str = "erased") -> Flash:
    """Four cells, 40 ms a write."""
    return Flash(b"\x00\x11\x22\x33", clock=clock, time=0.04, torn=torn)


def test_the_cells_of_a_write_share_its_time(clock: Clock) -> None:
    cells = flash(clock)
    cells.program([(1, 5), (2, 6)])
    assert cells.commits == [Commit(10.02, 1, 5), Commit(10.04, 2, 6)]
    assert cells.busy_until == 10.04
    assert cells.cells == b"\x00\x11\x22\x33"
    clock.now = 10.02
    assert (bytes(cells.cells), cells.commits) == (b"\x00\x05\x22\x33", [Commit(10.04, 2, 6)])
    clock.now = 10.04
    assert (bytes(cells.cells), cells.commits, cells.busy_until) == (b"\x00\x05\x06\x33", [], -inf)


def test_a_second_write_waits_for_the_first(clock: Clock) -> None:
    cells = flash(clock)
    cells.program([(0, 1)])
    clock.now = 10.01
    cells.program([(0, 2)])
    assert [commit.value for commit in cells.commits] == [1, 2]
    assert [commit.moment for commit in cells.commits] == pytest.approx([10.04, 10.08])
    clock.now = 99.0
    cells.program([(0, 3)])
    assert [commit.moment for commit in cells.commits] == [99.04]


def test_wear_counts_what_was_programmed_and_not_what_was_asked(clock: Clock) -> None:
    cells = flash(clock)
    cells.program([(1, 5), (2, 6)])
    assert cells.wear == {}
    clock.now = 10.02
    assert cells.wear == {1: 1}
    cells.cut()  # the second is untouched
    clock.now = 99.0
    assert cells.wear == {1: 1}
    cells.program([(1, 5)])  # the same value wears as well
    clock.now = 100.0
    assert cells.wear == {1: 2}


def test_without_time_it_is_done_at_once() -> None:
    cells = Flash(bytes(3))
    cells.program([(2, 9)])
    assert (bytes(cells.cells), cells.commits, cells.done) == (b"\0\0\x09", [], 1)


@pytest.mark.parametrize(("torn", "left"), [("old", 0x11), ("new", 5), ("erased", 0xFF)])
def test_a_cut_in_the_middle_tears_the_cell_under_work_and_loses_the_rest(
    clock: Clock, torn: str, left: int
) -> None:
    cells = flash(clock, torn)
    cells.program([(1, 5), (2, 6)])
    clock.now = 10.01
    cells.cut()
    assert cells.cells == bytes([0, left, 0x22, 0x33])
    assert (cells.commits, cells.wear) == ([], {1: 1})


@pytest.mark.parametrize(("at", "left"), [(10.0, b"\0\x11\x22\x33"), (10.02, b"\0\x05\x22\x33")])
def test_a_cut_between_two_commits_tears_nothing(clock: Clock, at: float, left: bytes) -> None:
    cells = flash(clock)
    cells.program([(1, 5), (2, 6)])
    clock.now = at
    cells.cut()
    assert cells.cells == left


def test_a_cut_when_nothing_is_under_work_changes_nothing(clock: Clock) -> None:
    cells = flash(clock)
    cells.program([(1, 5)])
    clock.now = 20.0
    cells.cut()
    assert (bytes(cells.cells), cells.wear) == (b"\0\x05\x22\x33", {1: 1})


def test_what_is_intended_and_what_is_dropped(clock: Clock) -> None:
    cells = flash(clock)
    cells.program([(1, 5), (2, 6)])
    clock.now = 10.03
    assert cells.intended() == b"\0\x05\x06\x33"
    cells.drop()
    assert cells.intended() == cells.cells == b"\0\x05\x22\x33"


def test_the_moment_of_a_number_of_commits(clock: Clock) -> None:
    cells = flash(clock)
    assert cells.moment_of(0) == inf  # nothing is on its way
    cells.program([(1, 5), (2, 6)])
    moments = [cells.moment_of(done) for done in (0, 0.5, 1, 1.25, 2, 2.5, 3)]
    assert moments == pytest.approx([10.0, 10.01, 10.02, 10.025, 10.04, inf, inf])
    clock.now = 10.03
    assert (cells.moment_of(1), cells.moment_of(2)) == (10.02, 10.04)
    assert cells.moment_of(0) == inf  # that was before
