"""A confirmed position is one that two consecutive readings agree on."""

from __future__ import annotations

from math import tau

import pytest

from motorbus.errors import VerificationFailed
from motorbus.families.feetech.driver import position
from motorbus.families.feetech.driver.feedback import READINGS
from tests.families.feetech.driver_script import Line, low_high, play, prepared, reads


def readings(*counts: int) -> list[Line]:
    """READ of the present position of servo 3."""
    return [reads(3, 56, *low_high(count)) for count in counts]


@pytest.mark.parametrize("counts", [(1024, 1024), (5, 1024, 1024), (1024, 5, 1024, 5, 1024, 1024)])
def test_confirmed_position_is_first_that_two_consecutive_readings_agree_on(counts: tuple[int, ...]) -> None:
    found = play(position(prepared(), confirmed=True), *readings(*counts))
    assert found == pytest.approx(1024 * tau / 4096)


def test_confirmed_position_of_moving_shaft_raises_after_limit() -> None:
    with pytest.raises(VerificationFailed, match="of 8 readings") as raised:
        play(position(prepared(), confirmed=True), *readings(*range(READINGS)))
    assert raised.value.node == 3
