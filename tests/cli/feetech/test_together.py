"""What common commands do with several FEETECH servos at once, of one map or of several."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli import feetech
from motorbus.errors import RequestError
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_moving_together_is_one_packet(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        trace = bus.trace.subscribe()
        feetech.move_together(bus, {1: 2.5, 2: 2.0, 3: 3.0}, velocity=3.0)
        sent = [
            record.data for record in trace if record.direction == "tx" and isinstance(record.data, bytes)
        ]
        sync_writes = [data for data in sent if data[4] == 0x83]
        assert len(sync_writes) == 1
        assert [motorbus.feetech.Servo(bus, node).position() for node in (1, 2, 3)] == [
            pytest.approx(2.5, abs=0.05),
            pytest.approx(2.0, abs=0.05),
            pytest.approx(3.0, abs=0.05),
        ]


def test_moving_together_takes_a_packet_for_each_layout_and_switches_torque_on() -> None:
    with (
        motorbus.simulate("feetech", ids="1-3", model="sts3215+scs0009+hls3925") as sim,
        motorbus.open(sim.url) as bus,
    ):
        trace = bus.trace.subscribe()
        feetech.move_together(bus, {1: 2.5, 2: 2.0, 3: 3.0}, velocity=3.0)
        sent = [one.data for one in trace if one.direction == "tx" and isinstance(one.data, bytes)]
        assert [data[5] for data in sent if data[4] == 0x83] == [41, 40]
        assert [motorbus.feetech.Servo(bus, node).position() for node in (1, 2, 3)] == [
            pytest.approx(2.5, abs=0.06),
            pytest.approx(2.0, abs=0.06),
            pytest.approx(3.0, abs=0.06),
        ]
        with pytest.raises(RequestError, match="no acceleration register"):
            feetech.move_together(bus, {1: 2.0, 2: 2.0}, acceleration=5.0)


def test_one_broadcast_finds_who_is_there(arm: Simulation) -> None:
    arm[2].unplug()
    arm[3].unplug()
    with motorbus.open(arm.url) as bus:
        assert feetech.ping_everyone(bus) == [1]


def test_a_servo_that_had_no_force_is_told_of(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1", model="hls3925") as simulation:
        simulation[1].memory["goal_torque"] = 0
        ran = run("move", f"{simulation.url}#1=3.0", "--yes")
        assert ran.code == 0
        assert "note: node 1 had a goal torque of 0" in ran.err
