"""Driver and simulator agree about every row: what is read is what is there, what is written is there afterwards."""

from __future__ import annotations

import pytest

from motorbus.core.family import Family
from motorbus.core.register import Register, Storage
from motorbus.errors import RequestError
from tests.support.world import IDS, World, kept, plain, samples, sent, world

NODE = IDS[0]


def write(there: World, row: Register, raw: int) -> None:
    there.device(NODE).write(**{row.name: row.to_value(raw)})


def wrong_after(there: World, row: Register, raw: int) -> str:
    """Write it; "" when the memory and the next reading agree that it is there."""
    write(there, row, raw)
    held = there.memory(NODE)[row.name]
    read = there.device(NODE).read(row.name)[row.name]
    return "" if held == raw == row.to_raw(read) else f"{raw} written, {held} held, {read} read"


def test_every_readable_row_reads_as_it_is(subject: Family) -> None:
    with world(subject) as there:
        for node in there.ids:
            table = there.table(node)
            names = [row.name for row in table.values() if row.readable]
            values = there.device(node).read(*names)
            raws = {name: table[name].to_raw(value) for name, value in values.items()}
            assert raws == {name: there.memory(node)[name] for name in names}
        device = there.device(NODE)
        together = device.read()
        assert set(together) == {row.name for row in there.table(NODE).values() if row.readable}
        alone = {name: value for row in together for name, value in device.read(row).items()}
        assert alone == pytest.approx(together)


def test_every_plain_row_takes_values_up_to_both_ends(plain_one: Family) -> None:
    with world(plain_one) as there:
        rows = plain(there.table(NODE))
        assert rows
        for row in rows:
            assert {raw: wrong for raw in samples(row) if (wrong := wrong_after(there, row, raw))} == {}, (
                row.name
            )


def test_every_kept_row_takes_values_up_to_both_ends_and_outlives_a_power_cut(writer: Family) -> None:
    with world(writer) as there:
        rows = kept(there.table(NODE))
    assert rows or not [row for row in writer.registers.values() if "lock" in row]
    for row in rows:
        for raw in samples(row):
            with world(writer) as there:
                assert wrong_after(there, row, raw) == "", row.name
                there.simulator.nodes[NODE].power_cycle()
                assert there.memory(NODE)[row.name] == raw, row.name


def test_what_is_not_kept_is_as_shipped_after_a_power_cut(writer: Family) -> None:
    with world(writer) as there:
        rows = [row for row in plain(there.table(NODE)) if row.storage is Storage.RAM]
        before = {row.name: there.memory(NODE)[row.name] for row in rows}
        for row in rows:
            write(there, row, row.high if before[row.name] != row.high else row.low)
        there.simulator.nodes[NODE].power_cycle()
        assert {row.name: there.memory(NODE)[row.name] for row in rows} == before


def test_writing_one_node_changes_no_other(writer: Family) -> None:
    with world(writer) as there:
        others = {node: settings for node, settings in there.settings().items() if node != NODE}
        for row in (*plain(there.table(NODE)), *kept(there.table(NODE))):
            write(there, row, samples(row)[-1])
        assert {node: settings for node, settings in there.settings().items() if node != NODE} == others


def refused(there: World, name: str, value: float) -> None:
    """It raises RequestError, changes nothing, and once the device is known not a frame leaves."""
    device = there.device(NODE)
    before = there.settings()
    device.read()
    with sent(there.bus) as frames, pytest.raises(RequestError, match=name):
        device.write(**{name: value})
    assert (frames, there.settings()) == ([], before)


def test_what_can_only_be_read_refuses_to_be_written(writer: Family) -> None:
    with world(writer) as there:
        rows = [row for row in there.table(NODE).values() if not row.writable]
        assert rows
        for row in rows:
            refused(there, row.name, row.to_value(row.high))


KNOWN = "homing_offset"
"""Written by name where it is known, as from a file of LeRobot; see the tests of the family."""


def test_d8_what_is_protected_refuses_to_be_written_by_name(writer: Family) -> None:
    with world(writer) as there:
        for row in there.table(NODE).values():
            if row.protected and row.writable and row.name != KNOWN:
                refused(there, row.name, row.to_value(row.high))


def test_what_is_out_of_range_refuses_to_be_written(writer: Family) -> None:
    with world(writer) as there:
        table = there.table(NODE)
        for row in (*plain(table), *kept(table)):
            for raw in (row.low - 1, row.high + 1):
                refused(there, row.name, row.to_value(raw))
            refused(there, row.name, float("nan"))
        refused(there, "no_such_row", 1)
        with sent(there.bus) as frames, pytest.raises(RequestError, match="no_such_row"):
            there.device(NODE).read("no_such_row")
        assert frames == []


def test_one_bad_value_among_good_ones_keeps_all_back(plain_one: Family) -> None:
    with world(plain_one) as there:
        device, before = there.device(NODE), there.settings()
        row = plain(there.table(NODE))[0]
        good = next(raw for raw in samples(row) if raw != before[NODE][row.name])
        with pytest.raises(RequestError):
            device.write(**{row.name: row.to_value(good), "no_such_row": 1})
        assert there.settings() == before


def test_ids_that_no_device_can_have_are_refused(subject: Family) -> None:
    with world(subject) as there:
        for node in (-1, 1 << 20):
            with sent(there.bus) as frames, pytest.raises(RequestError):
                there.device(node).ping()
            assert frames == []
