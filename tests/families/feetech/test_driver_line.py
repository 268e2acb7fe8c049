"""Times of the line with their sources, the probe that cannot be confused, and the frames that stop."""

from __future__ import annotations

import pytest

from motorbus.core.operation import ANY, Answer, Due, Effect, Exchange, Rank, Timeout
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.feetech.driver.line import air_time, echo_test, probe, quiet_time, stop, turnaround
from tests.families.feetech.driver_script import ALL, READ, WRITE, Played, packet, reads

BYTES = bytes(8)


def test_air_is_ten_bits_a_byte_for_request_and_replies() -> None:
    exchange = read_block(Node(3), 56, 2, bytes)
    assert air_time(exchange, 1_000_000) == pytest.approx(160e-6)
    assert air_time(exchange, 38_400) == pytest.approx(16 * 10 / 38_400)
    train: Exchange[Answer] = Exchange(bytes(14), tuple(Due(id, id, 21) for id in range(6)))
    assert air_time(train, 1_000_000) == pytest.approx(1.4e-3)
    assert air_time(Exchange(bytes(56)), 1_000_000) == pytest.approx(560e-6)


def test_everyone_may_answer_a_broadcast() -> None:
    assert air_time(Exchange(bytes(6), ANY), 1_000_000) == pytest.approx((6 + 254 * 6) * 1e-5)
    assert turnaround(Exchange(bytes(6), ANY)) == 0.8


@pytest.mark.parametrize(
    ("timeout", "replies", "seconds"),
    [
        (Timeout.REPLY, 1, 0.001 + 508e-6),
        (Timeout.REPLY, 6, 0.001 + 6 * 508e-6),
        (Timeout.SCAN, 1, 0.010),
        (Timeout.STORE, 1, 0.100 + 508e-6),
    ],
)
def test_servos_may_think(timeout: Timeout, replies: int, seconds: float) -> None:
    dues = tuple(Due(id, id, 8) for id in range(replies))
    assert turnaround(Exchange(BYTES, dues, timeout=timeout)) == pytest.approx(seconds)


def test_quiet_is_forty_milliseconds_at_a_megabaud_and_longer_at_lower_rates() -> None:
    assert quiet_time(1_000_000) == pytest.approx(0.040, abs=0.0002)
    assert quiet_time(4_800) == pytest.approx(0.0375 + 259 * 10 / 4800, abs=0.0001)


def test_the_echo_of_the_echo_test_has_another_length_than_its_answer() -> None:
    test = echo_test()
    assert test.request == packet(1, READ, 5, 1)
    assert [len(test.request)] != [due.length for due in test.replies]  # type: ignore[union-attr]
    assert (test.timeout, test.effect) == (Timeout.SCAN, Effect.NONE)


def test_probes_are_of_many_lengths_and_never_that_of_their_echo_or_of_common_reads() -> None:
    lengths = {probe(3, attempt).replies[0].length for attempt in range(100)}  # type: ignore[index]
    assert len(lengths) >= 16
    assert not lengths & {6 + count for count in (0, 1, 2, 4, 5, 6, 7, 8, 11, 15, 40)}
    assert len(probe(3, 0).request) not in lengths


def test_probes_that_say_the_same_are_one_and_those_of_others_are_others() -> None:
    assert probe(3, 0) is probe(3, 17)
    assert len({probe(node, attempt).request for node in (3, 4) for attempt in range(34)}) == 34


def test_neighbouring_attempts_differ() -> None:
    lengths = [probe(3, attempt).replies[0].length for attempt in range(17)]  # type: ignore[index]
    assert len(set(lengths)) == 17


@pytest.mark.parametrize("attempt", range(17))
def test_a_probe_reads_the_id_first_and_stays_inside_the_eeprom(attempt: int) -> None:
    exchange = probe(3, attempt)
    assert isinstance(exchange.request, bytes)
    count = exchange.request[6]
    assert exchange.request[5] == 5
    assert 5 + count <= 40
    for id, right in ((3, True), (4, False)):
        played = Played([reads(3, 5, id, *[0] * (count - 1))])
        assert played.run(exchange) is right


def test_stop_is_torque_off_for_everyone_and_then_for_each() -> None:
    frames, promise = stop({4: None, 3: None})
    assert [frame.request for frame in frames] == [
        packet(ALL, WRITE, 40, 0),
        packet(3, WRITE, 40, 0),
        packet(4, WRITE, 40, 0),
    ]
    assert [frame.replies for frame in frames] == [(), (Due(3, 3, 6),), (Due(4, 4, 6),)]
    assert {(frame.rank, frame.effect) for frame in frames} == {(Rank.STOP, Effect.TORQUE)}
    assert "limp" in promise
    assert "sags" in promise
