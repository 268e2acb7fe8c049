"""Rows L1 and L2 on the straight way of an event loop, at the end of a real pseudo-terminal.

What the far end says is struck while the loop awaits it; a value that comes of it is the true one.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any

import pytest

from motorbus import feetech
from motorbus.errors import MotorbusError
from tests.bus.struck import Landings
from tests.bus.test_glide import Far, run, there
from tests.faults.off import are_off

STEP = math.tau / 4096
MOST = 50
"""Questions until one goes straight and is struck: on a busy computer an answer may come in pieces."""
Change = Callable[[bytes], list[bytes]]


def other(data: bytes, place: int, by: int) -> list[bytes]:
    return [data[:place] + bytes((data[place] ^ by,)) + data[place + 1 :]]


def changed(place: int) -> list[Change]:
    """What may become of an answer at this byte: it, or a bit of it, is another one, lost, doubled, or one too many."""
    return [
        lambda data: other(data, place, 0x01),
        lambda data: other(data, place, 0xFF),
        lambda data: [data[:place] + data[place + 1 :]],
        lambda data: [data[:place] + data[place : place + 1] * 2 + data[place + 1 :]],
        lambda data: [data[:place] + b"\xff" + data[place:]],
    ]


class Striker:
    """Does the next change to what the far end says, as soon as that answers a flight that goes straight."""

    def __init__(self, far: Far, bus: Any) -> None:
        self.bus = bus
        self.fault: Change | None = None
        self.fired = 0
        far.change = self.change

    def change(self, data: bytes) -> list[bytes]:
        if self.fault is None or self.bus.turns.aloft is None or are_off():
            return [data]
        fault, self.fault = self.fault, None
        self.fired += 1
        return fault(data)


async def suffered(faults: list[Change], group: bool) -> None:
    """Each in turn: an error or the truth, and after it the truth."""
    async with there() as (far, bus, servo):
        servos = [servo, feetech.AsyncServo(bus, 2), feetech.AsyncServo(bus, 3)]
        for one in servos[1:]:
            await one.prepare()
        exchange, striker, raw = feetech.sync_read_positions(servos), Striker(far, bus), 100

        async def ask() -> None:
            nonlocal raw
            raw = 100 + (raw + 991) % 3000
            for id, simulated in far.simulator.nodes.items():
                simulated.raw_position = raw + 7 * id  # type: ignore[attr-defined]
            told = (await bus.run(exchange)).values if group else {1: await servo.position()}
            assert {id: round(value / STEP) for id, value in told.items()} == {
                id: raw + 7 * id for id in told
            }

        for striker.fault in faults:
            for _ in range(MOST):
                with contextlib.suppress(MotorbusError):
                    await ask()
                if striker.fault is None:
                    break
            await ask()
        assert striker.fired == len(faults), "not each of them struck a flight that went straight"


@pytest.mark.parametrize("place", [2, 4, 5, 6, 7])
def test_l1_l2_a_damaged_answer_that_is_awaited_is_no_value(
    place: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    landings = Landings(monkeypatch)
    run(lambda: suffered(changed(place), group=False))
    assert len(landings.ids) > 0


def test_l1_a_damaged_answer_of_a_group_that_is_awaited_is_no_value(monkeypatch: pytest.MonkeyPatch) -> None:
    landings = Landings(monkeypatch)
    run(lambda: suffered([fault for place in (5, 6, 14, 22) for fault in changed(place)[:2]], group=True))
    assert len(landings.ids) > 0
