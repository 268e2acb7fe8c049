"""Several FEETECH servos at once by common commands, of one map or of several."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech import cli
from motorbus.simulation.named import Simulation


@pytest.mark.parametrize("model", ["sts3215", "sts3215+scs0009+hls3925"])
def test_all_are_checked_before_the_first_moves(model: str) -> None:
    with motorbus.simulate("feetech", ids="1-3", model=model) as sim, motorbus.open(sim.url) as bus:
        servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2, 3)]
        trace = bus.trace.subscribe()
        with pytest.raises(LimitExceeded):
            cli.move_together(bus, {1: 2.5, 2: 2.0, 3: 99.0})
        sent = [one.data for one in trace if one.direction == "tx" and isinstance(one.data, bytes)]
        assert {data[4] for data in sent} <= {2, 0x82}  # reads
        cli.move_together(bus, {1: 2.5, 2: 2.0, 3: 3.0}, velocity=3.0)
        assert [servo.position() for servo in servos] == pytest.approx([2.5, 2.0, 3.0], abs=0.06)


def test_a_bound_without_a_register_is_refused() -> None:
    with (
        motorbus.simulate("feetech", ids="1-2", model="sts3215+scs0009") as sim,
        motorbus.open(sim.url) as bus,
        pytest.raises(RequestError, match="acceleration"),
    ):
        cli.move_together(bus, {1: 2.0, 2: 2.0}, acceleration=5.0)


def test_one_broadcast_finds_a_servo(arm: Simulation) -> None:
    arm[2].unplug()
    arm[3].unplug()
    with motorbus.open(arm.url) as bus:
        assert cli.ping_everyone(bus) == [1]
