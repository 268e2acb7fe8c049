"""What registers ask for is worked out once for all servos that hold the same, and for nobody else."""

from __future__ import annotations

from tests.simulators.feetech.host import Host, word
from tests.simulators.feetech.test_settings import LIMIT


def test_servos_with_the_same_registers_share_what_they_ask_for_until_one_is_told_otherwise() -> None:
    host = Host((1, 2, 3))
    first, second, third = host.bus.servos
    assert first.asked is second.asked is third.asked
    host.write(2, LIMIT, *word(100))
    assert second.asked.limit == 0.1
    assert first.asked.limit == third.asked.limit == 1.0
    host.write(2, LIMIT, *word(1000))
    assert second.asked.limit == 1.0
    assert [servo.id for servo in host.bus.servos] == [1, 2, 3]


def test_more_different_registers_than_are_kept_change_nothing() -> None:
    host = Host((1,))
    (servo,) = host.bus.servos
    for limit in [*range(600), 5]:
        host.write(1, LIMIT, *word(limit))
        assert servo.asked.limit == limit / 1000
