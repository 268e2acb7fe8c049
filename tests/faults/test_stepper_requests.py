"""Rows L1 and L2 toward the stepper controller: a request that is damaged is met with silence, and never obeyed amiss.

Its requests have a sum of 8 bits, as FEETECH packets have, and always eleven bytes. So a changed one does not get past
the sum, and a byte too few never makes another request of one. A byte too many moves the others on: once in 256 times
the first eleven of twelve have a right sum by chance, and are another order, which is obeyed. Nobody on the host can
know that of an order by itself; who writes a project reads back what is held.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

from motorbus.families.stepper import wire
from motorbus.families.stepper.table import ORDERS
from motorbus.link.base import Line, PerfectLine, Side
from tests.conftest import Figures
from tests.faults.test_stepper_single_faults import COMMANDS, ask
from tests.support.rigs.stepper import MOTIONS, STOPS, Rig
from tests.support.single_faults import EVERY, Overheard, Tally, every_fault, number_of, suffer

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
    assert tally.false <= tally.misled, (
        "nothing is told that is not so, unless the controller heard another order"
    )
    if ORDERS[name].repeatable and name not in STOPS:
        assert tally.succeeded + tally.false == tally.faults, (
            "what may be said again gets over any other fault"
        )
    else:
        assert 0 < tally.succeeded < tally.faults, "a byte too many in front does no harm"
    return tally


@pytest.mark.parametrize("name", COMMANDS)
def test_l1_l2_a_damaged_request_is_never_obeyed_amiss(name: str) -> None:
    values = TELLING[:1] if name == "read_project" else TELLING
    tally = suffered(name, values)
    assert (tally.faults, tally.misled) == (number_of(wire.REQUEST_LENGTH, len(values)), 0)


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_l1_l2_every_fault_of_every_request(figures: Figures) -> None:
    total = succeeded = false = 0
    for name in COMMANDS:
        tally = suffered(name, EVERY if name != "read_project" else TELLING)
        total, succeeded, false = total + tally.faults, succeeded + tally.succeeded, false + tally.false
    figures(
        "L1 L2 single byte faults, 27 commands, toward the device",
        family="stepper", faults=total, wrong=false, succeeded=succeeded,
    )  # fmt: skip
    assert false < 26 * 11 * 256 / 256, "of the bytes too many, one in 256 passes at most"
    assert total == 26 * number_of(11) + number_of(11, len(TELLING))
