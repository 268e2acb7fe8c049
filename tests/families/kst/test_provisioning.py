"""Provisioning of a servo: from the first read to the check after the restart, beside other servos, interrupted."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst import PowerCycleNeeded, Provisioned
from motorbus.families.kst.simulator import servo as simulated
from motorbus.link.memory import MemoryLink
from tests.families.kst.bench import Bench

CHANGES: list[dict[str, Any]] = [{"new_id": 9}, {"new_rate": 250_000}, {"new_id": 9, "new_rate": 1_000_000}]


class Timed(MemoryLink):
    """A link that calls `then` at the time `when` (s)."""

    when = inf
    then: Callable[[], object]

    def read(self, until: float) -> list[Data]:
        if self.now() >= self.when:
            self.when = inf
            self.then()
        return super().read(until)


@pytest.mark.parametrize("change", CHANGES, ids=str)
@pytest.mark.parametrize(
    "options",
    [{}, {"profile": "xqpower"}, {"settings": {"id_format": "ext"}, "id_format": "ext"}],
    ids=str,
)
def test_provision_writes_saves_and_verifies_after_the_restart(
    options: dict[str, Any], change: dict[str, Any]
) -> None:
    with Bench(**options) as bench:
        bench.on_power_cycle()
        node, rate = change.get("new_id", 5), change.get("new_rate", 500_000)
        result = bench.servo().provision(**change)
        assert result == Provisioned(node, rate, "V1.2", False)
        (servo,) = bench.simulator.servos
        assert (servo.node, servo.bit_rate) == (node, rate)
        assert bench.of(PowerCycleNeeded) == [PowerCycleNeeded(5, node, rate)]
        assert [event.done for event in bench.of(Progress)] == [0, 1, 2, 3, 4]
        assert (bench.bus.rate, bench.link.rate) == (500_000, 500_000)
        bench.sent()
        assert bench.servo().provision(**change) == result._replace(resumed=True)
        assert bench.written() == []


@pytest.mark.parametrize(
    ("ids", "duplicate", "change", "text"),
    [
        ((5, 9), "", CHANGES[0], r"0x09 \(9\) is taken"),
        ((5, 5), "", CHANGES[0], r"two servos .* 0x05 \(5\)"),
        ((5,), "5", CHANGES[0], r"two servos .* 0x05 \(5\)"),
        ((5, 6, 9), "", CHANGES[1], r"not alone: 0x06 \(6\), 0x09 \(9\) would stay at 500000"),
        ((6,), "", CHANGES[2], r"no servo answers as 0x05 \(5\) or 0x09 \(9\)"),
    ],
)
def test_provision_writes_nothing_where_it_would_do_harm(
    ids: tuple[int, ...], duplicate: str, change: dict[str, Any], text: str
) -> None:
    with Bench(*ids, duplicate=duplicate) as bench:
        bench.simulator.servos[-1].raw_position = 7
        with pytest.raises((RequestError, NoReply), match=text):
            bench.servo().provision(**change)
        assert bench.written() == []
        assert bench.bus.rate == bench.link.rate == 500_000


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_power_loss_during_the_save_is_never_reported_as_saved(
    change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulated, "FLASH_TIME", 2.0)
    with Bench() as bench:
        (servo,) = bench.simulator.servos
        bench.on_power_cycle()
        with pytest.raises(OutcomeUnknown, match="did not come back within 2 s") as raised:
            bench.servo().provision(**change, timeout=2.0)
        assert "before the flash was written" in raised.value.cause
        assert (servo.node, servo.bit_rate) == (5, 500_000)
        monkeypatch.undo()
        assert bench.servo().provision(**change).resumed is False


def test_id_written_before_is_not_saved_by_mistake() -> None:
    with Bench() as bench:
        bench.servo().set_node_id(7)
        bench.on_power_cycle()
        assert bench.servo().provision(new_rate=250_000).node == 5
        assert bench.simulator.servos[0].node == 5


@pytest.mark.parametrize(
    ("ids", "restarts", "error", "text"),
    [
        ((5, 9), False, OutcomeUnknown, "did not come back"),
        ((5, 9), True, VerificationFailed, r"two servos answer as 0x09 \(9\)"),
        ((5, 5), True, OutcomeUnknown, "did not come back"),
    ],
)
def test_servo_that_joins_during_the_restart_is_not_mistaken(
    ids: tuple[int, ...], restarts: bool, error: type[MotorbusError], text: str
) -> None:
    with Bench(*ids, link=Timed) as bench:
        first, second = bench.simulator.servos
        second.raw_position = 77
        second.unplug()

        def plug_both() -> None:
            first.plug()
            second.plug()

        def join() -> None:
            if restarts:
                first.unplug()
            bench.link.then = plug_both
            bench.link.when = bench.link.now() + 1.0

        bench.on_power_cycle(join)
        with pytest.raises(error, match=text) as raised:
            bench.servo().provision(new_id=9, timeout=2.0)
        assert raised.value.advice
        second.unplug()
        bench.on_power_cycle()
        assert bench.servo().provision(new_id=9)[:2] == (9, 500_000)
