"""A year of three buses in virtual time, and what must hold at the end of each hour of it.

Every five minutes a dashboard asks; every hour something moves, the adapter is pulled a dozen times, programs end and
begin; every day the computer sleeps, its clock is set, the supply dips and the same configuration is applied. A
millisecond counter of 32 bits wraps seven times in it. In the long runs it lasts 365 days and sees 100 000 unplugs;
else one day. It polls no more often than that because a year must pass within twenty minutes of a processor.
"""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack, closing

import pytest

from tests.conftest import Figures, Rounds
from tests.faults.life import FAMILIES, Life, footprint, held

HOUR, DAYS = 3600.0, 365
POLL = 300.0
"""s from one poll to the next."""
WRAP = 2**32 / 1000
"""s after which a counter of milliseconds of 32 bits begins anew."""
UNPLUGS = {"feetech": 5, "kst": 4, "stepper": 3}
"""In an hour; 12 * 8760 in a year."""
NIGHT = 8 * HOUR
MIB_IN_30_DAYS = 1.0


def hour(life: Life, number: int) -> None:
    """One hour of one bus."""
    end = life.now + HOUR
    while life.now < end - POLL:
        life.poll()
        life.rest(POLL)
    for _ in range(UNPLUGS[life.family]):
        life.unplug()
    if number % (6 if life.family == "stepper" else 1) == 0:
        life.jog()
    if number % 4 == 1:
        life.reopen()
    life.rest(max(0.0, end - life.now))


def day(life: Life, number: int) -> None:
    """What happens once in a day."""
    life.brown_out()
    life.configure()
    life.rest(NIGHT if number % 2 else 86_400.0 / 4)  # it sleeps, or its clock is set ahead
    life.awaited()


@pytest.mark.timeout(3600)
def test_d9_l15_a_year(rounds: Rounds, figures: Figures) -> None:
    days = rounds(DAYS, 1)
    counts: Counter[str] = Counter()
    wraps = 0.0
    with ExitStack() as stack:
        lives = [stack.enter_context(closing(Life(family))) for family in FAMILIES]
        before = footprint()
        for number in range(days * 24):
            for life in lives:
                hour(life, number)
                assert life.balances()
                assert life.worn == 0
            if number % 24 == 23:
                for life in lives:
                    day(life, number // 24)
            if number == min(23, days * 24 - 2):
                before = footprint()  # the first day has filled what is filled once
            elif number > 23:
                assert held()[0] <= before.descriptors
                assert held()[1] <= before.threads
        after = footprint()
        assert held()[0] <= before.descriptors
        for life in lives:
            counts += life.counts
            assert life.worn == 0
            wraps = life.now // WRAP
    worn = sum(life.worn for life in lives)
    months = max(1.0, (days - 1) / 30)
    growth = (after.kib - before.kib) / 1024 / months
    assert growth <= (MIB_IN_30_DAYS if days > 1 else 4)
    assert counts["unplugged"] == sum(UNPLUGS.values()) * 24 * days
    figures(
        "A year in virtual time" if days == DAYS else "A day in virtual time",
        days=days,
        wraps_of_a_32_bit_millisecond=int(wraps),
        eeprom_writes=worn,
        descriptors=after.descriptors - before.descriptors,
        threads=after.threads - before.threads,
        mib_in_30_days=round(growth, 3),
        unplugged=counts["unplugged"],
        polls=counts["polls"],
        jogs=counts["jogs"],
        opened=counts["opened"],
        brown_outs=counts["brown-outs"],
    )
