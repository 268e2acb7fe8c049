"""Through the whole bus: a reply that is damaged, or is somebody else's, or answers something else, is never a value.

What a wire can do to a reply depends on its kind. On a byte line any byte may be another one. On CAN the controller
throws damaged frames away, so there a good frame comes that answers another request.
"""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.core.family import Family
from motorbus.core.register import Register
from motorbus.core.request import Data
from motorbus.errors import MotorbusError, WireError
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.support.subjects import line_of, payload, vectors
from tests.support.world import IDS, World, sent, world

NODE, OTHER = IDS[:2]
HEAD = 6
"""So much of a reply without a checksum says what it answers; what is behind, changed alike each time, is a value."""


class Tampering(PerfectLine):
    """Changes what devices say, and puts one request in place of another; `times` says how often at most."""

    def __init__(self) -> None:
        self.place = -1
        self.mask = 0
        self.instead: dict[Data, Data] = {}
        self.times = 0
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        changed = self._changed(sender, data) if self.fired < self.times else data
        self.fired += changed != data
        return super().carry(sender, changed, at)

    def _changed(self, sender: Side, data: Data) -> Data:
        if sender is Side.HOST:
            return self.instead.get(data, data)
        if not isinstance(data, bytes) or not 0 <= self.place < len(data):
            return data
        struck = data[self.place] ^ self.mask
        return data[: self.place] + bytes((struck,)) + data[self.place + 1 :]


def steady(there: World) -> list[Register]:
    """Readable rows that do not change while nothing moves."""
    return [row for row in there.table(NODE).values() if row.readable and row.writable]


def asked_differently(there: World, rows: list[Register]) -> list[Register]:
    """One row for each request: where a reading brings all rows, one is enough."""
    told = {tuple(requests_for(there, NODE, row.name)): row for row in reversed(rows)}
    return list(told.values())


def truth(there: World, row: Register) -> int:
    return there.memory(NODE)[row.name]


def read(there: World, row: Register) -> int:
    value = there.device(NODE).read(row.name)[row.name]
    return row.to_raw(value)


def test_a_reply_with_a_changed_byte_is_asked_for_again(subject: Family) -> None:
    if subject.link.kind != "bytes":
        return
    line = Tampering()
    with world(subject, line=line) as there:
        for row in asked_differently(there, steady(there)):
            length = length_of_reply(there, row)
            for line.place in range(length):
                for line.mask in (0x01, 0x80, 0xFF):
                    line.fired, line.times = 0, 1
                    assert read(there, row) == truth(there, row), (row.name, line.place, line.mask)
                    assert line.fired == 1


def test_a_reply_that_is_always_wrong_is_an_error_and_no_value(subject: Family) -> None:
    if subject.link.kind != "bytes":
        return
    line = Tampering()
    with world(subject, line=line) as there:
        row = steady(there)[-1]
        device = there.device(NODE)
        device.read()
        for line.place in range(length_of_reply(there, row) if line_of(subject).checksum else HEAD):
            for line.mask in (0x01, 0x40, 0xFF):
                line.fired, line.times = 0, 1_000_000
                with pytest.raises(MotorbusError):
                    device.read(row.name)
                assert line.fired
                line.times = 0
                assert device.read(row.name)


def length_of_reply(there: World, row: Register) -> int:
    there.device(NODE).read(row.name)
    watch = there.bus.trace.subscribe()
    there.device(NODE).read(row.name)
    there.bus.trace.unsubscribe(watch)
    return len(payload([record.data for record in watch if record.direction == "rx"][-1]))


def requests_for(there: World, node: int, *names: str) -> list[Data]:
    """The frames that ask for this and nothing else, once the device is known: one, or two that take turns."""
    device = there.device(node)
    device.read(*names)
    with sent(there.bus) as frames:
        device.read(*names)
        device.read(*names)
    return sorted(frames[-2:])


def swapped(there: World, wanted: tuple[int, str], instead: tuple[int, str]) -> dict[Data, Data]:
    """For each form of the one request, the same form of the other."""
    return dict(zip(requests_for(there, *wanted), requests_for(there, *instead), strict=True))


def assert_never_taken(
    there: World, line: Tampering, instead: dict[Data, Data], device: Any, name: str
) -> None:
    line.instead, line.fired, line.times = instead, 0, 1_000_000
    with pytest.raises(MotorbusError) as raised:
        device.read(name)
    assert line.fired
    assert isinstance(raised.value, WireError | TimeoutError)
    line.times = 0
    assert there.table(NODE)[name].to_raw(device.read(name)[name]) == there.memory(NODE)[name]


class Babbling(PerfectLine):
    """Lets senseless frames come with every reply."""

    babble: tuple[Data, ...] = ()

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        real = super().carry(sender, data, at)
        senseless = [Delivery(at, Side.HOST, one) for one in self.babble] if sender is Side.DEVICE else []
        return [*senseless, *real, *senseless]


def test_senseless_frames_disturb_nobody_where_frames_stand_by_themselves(subject: Family) -> None:
    if subject.link.kind != "frames":
        return  # on a byte line they make a reply doubtful; the tests of the bus say how
    line = Babbling()
    with world(subject, line=line) as there:
        values = [there.device(node).read() for node in there.ids]
        line.babble = tuple(vector.data for vector in vectors(subject.name) if not vector.valid)
        with sent(there.bus) as frames:
            assert [there.device(node).read() for node in there.ids] == values
        assert len(frames) == len(set(frames)), "nothing had to be asked twice"
        assert line.babble


def test_the_answer_of_another_node_is_never_taken(shared: Family) -> None:
    line = Tampering()
    with world(shared, line=line) as there:
        device = there.device(NODE)
        device.read()
        for row in steady(there):
            instead = swapped(there, (NODE, row.name), (OTHER, row.name))
            assert_never_taken(there, line, instead, device, row.name)


def test_the_answer_to_another_question_is_never_taken(subject: Family) -> None:
    """Where frames say what they answer; on a byte line of FEETECH's kind they do not, and taint is what protects."""
    if subject.link.kind != "frames":
        return
    line = Tampering()
    with world(subject, line=line) as there:
        device = there.device(NODE)
        rows = steady(there)
        for row, other in zip(rows, [*rows[1:], rows[0]], strict=True):
            instead = swapped(there, (NODE, row.name), (NODE, other.name))
            assert_never_taken(there, line, instead, device, row.name)
