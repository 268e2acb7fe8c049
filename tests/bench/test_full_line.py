"""Full lines: what they carry, when an answer is due, and that real simulators answer all of it."""

from __future__ import annotations

from itertools import islice
from random import Random

import pytest

from bench.full_line import (
    BYTE,
    LINES,
    NODES,
    RATE,
    SERVOS,
    Filled,
    can,
    exchanges,
    frames,
    passages,
    serial,
    share,
    told,
)
from motorbus.families.feetech import wire
from motorbus.families.kst.wire import decode_request


def test_every_part_of_the_answers() -> None:
    assert [share((1.0, 2.0, 3.0), part) for part in (0.0, 0.5, 1.0)] == [1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="no figures"):
        share((), 0.5)


def test_every_servo_is_given_a_goal_in_each_turn() -> None:
    first, *others = exchanges(Random(1))
    packets = wire.Splitter("instruction").feed(first.request)
    writes = [one for one in packets if isinstance(one, wire.InstructionPacket) and one.instruction == 0x83]
    orders = [wire.decode_sync_write(one.parameters) for one in writes]
    assert [id for order in orders if order for id, _ in order.items] == list(SERVOS)
    assert len(first.answers) == 251
    assert {sum(one.answers) for one in others} == {240, 630, 8}


def test_every_node_is_asked_four_times_for_each_goal() -> None:
    asked = [decode_request(frame) for frame in islice(frames(Random(1)), 5 * len(NODES))]
    kinds = [one.kind for one in asked if one]
    assert kinds == ["download"] * 127 + ["upload"] * 4 * 127
    assert [one.node for one in asked if one] == list(NODES) * 5


def test_a_reply_has_passed_after_its_request_the_turnaround_and_its_own_bits() -> None:
    (passed,) = passages([(2.0, 100)], [120], turnaround=0.0001)
    assert passed == pytest.approx(2.0 + 100 / RATE + 0.0001 + 120 / RATE)


def test_what_waits_for_the_wire_passes_one_after_the_other() -> None:
    passed = passages([(0.0, 100), (0.0, 100), (0.0, 100)], [100, 100, 100], turnaround=0.0)
    assert passed == pytest.approx([number * 100 / RATE for number in (4, 5, 6)])


def test_a_request_that_comes_later_waits_for_the_reply() -> None:
    passed = passages([(0.0, 100), (0.00015, 100)], [100, 100], turnaround=0.0)
    assert passed == pytest.approx([200 / RATE, 400 / RATE])


@pytest.mark.parametrize(("of", "answers"), [(serial, 251), (can, 127)])
def test_a_simulator_in_its_own_process_answers_a_full_line(of: type, answers: int) -> None:
    found = of(0.0)
    assert len(found.late) >= answers
    assert found.core > 0
    assert found.wire > 0
    assert list(found.late) == sorted(found.late)


def test_no_answer_comes_before_its_bytes_could() -> None:
    assert min(serial(0.1).late) > -BYTE


def test_what_was_found_in_a_line() -> None:
    assert told(Filled(0.25, 0.98, (1e-4, 2e-4))) == (
        "25.0% of a core, wire 98.0% full, 2 answers late by 50 % 100, 99 % 200, 99.9 % 200, all 200 µs"
    )
    assert [of for _, of in LINES] == [serial, can]
