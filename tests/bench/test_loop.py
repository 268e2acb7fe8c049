"""A contender that returns a wrong, stale or missing value is found out, and so is one that cheats in its books."""

from __future__ import annotations

import struct
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from bench import memory
from bench.loop import STRETCHES, Late, WrongValue, check, measure, shares
from bench.rounds import CANDIDATES, Failed, Wrong, compare
from bench.workloads import (
    FIELDS,
    IDS,
    POSITION,
    SIZES,
    WARM_UP,
    WORKLOADS,
    Fields,
    Workload,
    goals,
    growing,
    named,
    parts,
    position,
)

BARE = CANDIDATES["bare loop"]
READ_ONE = memory.packet(1, memory.READ, bytes((memory.POSITION, 2)))
SIX = WORKLOADS["sync-read-6x2"]


class Honest:
    """Returns what the wire says: counts, or bytes, or the quantities in them."""

    def __init__(self, workload: Workload = SIX) -> None:
        self.workload = workload
        self.wire = memory.Wire(workload)
        self.size = SIZES[workload.what]
        self.requests = [
            memory.packet(254, memory.SYNC_READ, bytes((memory.POSITION, self.size, *group)))
            for group in parts(workload.reads)
        ]
        self.calls = 0

    def read(self, prepared: Any) -> list[int]:
        return [data[0] | data[1] << 8 for data in self._data([READ_ONE], 2)]

    def sync_read(self, prepared: Any) -> list[Any]:
        found = self._data(self.requests, self.size)
        if self.workload.what == POSITION:
            return [data[0] | data[1] << 8 for data in found]
        return [_fields(data) for data in found] if self.workload.what == FIELDS else found

    fields = blocks = many = sync_read

    def sync_write(self, prepared: Any) -> None:
        self.calls += 1

    def cycle(self, prepared: Any) -> list[Any]:
        return self.sync_read(None)

    def prepare(self, counts: list[int]) -> list[int]:
        return counts

    def counts(self, values: list[Any]) -> list[Any]:
        return values

    def close(self) -> None:
        """Nothing is open."""

    def _data(self, requests: list[bytes], size: int) -> list[bytes]:
        self.calls += 1
        train = b"".join(map(self.wire.answer, requests))
        return [train[start + 5 : start + 5 + size] for start in range(0, len(train), 6 + size)]


def _fields(data: bytes) -> Fields:
    position, velocity, load = struct.unpack_from("<HHH", data)
    return Fields(position, velocity, load, data[6], data[7], data[13] | data[14] << 8)


class Stale(Honest):
    """Gives the last answer again, once."""

    def _data(self, requests: list[bytes], size: int) -> list[bytes]:
        if self.calls == WARM_UP + 50:
            self.wire.answer(requests[0])
        return super()._data(requests, size)


@pytest.mark.parametrize("workload", WORKLOADS.values(), ids=WORKLOADS)
def test_honest_work_is_accepted_and_counted(workload: Any) -> None:
    found = measure(Honest(workload), workload, 100)
    done = WARM_UP + 100
    assert found["processor"] > 0
    reads, writes, _ = found["books"]["1"]
    barriers = {0: 0, 32: 11, 8: 38}[workload.stride]  # of the shorter ones 25 in the warm-up, 13 after it
    assert (reads, writes) == (done * bool(workload.reads) + barriers, done * bool(workload.writes))


@pytest.mark.parametrize("exchanges", [1, 8, 9, 10, 100, 2000])
@pytest.mark.parametrize("stride", [1, 8, 32])
def test_a_sample_is_cut_into_about_equal_stretches_where_strides_end(exchanges: int, stride: int) -> None:
    found = shares(exchanges, stride)
    assert sum(found) == exchanges
    assert len(found) == min(STRETCHES, -(-exchanges // stride))
    assert all(size % stride == 0 for size in found[:-1])
    assert max(found) - min(found) < 2 * stride


def test_a_stretch_in_which_the_machine_was_slow_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    used, looks = 0.0, count(1)

    def usage(who: int) -> SimpleNamespace:
        nonlocal used
        look = next(looks)
        used += {8: 50.0}.get(
            look, look % 2 == 0
        )  # each stretch takes a second, the third after the warm-up 50
        return SimpleNamespace(ru_utime=used, ru_stime=0.0)

    monkeypatch.setattr("bench.loop.getrusage", usage)
    load = WORKLOADS["read1"]
    assert measure(Honest(load), load, 20 * STRETCHES)["processor"] == pytest.approx(1 / 20)
    assert next(looks) == 2 * (STRETCHES + 1) + 1


def test_the_sum_of_the_goals_is_the_sum_of_the_goals() -> None:
    written = [goals(index) for index in range(WARM_UP + 10)]
    books = measure(Honest(WORKLOADS["cycle"]), WORKLOADS["cycle"], 10)["books"]
    assert {node: books[str(node)][2] for node in IDS} == {
        node: sum(each[node - 1] for each in written) for node in IDS
    }


@pytest.mark.parametrize("name", ["read1", "sync-read-6x2", "sync-read-6x15", "sync-read-6x15-raw", "cycle"])
def test_one_stale_reading_in_hundreds_is_found(name: str) -> None:
    with pytest.raises(WrongValue, match=f"reading {WARM_UP + 50}:"):
        measure(Stale(WORKLOADS[name]), WORKLOADS[name], 100)


def test_a_quantity_that_is_wrong_is_found() -> None:
    class Scaled(Honest):
        def counts(self, values: list[Any]) -> list[Any]:
            return [
                value._replace(current=value.current + 1) if isinstance(value, Fields) else value
                for value in values
            ]

    workload = WORKLOADS["sync-read-6x15"]
    with pytest.raises(WrongValue, match="reading 0:"):
        measure(Scaled(workload), workload, 10)


def test_more_servos_than_a_packet_can_name_take_two() -> None:
    workload = growing(253)
    contender = Honest(workload)
    assert [len(group) for group in parts(workload.reads)] == [240, 13]
    assert set(measure(contender, workload, 10)["books"]) == {str(node) for node in range(1, 254)}


def test_workloads_are_known_by_name() -> None:
    assert named("many-64") == growing(64)
    assert named("cycle") is WORKLOADS["cycle"]
    with pytest.raises(KeyError):
        named("many-65")


def test_books_that_agree_pass() -> None:
    compare(BARE, {"1": [5, 0, 0]}, {"servos": {"1": [5, 0, 0]}, "strays": 0})


@pytest.mark.parametrize("kept", [[6, 0, 0], [5, 1, 0], [5, 0, 2048]])
def test_books_that_differ_are_refused(kept: list[int]) -> None:
    with pytest.raises(Failed, match="servo 1"):
        compare(BARE, {"1": [5, 0, 0]}, {"servos": {"1": kept}, "strays": 0})


@pytest.mark.parametrize(
    ("kept", "late", "kind"),
    [
        ([6, 0, 0], 0, Wrong),
        ([6, 0, 0], 1, Failed),
        ([7, 0, 0], 1, Wrong),
        ([4, 0, 0], 1, Wrong),
        ([6, 1, 0], 1, Wrong),
    ],
)
def test_a_reading_asked_for_once_more_spoils_books_and_nothing_else_excuses_them(
    kept: list[int], late: int, kind: type[Failed]
) -> None:
    with pytest.raises(Failed) as told:
        compare(BARE, {"1": [5, 0, 0]}, {"servos": {"1": kept}, "strays": 0}, late)
    assert type(told.value) is kind


def test_stray_bytes_on_the_wire_are_refused() -> None:
    with pytest.raises(Failed, match="3 bytes or packets"):
        compare(BARE, {}, {"servos": {}, "strays": 3})


NODES = (1, 2)
READ = [[position(node, number) for node in NODES] for number in range(20)]
LEFT_OUT = READ[:7] + READ[8:]


def test_a_reading_that_was_left_out_after_a_late_answer_spoils_a_measurement() -> None:
    check(READ, NODES)
    with pytest.raises(Late, match="1 readings of a servo left out, 0 told as missing"):
        check(LEFT_OUT, NODES, late=1)
    check(READ, NODES, late=1)  # it was late, and all is right: it counts as it is
    with pytest.raises(Late, match="0 readings of a servo left out, 1 told as missing"):
        check([*READ[:7], [READ[7][0], None], *READ[8:]], NODES, late=1)


@pytest.mark.parametrize(
    ("readings", "late"),
    [
        (LEFT_OUT, 0),
        ([*READ[:7], *READ[9:]], 1),
        ([*READ[:7], READ[6], *READ[7:]], 1),
        ([*READ[:7], READ[7][::-1], *READ[8:]], 3),
        ([*READ[:7], READ[7][:1], *READ[8:]], 1),
        ([*READ[:7], [READ[7][0], None], *READ[8:]], 0),
    ],
    ids=["nobody was late", "two for one", "twice the same", "swapped", "a servo too few", "missing"],
)
def test_anything_else_is_wrong_whatever_was_late(readings: list[list[Any]], late: int) -> None:
    with pytest.raises(WrongValue, match="reading 7:"):
        check(readings, NODES, late=late)
