"""A servo on a real port that loses its supply in the middle of a move: its axis is at fault and gets no torque."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any, NamedTuple

import pytest

from motorbus import Robot
from motorbus.core.request import Data
from motorbus.errors import Faulted, Refused
from motorbus.motion.commands import Move, Torque
from tests.support.machines import file_text
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
        file.write_text(file_text({"arm": arm.bus}, "1-3"), encoding="utf-8")
        yield Served(file, control)


def test_a_servo_that_loses_its_supply_is_at_fault_and_gets_no_torque(served: Served) -> None:
    with Robot.load(served.file) as robot:
        bus = robot.buses["arm"]
        sent = bus.trace.subscribe(limit=1_000_000)

        def cut_supply() -> None:
            while (robot.axes["a2"].status.known_position or 0.0) < 0.1:
                Event().wait(0.01)
            served.cut_supply(2)

        cutter = Thread(target=cut_supply)
        cutter.start()
        with pytest.raises(Faulted, match="a2: arm#2 has restarted") as caught:
            robot.move({"a1": 0.3, "a2": 0.3, "a3": -0.3}, duration=4.0)  # slow, for time is real
        moment = bus.link.now()
        cutter.join()
        assert caught.value.reason == "restart"
        assert set(robot.faults) == {"a2"}
        for command in (Move({"a2": 0.0}), Torque(on=True, names=("a2",))):
            with pytest.raises(Refused, match="a2 is at fault"):
                robot.execute(command)
        robot.move({"a1": 0.0, "a3": 0.0}, duration=3.0)
    frames = [record for record in sent if record.direction == "tx"]
    assert any(moves_or_gives_torque(record.data, 2) for record in frames if record.at < moment)
    assert [one for one in frames if one.at > moment and moves_or_gives_torque(one.data, 2)] == []


def moves_or_gives_torque(data: Data, node: int) -> bool:
    """A write of torque, goal position or goal velocity of this servo, alone or in a SYNC WRITE."""
    if not isinstance(data, bytes) or data[4] not in (3, 4, 0x83) or data[5] not in range(40, 48):
        return False
    if data[4] != 0x83:
        return data[2] == node and not (data[5] == 40 and data[6] == 0)
    return node in data[7 : -1 : data[6] + 1]
