"""How long silence is waited for in a scan: no longer than a device needs where nothing holds bytes back."""

from __future__ import annotations

import pytest

from motorbus.bus.pace import DIRECT, MARGIN
from motorbus.core.operation import Timeout
from motorbus.families.feetech.driver.line import PROCESSING, RETURN_DELAY, SCAN
from tests.bus.script import Script, ping, position, reply

AIR = 12 * 10 / 1_000_000


def waited(script: Script) -> float:
    """s from the request to the moment at which silence is an answer."""
    begun = script.now
    script.sent()
    return script.turns.due() - begun


@pytest.mark.parametrize("latency", [0.0, 0.0005])
def test_without_an_adapter_it_is_what_a_servo_needs_for_any_answer(latency: float) -> None:
    script = Script(latency=latency)
    script.submit(ping(3))
    assert waited(script) == pytest.approx(AIR + PROCESSING + RETURN_DELAY + latency)


@pytest.mark.parametrize("latency", [DIRECT, 0.004])
def test_with_one_it_is_as_long_as_ever(latency: float) -> None:
    script = Script(latency=latency)
    script.submit(ping(3))
    assert waited(script) == pytest.approx(AIR + SCAN + latency + MARGIN[Timeout.SCAN])


def test_what_is_no_scan_keeps_its_margin() -> None:
    script = Script(latency=0.0)
    script.submit(position(3))
    assert waited(script) > PROCESSING + RETURN_DELAY + MARGIN[Timeout.REPLY]


def test_a_host_that_is_late_still_takes_the_answer() -> None:
    """What had arrived before it looked counts, for only what was due before the look is overdue after it."""
    script = Script(latency=0.0)
    flight = script.submit(ping(3))
    script.sent()
    looked, script.now = script.now + 0.0005, script.now + 0.5
    script.turns.feed([reply(3)[:2] + bytes((3, 2, 0, 0xFA))], script.now, looked)
    assert flight.done
    assert flight.error is None
