"""Rows L1 and L2 toward the stepper controller: a request that is damaged is met with silence, and never obeyed amiss.

Its requests have a sum of 8 bits, as FEETECH packets have, and always eleven bytes. So a byte too many or too few never
makes another request of one, and a changed one does not get past the sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

from motorbus.families.stepper import wire
from motorbus.families.stepper.table import ORDERS
from motorbus.link.base import Line, PerfectLine, Side
from tests.conftest import Figures
from tests.families.stepper.fault_rig import MOTIONS, STOPS, Rig
from tests.families.stepper.test_single_faults import COMMANDS, ask
from tests.faults.single import EVERY, Overheard, Tally, every_fault, number_of, suffer

TELLING = (0x00, 0x5E)
LONGEST = 12.0
"""s of three tries at 9600 baud, one of them of a dump, their quiet times and probes."""


class Asked(Rig):
    """As `Rig`, with a line that can be changed."""

    def __init__(self) -> None:
        super().__init__(PerfectLine(), 1, pace=False)
        self.open()

    def put(self, line: Line) -> None:
        """Another line between host and controller."""
        self.link.line = line


def act(name: str) -> Callable[[Asked], None]:
    """This command once, judged; raises how it failed."""

    def once(rig: Asked) -> None:
        if not ask(rig, name):
            raise rig.errors[-1]

    return once


def at_rest(rig: Asked) -> None:
    rig.bus.run(rig.device_stop())


def another_request(heard: Overheard) -> bool:
    """Is there, in what the controller heard, a sound request that nobody has said?"""
    windows = (heard.heard[start : start + 11] for start in range(len(heard.heard) - 10))
    return any(
        data[:2] == b"\xff\xaa" and sum(data[:10]) & 0xFF == data[10] and data not in heard.said
        for data in windows
    )


def suffered(name: str, values: Iterable[int]) -> Tally:
    tally = suffer(
        Asked(),
        act(name),
        every_fault(wire.REQUEST_LENGTH, values, Side.DEVICE),
        before=at_rest if name in MOTIONS else lambda rig: None,
        at_most=LONGEST,
        misleading=another_request,
    )
    assert (tally.false, tally.misled) == (0, 0)
    if ORDERS[name].repeatable and name not in STOPS:
        assert tally.succeeded == tally.faults, "what may be said again gets over any single fault"
    else:
        assert 0 < tally.succeeded < tally.faults, "a byte too many in front does no harm"
    return tally


@pytest.mark.parametrize("name", COMMANDS)
def test_l1_l2_a_damaged_request_is_never_obeyed_amiss(name: str) -> None:
    values = TELLING[:1] if name == "read_project" else TELLING
    assert suffered(name, values).faults == number_of(wire.REQUEST_LENGTH, len(values))


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_l1_l2_every_fault_of_every_request(figures: Figures) -> None:
    total = succeeded = 0
    for name in COMMANDS:
        tally = suffered(name, EVERY if name != "read_project" else TELLING)
        total, succeeded = total + tally.faults, succeeded + tally.succeeded
    figures(
        "L1 L2 single byte faults, 27 commands, toward the device",
        family="stepper", faults=total, wrong=0, succeeded=succeeded,
    )  # fmt: skip
    assert total == 26 * number_of(11) + number_of(11, len(TELLING))
