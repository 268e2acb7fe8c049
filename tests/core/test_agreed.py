"""Read until two readings in a row agree, and give up after a limit."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from motorbus.core.agreed import READINGS, agreed
from motorbus.errors import VerificationFailed


def judged(values: Iterator[int]) -> int:
    """Carries `agreed` out over these readings, none of which needs a bus."""

    async def reading() -> int:
        return next(values)

    with pytest.raises(StopIteration) as end:
        agreed(reading, node=3, what="position").send(None)
    value: int = end.value.value
    return value


@pytest.mark.parametrize(
    ("readings", "left"), [([5, 5, 6], [6]), ([5, 6, 6, 7], [7]), ([1, 2, 1, 2, 3, 3], []), ([9, 9], [])]
)
def test_the_first_two_in_a_row_that_agree_are_the_result(readings: list[int], left: list[int]) -> None:
    values = iter(readings)
    agreed_on = judged(values)
    assert list(values) == left
    assert agreed_on == readings[len(readings) - len(left) - 1]


def test_what_changes_all_the_time_is_not_read_for_ever() -> None:
    values = iter(range(100))
    with pytest.raises(VerificationFailed, match="6 and 7") as raised:
        judged(values)
    assert next(values) == READINGS
    assert raised.value.node == 3
