"""A machine can be stopped while everything around its buses fails: polling, subscribers, the disk, a recorder."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

import motorbus
from motorbus import Robot
from motorbus.bus.trace import Subscription, TraceRecord
from motorbus.errors import MotorbusError
from tests.support.machines import machine
from tests.support.processes import Simulated
from tests.support.world import is_stopping

ROOT = Path(__file__).parents[2]
LONG = 60.0  # s until a test that hangs says so


def limp(sims: Any, *nodes: int) -> None:
    assert [sims["arm"][node].memory["torque_enable"] for node in nodes] == [0] * len(nodes)


def stops(robot: Robot, sims: Any, *nodes: int) -> None:
    """Stop, let go and emergency stop reach these servos."""
    names = [f"a{node}" for node in nodes]
    assert set(robot.stop(names).axes) == set(names)
    robot.disable_torque(names)
    limp(sims, *nodes)
    robot.enable_torque(names)
    assert set(robot.estop()["arm"].acknowledged) >= set(nodes)
    limp(sims, *nodes)
    robot.reset()


def test_15_polling_fails() -> None:
    real = {"arm": {"clock": "real"}}
    with machine(arm="1-3", options=real) as (config, sims), Robot(config) as robot:
        robot.enable_torque()
        sims["arm"][2].unplug()
        failing, over = Event(), Event()

        def poll() -> None:
            while not over.is_set():
                try:
                    robot.positions()
                except MotorbusError:
                    failing.set()

        poller = Thread(target=poll, daemon=True)
        poller.start()
        assert failing.wait(LONG)
        try:
            stops(robot, sims, 1, 3)
        finally:
            over.set()
            poller.join(LONG)


def test_15_a_watcher_never_reads() -> None:
    with machine(arm="1-3") as (config, sims), Robot(config) as robot:
        watcher = robot.buses["arm"].trace.subscribe(limit=1)
        robot.enable_torque()
        stops(robot, sims, 1, 2, 3)
        assert watcher.dropped > 10


class Recorder(Subscription[TraceRecord]):
    """A watcher that writes every record down at once, to where there is no room for it."""

    def __init__(self, file: int) -> None:
        super().__init__(1)
        self.file = file

    def put(self, record: TraceRecord) -> None:
        os.write(self.file, bytes(repr(record), "ascii"))


def test_15_a_recording_has_no_room_any_more() -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with machine(arm="1-3") as (config, sims), Robot(config) as robot:
        recorder = Recorder(writer)
        robot.buses["arm"].trace.add(recorder)
        robot.enable_torque()
        assert recorder.failure is None
        with suppress(BlockingIOError):
            while os.write(writer, bytes(4096)):
                pass
        stops(robot, sims, 1, 2, 3)
        assert isinstance(recorder.failure, OSError)
    os.close(reader)
    os.close(writer)


def test_15_whoever_asked_for_a_stop_has_gone_away(tmp_path: Path) -> None:
    with (
        Simulated("feetech", ids="1-2", link=tmp_path / "bus") as simulated,
        motorbus.open(simulated.bus) as bus,
    ):
        servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2)]
        for servo in servos:
            servo.enable_torque()
        place = bus.stopper.socket_path
        assert place is not None
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client:
            client.sendto(b"estop", str(place))
        for _ in range(int(LONG / 0.01)):
            if bus.latched and not is_stopping(bus):
                break
            Event().wait(0.01)
        assert [servo.read("torque_enable")["torque_enable"] for servo in servos] == [0, 0]
        assert set(bus.estop().acknowledged) == {1, 2}, "the stop thread is still there"


PROGRAM = """
import resource, sys
import motorbus
from motorbus.errors import MotorbusError

with motorbus.open(sys.argv[1]) as bus:
    servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2)]
    for servo in servos:
        servo.enable_torque()
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    try:
        with open(sys.argv[2], "w") as file:
            file.write("x" * 100)
        print("the disk is not full")
    except OSError:
        pass
    try:
        servos[0].set_id(9)
        print("changed without a journal")
    except (MotorbusError, OSError) as error:
        print("refused")
    print(servos[1].stop().name)
    servos[0].disable_torque()
    print(sorted(bus.estop().acknowledged))
    print([servo.read("torque_enable")["torque_enable"] for servo in servos])
"""


def test_15_the_disk_is_full(tmp_path: Path) -> None:
    """A process that may make no file any longer cannot keep a journal: it changes nothing, and it stops."""
    with Simulated("feetech", ids="1-2", link=tmp_path / "bus") as simulated:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, simulated.bus, str(tmp_path / "file")],
            env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "XDG_STATE_HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=LONG,
        )
    assert done.stdout.split("\n")[:4] == ["refused", "HOLD_ACCEPTED", "[1, 2]", "[0, 0]"], done.stderr
