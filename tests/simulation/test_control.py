"""The control socket: its orders and replies, and programs that send too much or do not read."""

from __future__ import annotations

import json
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from math import radians
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import families
from motorbus.errors import PortBusy, RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.session import open as open_bus
from motorbus.session import simulate as simulate_bus
from motorbus.simulation.control import WORDS, ControlSocket, carry_out
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Server, ServerThread
from tests.simulation.programs import LIMIT

OK = {"ok": True}
MIDDLE = radians(180)


def order(devices: Any, line: str) -> dict[str, Any]:
    """The reply to an order for these simulated devices."""
    server = Server(devices, rate=1_000_000)
    try:
        return carry_out(server, line)
    finally:
        server.close()


@contextmanager
def socket_of(path: Path, simulator: Any) -> Iterator[Server]:
    server = Server(simulator, rate=1_000_000)
    with closing(ControlSocket(path, server)), ServerThread(server):
        yield server


@contextmanager
def connected(path: Path) -> Iterator[socket.socket]:
    with closing(socket.socket(socket.AF_UNIX)) as connection:
        connection.settimeout(LIMIT)
        connection.connect(os.fspath(path))
        yield connection


# Orders.


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "not an order"),
        ("dance", "not an order"),
        ("status 1", "not an order"),
        ("unplug", "wrong arguments"),
        ("unplug 1 2", "wrong arguments"),
        ("unplug 9", "there is no device 9"),
        ("unplug x", "there is no device x"),
        ("push 1", "wrong arguments"),
        ("push 1 30", "has no unit"),
        ("push 1 30V", "measures voltage"),
        ("block 1 10deg", "wrong arguments"),
        ("load 1 much%", "not a number"),
        ("supply 1 nanV", "not a number"),
        ("set-input 1 1 on", "does not simulate"),
        ("faults 1%: dorp", "no kind 'dorp'"),
        ("faults at 1 s: unplug 1", "cannot be unplugged"),
    ],
)
def test_an_order_that_is_refused(line: str, message: str) -> None:
    bus = simulate((1,))
    port = PtyMaster()
    server = Server(bus, port, rate=1_000_000)
    reply = carry_out(server, line)
    server.close()
    assert message in reply["error"]
    assert bus.nodes[1].plugged


def test_help_and_status() -> None:
    help_ = order(simulate((2, 1)), "help")["help"]
    assert all(f"{word} ID" in help_ for word in WORDS)
    assert [node["id"] for node in order(simulate((2, 1)), "status")["nodes"]] == [1, 2]


def test_plugs_and_power() -> None:
    bus = simulate((1, 2))
    assert order(bus, "unplug 2") == OK
    assert (bus.nodes[1].plugged, bus.nodes[2].plugged) == (True, False)
    assert order(bus, "plug 0x2") == OK
    for node in bus.nodes.values():
        node.memory["torque_enable"] = 1
    assert order(bus, "power-cycle 1") == OK
    assert [node.memory["torque_enable"] for node in bus.nodes.values()] == [0, 1]
    assert order(bus, "power-cycle") == OK
    assert bus.nodes[2].memory["torque_enable"] == 0


def test_faults_are_set_shown_and_ended() -> None:
    server = Server(simulate((1,)), rate=1_000_000)
    assert carry_out(server, "faults seed 3; 1%: drop; exchange 4: echo") == {
        "ok": True,
        "faults": "seed 3; 1%: drop; exchange 4: echo",
        "count": 0,
        "fired": [],
        "pending": ["exchange 4: echo"],
    }
    assert carry_out(server, "faults")["faults"] == "seed 3; 1%: drop; exchange 4: echo"
    assert carry_out(server, "faults off")["faults"] == ""
    server.close()


def test_supply_and_heat_of_one_servo_raise_its_alarms() -> None:
    with simulate_bus("feetech", ids="1-2") as sim, open_bus(sim.url) as bus:
        first, second = (motorbus.feetech.Servo(bus, node) for node in (1, 2))
        assert order(sim.simulator, "supply 1 16V") == OK
        assert first.voltage() == 16.0
        assert any("voltage" in alarm for alarm in first.alarms())
        assert order(sim.simulator, "supply 1 7400mV") == OK
        assert order(sim.simulator, "heat 1 85C") == OK
        assert first.temperature() == pytest.approx(85, abs=1)
        assert any("temperature" in alarm or "heat" in alarm for alarm in first.alarms())
        assert second.alarms() == ()


@pytest.mark.parametrize("model", ["sts3215", "scs0009", "hls3925"])
def test_a_pushed_shaft_turns_and_returns_with_torque(model: str) -> None:
    with simulate_bus("feetech", model=model) as sim, open_bus(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        start = servo.position()
        assert order(sim.simulator, "push 1 -20deg") == OK
        assert servo.position() < start - radians(10)
        sim.wait(sim.now + 2.0)
        assert servo.position() == pytest.approx(start, abs=0.02)


def test_a_blocked_servo_raises_the_overload_alarm_and_a_released_one_moves() -> None:
    with simulate_bus("feetech") as sim, open_bus(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        assert order(sim.simulator, "block 1") == OK
        servo.move(radians(200), wait=False)
        sim.wait(sim.now + 5.0)
        assert any("overload" in alarm for alarm in servo.alarms())
        assert servo.position() == pytest.approx(MIDDLE, abs=0.01)
        assert order(sim.simulator, "release 1") == OK
        assert order(sim.simulator, "power-cycle 1") == OK
        servo.enable_torque()
        servo.move(radians(200))
        assert servo.position() == pytest.approx(radians(200), abs=0.01)


@pytest.mark.parametrize("settings", [{"phase": 0x80 | 12}, {"angular_resolution": 3}])
def test_angles_are_those_that_the_servo_reads(settings: dict[str, int]) -> None:
    with simulate_bus("feetech", position=1500) as sim, open_bus(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        for name, raw in settings.items():
            sim[1].memory[name] = raw
        sim[1].power_cycle()
        before = servo.position()
        for text in ("block 1 1deg 350deg", "push 1 40deg"):
            assert order(sim.simulator, text) == OK
        sim.wait(sim.now + 2.0)
        assert servo.position() == pytest.approx(before + radians(40), abs=0.01)


def test_loads_and_limits_of_a_shaft_end_with_release() -> None:
    with simulate_bus("feetech") as sim, open_bus(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        order(sim.simulator, "push 1 90deg")
        sim.wait(sim.now + 0.5)
        order(sim.simulator, "release 1")
        stopped = servo.position()
        sim.wait(sim.now + 2.0)
        assert MIDDLE < stopped == servo.position() < MIDDLE + radians(60)
        servo.enable_torque()
        for text, load in (("load 1 50%", 0.5), ("load 1 -25%", -0.25), ("release 1", 0.0)):
            assert order(sim.simulator, text) == OK
            assert servo.read("present_load")["present_load"] == pytest.approx(load, abs=0.01)


def test_devices_without_physics_refuse_orders() -> None:
    kst = families.load("kst").simulator((0x25,))
    assert order(kst, "load 0x25 50%") == OK
    assert order(kst, "heat 37 80C") == OK
    assert kst.nodes[0x25].status()["temperature"] == 80.0
    stepper = families.load("stepper").simulator((1,))
    for word in ("block 1", "push 1 30deg", "load 1 50%", "release 1", "supply 1 5V"):
        assert "does not simulate" in order(stepper, word)["error"]
    assert order(stepper, "set-input 1 1 on") == OK
    assert "error" in order(stepper, "set-input 1 99 on")


# The socket.


def test_many_orders_in_any_pieces_are_answered_in_order(tmp_path: Path) -> None:
    with socket_of(tmp_path / "control", simulate((1,))), connected(tmp_path / "control") as connection:
        assert stat.S_IMODE((tmp_path / "control").stat().st_mode) == 0o600
        lines = b"status\nhelp\nunplug 9\nfaults\n" * 50
        for start in range(0, len(lines), 7):
            connection.sendall(lines[start : start + 7])
        with connection.makefile() as replies:
            keys = [next(iter(json.loads(replies.readline()).items())) for _ in range(200)]
    assert [key for key, _ in keys] == ["ok", "ok", "error", "ok"] * 50


def test_a_program_that_does_not_read_is_dropped(tmp_path: Path) -> None:
    path = tmp_path / "control"
    with socket_of(path, simulate(range(1, 9))), connected(path) as silent:
        with pytest.raises(OSError, match="roken pipe|reset"):
            silent.sendall(b"status\n" * 100_000)
        with connected(path) as other, other.makefile() as replies:
            other.sendall(b"help\n")
            assert json.loads(replies.readline())["ok"] is True


def test_a_path_that_is_taken(tmp_path: Path) -> None:
    server = Server(simulate((1,)), rate=1_000_000)
    file, left = tmp_path / "file", tmp_path / "left"
    file.touch()
    with pytest.raises(RequestError, match="no socket"):
        ControlSocket(file, server)
    with pytest.raises(RequestError, match="control socket"):
        ControlSocket(tmp_path / ("x" * 120), server)
    with closing(socket.socket(socket.AF_UNIX)) as dead:
        dead.bind(os.fspath(left))
    control = ControlSocket(left, server)
    with pytest.raises(PortBusy):
        ControlSocket(left, server)
    control.close()
    control.close()
    assert not left.exists()
    server.close()
