"""Everybody makes the bytes that are due, wrong ones are found out, and the best of the round is who counts."""

from __future__ import annotations

from typing import Any

import pytest

from bench import apart
from bench.rounds import Failed
from bench.rows import encoding
from bench.rows.encoding import BYTES, JOBS, KEPT, OURS, READ, SYNC_WRITE, measured

FEW = {READ: 20, SYNC_WRITE: 20}


def test_ours_makes_the_bytes_that_are_due() -> None:
    found = measured(OURS, FEW)
    assert set(found) == {READ, KEPT, BYTES, SYNC_WRITE}
    assert all(seconds > 0 for seconds in found.values())


def test_only_the_read_that_is_kept_is_the_same_each_time() -> None:
    kinds = encoding._reads(20)
    for kind, same in ((READ, False), (KEPT, True), (BYTES, False)):
        encode, inputs = kinds[kind]
        made = [encode(one) for one in inputs]
        assert set(made) == {encoding._read_packet()}
        assert (len(set(map(id, made))) == 1) is same


@pytest.mark.parametrize("job", [job for job in JOBS if job.name != OURS], ids=lambda job: job.name)
def test_each_peer_makes_the_bytes_that_are_due(job: apart.Job) -> None:
    assert set(apart.told(job, "20")) == {READ, SYNC_WRITE}


def test_wrong_bytes_are_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    read, sync_write, prepare = encoding.MAKERS[OURS]()

    def wrong() -> tuple[encoding.Encoder, encoding.Encoder, encoding.Encoder]:
        return read, lambda orders: sync_write(orders)[:-1] + b"\0", prepare

    monkeypatch.setitem(encoding.MAKERS, OURS, wrong)
    with pytest.raises(Failed, match="where ff ff fe 2e 83 2a 06"):
        measured(OURS, FEW)


def test_the_best_peer_of_each_round_is_who_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = {job.name: iter(range(100)) for job in JOBS}

    def told(job: apart.Job, *more: str) -> dict[str, Any]:
        first = next(turns[job.name]) % 2 == 0
        if job.name == OURS:
            return {READ: 3.0, KEPT: 0.5, BYTES: 1.0, SYNC_WRITE: 6.0}
        quick = (job.name == "st3215") == first
        return {READ: 2.0 if quick else 9.0, SYNC_WRITE: 12.0}

    monkeypatch.setattr(apart.rounds, "__defaults__", (told, 3))
    alone, read, kept, write = encoding.rows(7, lambda text: None)
    assert (read.value, read.least, read.greatest) == (1.5, 1.5, 1.5)
    assert [(row.value, row.goal) for row in (kept, read)] == [(0.25, ""), (1.5, "<= 1.0")]
    assert (alone.value, alone.goal, write.goal) == (0.5, "", "<= 0.75")
    assert (write.value, write.number, write.samples) == (0.5, "10", 7)
