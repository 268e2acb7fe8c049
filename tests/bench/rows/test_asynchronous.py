"""Both calls read what the responder says, and the figure is the awaited one by the blocking one."""

from __future__ import annotations

import pytest

from bench.loop import WrongValue
from bench.responder import build, responder
from bench.row import met
from bench.rows import asynchronous
from bench.rows.asynchronous import AWAITED, BLOCKING, measured
from bench.workloads import WARM_UP


@pytest.mark.parametrize("name", [AWAITED, BLOCKING])
def test_each_reads_what_is_said(name: str) -> None:
    with responder(build()) as wire:
        assert measured(name, f"{wire.port},latency=1s", 20)["processor"] > 0
    reads, writes, _ = wire.books["servos"]["1"]
    assert (reads, writes) == (WARM_UP + 20, 0)


def test_a_wrong_value_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asynchronous, "_blocking", lambda address, reads: ([0.0] * reads, 1.0, 0))
    with pytest.raises(WrongValue, match="reading 0"):
        measured(BLOCKING, "nowhere", 5)


def test_the_row_is_the_awaited_by_the_blocking(monkeypatch: pytest.MonkeyPatch) -> None:
    cost = {AWAITED: 60e-6, BLOCKING: 30e-6}
    monkeypatch.setattr(asynchronous, "_run", lambda program, job: {"processor": cost[job.name]})
    (row,) = asynchronous.rows(5, lambda text: None)
    assert (row.number, row.value, row.samples) == ("11", 2.0, 5)
    assert "60.0 µs where the blocking call takes 30.0 µs" in row.note
    assert met(row)
