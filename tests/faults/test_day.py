"""Row D9: a day of jogging, dashboards, reconnects and configuration applied again writes nothing to EEPROM.

Done when 5 of the fault matrix. The day is virtual and lasts 24 hours in the long runs, ten minutes else.
"""

from __future__ import annotations

from contextlib import closing

import pytest

from tests.conftest import Figures, Rounds
from tests.faults.life import FAMILIES, Life

DAY = 86_400


def second(life: Life, number: int, reopen: int) -> None:
    """One second of a day: a dashboard asks, and from time to time somebody does something."""
    life.poll()
    if number % 60 == 7:
        life.jog()
    if number % 120 == 11:
        life.configure()
    if number % reopen == 17:
        life.reopen()
    if number % reopen == 19:
        life.unplug()
    life.rest(max(0.0, number + 1 - life.now))


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("family", FAMILIES)
def test_d9_a_day_writes_nothing_to_eeprom(family: str, rounds: Rounds, figures: Figures) -> None:
    seconds = rounds(DAY, 600)
    with closing(Life(family)) as life:
        worn = life.worn
        for number in range(seconds):
            second(life, number, 300)
        writes = life.worn - worn
        assert life.worn == worn == 0
        assert all(life.counts[what] for what in ("polls", "jogs", "configured", "opened", "unplugged"))
        assert life.wire.requests > seconds
        done = dict(life.counts)
    figures(
        "D9 jogging, dashboards, reconnects",
        family=family,
        hours=round(seconds / 3600, 2),
        eeprom_writes=writes,
        **done,
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_d9_the_counter_counts(family: str) -> None:
    """What must be 0 all day is not 0 when something is changed for good."""
    with closing(Life(family)) as life:
        if family == "feetech":
            life.devices[0].write(max_temperature=61)
        elif family == "kst":
            life.devices[0].set_travel_limits(-0.5, 0.5)
        else:
            life.devices[0].clear(1, expert=True)
        assert life.worn > 0
