"""Every decoder finds what brute force finds, the SDK is run as it is, and the figure is theirs by ours."""

from __future__ import annotations

import pytest

from bench import apart
from bench.noisy_stream import capture, decodable
from bench.rounds import Failed
from bench.rows import decoding
from bench.rows.decoding import BLOCKS, BULK, CUT, JOBS, SDK, STREAM, measured


@pytest.mark.parametrize("name", [STREAM, BLOCKS, BULK, CUT])
def test_ours_find_all_of_them(name: str) -> None:
    said = measured(name, 400)
    assert said["found"] == said["decodable"] == len(list(decodable(capture(400))))
    assert said["bytes"] == len(capture(400))
    assert said["seconds"] > 0


def test_one_packet_that_is_missed_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def losing() -> decoding.Decoder:
        return lambda stream: (1.0, [data for _, data in decodable(stream)][1:])

    monkeypatch.setattr(decoding, "_streaming", losing)
    with pytest.raises(Failed, match="streaming: "):
        measured(STREAM, 100)


def test_the_sdk_finds_most_of_them_and_nothing_else_counts() -> None:
    (job,) = (job for job in JOBS if job.name == SDK)
    said = apart.told(job, "400")
    assert 0.7 * said["decodable"] < said["found"] < said["decodable"]


def test_the_port_in_memory_hands_over_what_is_asked_for() -> None:
    port = decoding.MemoryPort(b"abcd")
    assert [port.readPort(3), port.readPort(-1), port.readPort(0)] == [b"abc", b"", b""]
    assert not port.isPacketTimeout()
    assert port.readPort(9) == b"d"
    assert port.isPacketTimeout()


def test_the_rows_are_theirs_by_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = {STREAM: 1.0, BLOCKS: 0.8, BULK: 0.25, CUT: 0.5, SDK: 4.0}

    def told(job: apart.Job, *more: str) -> dict[str, float]:
        found = 90 if job.name == SDK else 100
        return {"seconds": shares[job.name], "bytes": 1000, "decodable": 100, "found": found}

    monkeypatch.setattr(apart.rounds, "__defaults__", (told, 3))
    streamed, blocks, cut, bulk = decoding.rows(7, lambda text: None)
    assert (streamed.number, streamed.value, streamed.ours, streamed.theirs) == ("8", 4.0, 1.0, 4.0)
    assert (blocks.number, blocks.value, blocks.goal) == ("8", 5.0, "")
    assert "in blocks of 4096 bytes" in blocks.measure
    assert (cut.number, cut.value, cut.goal, cut.samples) == ("9", 8.0, ">= 15", 7)
    assert (bulk.number, bulk.value, bulk.goal) == ("9", 16.0, "")
    assert "the bytes of each packet cut out" in cut.measure
    assert "columns only" in bulk.measure
    assert "90.0% of 100 packets" in streamed.note
    assert "bytes as a list: 2.0 times as fast as our streaming decoder" in cut.note
    assert "as arrays: 4.0 times as fast as our streaming decoder" in bulk.note
