"""A servo that loses its supply in mid-motion, over a real port: at fault, and silence about torque and motion.

The simulator is a process of its own behind a pseudo-terminal, its supply is cut through its control socket, and what
left the host is read from the trace of the bus.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from motorbus.motion.safety.restarts import FaultNoted
from motorbus.session.robot import Robot
from tests.safety.test_restarts import moving_or_giving_torque

from motorbus.errors import Faulted, Refused
from tests.safety.decoders import READ
from tests.support.machines import described
from tests.support.processes import Simulated


class Served(NamedTuple):
    """The file of a machine, and the control socket of the simulator behind its only bus."""

    file: Path
    control: Path

    def cut_supply(self, node: int) -> None:
        """Take the supply of a servo away for a moment."""
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(self.control))
            client.sendall(f"power-cycle {node}\n".encode())
            assert client.makefile().readline() == '{"ok": true}\n'


@pytest.fixture(params=["sts3215", "sm85blhv"])
def served(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Served]:
    """Three servos in a process of their own, whose torque comes back with the next goal, or does not."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    control, file = tmp_path / "a.sock", tmp_path / "motorbus.toml"
    switches: dict[str, Any] = {"control": str(control), "model": str(request.param), "servo-baud": "1000000"}
    with Simulated("feetech", ids="1-3", link=tmp_path / "arm", **switches) as arm:
        file.write_text(described({"arm": arm.bus}, "1-3", "", False, {}, {}), encoding="utf-8")
        yield Served(file, control)


def test_a_servo_that_loses_its_supply_in_mid_motion_is_at_fault_and_is_told_nothing_more(
    served: Served,
) -> None:
    seen: list[float] = []
    cut: list[float] = []

    def report(event: object) -> None:
        now = robot.buses["arm"].link.now()
        if isinstance(event, FaultNoted):
            seen.append(now)
        elif not cut and now > began + 0.8:  # progress of the movement
            served.cut_supply(2)
            cut.append(robot.buses["arm"].link.now())

    with Robot.load(served.file, report=report) as robot:
        sent = robot.buses["arm"].trace.subscribe(limit=1_000_000)
        began = robot.buses["arm"].link.now()
        with pytest.raises(Faulted, match="a2 is at fault: arm#2 has restarted") as told:
            robot.move({"a1": 0.3, "a2": 0.3, "a3": -0.3}, duration=4.0)  # slow, for time is real
        assert told.value.reason == "restart"
        assert set(robot.faults) == {"a2"}
        for order in (lambda: robot.move({"a2": 0.0}), lambda: robot.enable_torque("a2")):
            with pytest.raises(Refused, match="a2 is at fault"):
                order()
        robot.move({"a1": 0.0, "a3": 0.0}, duration=3.0)
    (moment,), (lost,) = seen, cut
    frames = [record for record in sent if record.direction == "tx"]
    assert any(moving_or_giving_torque(record.data, 2) for record in frames if record.at < lost)
    heard = [record.data for record in frames if lost < record.at <= moment]
    looks = [data for data in heard if isinstance(data, bytes) and data[2:7] == bytes((2, 4, READ, 40, 31))]
    assert 1 <= len(looks) <= 2
    assert [one for one in frames if one.at > moment and moving_or_giving_torque(one.data, 2)] == []
