"""`motorbus simulate --faults`: by real processes, over every way in, before it is served and while it runs."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import motorbus
from motorbus.cli.exits import Exit
from motorbus.errors import LinkLost, MotorbusError, NoReply
from tests.cli.conftest import Run
from tests.support.processes import Simulated

PATIENCE = 30.0


class Control:
    """A control socket in a folder with a short name, for local sockets allow some hundred bytes."""

    def __init__(self) -> None:
        self.folder = TemporaryDirectory()
        self.path = str(Path(self.folder.name) / "control")

    def order(self, text: str) -> str:
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(PATIENCE)
            client.connect(self.path)
            client.sendall(f"{text}\n".encode())
            with client.makefile() as lines:
                return lines.readline().strip()

    def facts(self) -> Any:
        """What is set and what has happened."""
        return json.loads(self.order("faults"))

    def fired(self) -> list[str]:
        return [one["fault"] for one in self.facts()["fired"]]

    def __enter__(self) -> Control:
        return self

    def __exit__(self, *exc: object) -> None:
        self.folder.cleanup()


def lost(servo: Any) -> bool:
    """Whether nobody answers a read; a second try is not made by hand."""
    try:
        servo.position()
    except NoReply:
        return True
    return False


@contextmanager
def suffering(family: str, way: str, folder: Path) -> Iterator[tuple[Control, Any]]:
    """A device whose first answer is split, on a pseudo-terminal or TCP, with its control socket."""
    ways: dict[str, Any] = {"link": folder / family} if way == "link" else {"tcp": "0"}
    with (
        Control() as control,
        Simulated(family, faults="exchange 1: split 0.001", control=control.path, **ways) as simulated,
        motorbus.open(simulated.bus) as bus,
    ):
        yield control, bus


@pytest.mark.parametrize("way", ["link", "tcp"])
def test_a_serial_line_suffers_before_and_while_it_runs(way: str, tmp_path: Path) -> None:
    with suffering("feetech", way, tmp_path) as (control, bus):
        servo = motorbus.feetech.Servo(bus, 1)
        servo.position()
        assert control.fired() == ["exchange 1: split 0.001"]
        assert control.order("faults 100% to device: drop") == "ok"
        assert lost(servo)
        assert control.facts()["count"] > 1
        assert control.order("faults off") == "ok"
        servo.position()


@pytest.mark.parametrize("way", ["link", "tcp"])
def test_a_can_bus_suffers_whatever_adapter_is_before_it(way: str, tmp_path: Path) -> None:
    ways: dict[str, Any] = {"link": tmp_path / "can"} if way == "link" else {way: "0"}
    with (
        Control() as control,
        Simulated("kst", ids="0x25", faults="exchange 1: corrupt", control=control.path, **ways) as simulated,
        motorbus.open(simulated.bus) as bus,
    ):
        servo = motorbus.kst.Servo(bus, 0x25)
        for _ in range(2):  # it is broken once, and then it is not
            with suppress(MotorbusError):
                servo.position()
        assert control.fired() == ["exchange 1: corrupt"]
        servo.position()
        assert control.order("faults off") == "ok"


@pytest.mark.parametrize(("family", "way"), [("feetech", "tcp"), ("kst", "link")])
def test_a_pulled_port_is_lost_and_comes_back(family: str, way: str, tmp_path: Path) -> None:
    ways: dict[str, Any] = {"link": tmp_path / "arm"} if way == "link" else {"tcp": "0"}
    with Control() as control, Simulated(family, control=control.path, **ways) as simulated:
        port = simulated.bus
        with motorbus.open(port, reconnect="no") as bus:
            servo = getattr(motorbus, family).Servo(bus, 1)
            servo.position()
            assert control.order("faults exchange 1: unplug 0.2") == "ok"
            with pytest.raises(LinkLost):
                ask_until_lost(servo)
        assert control.fired() == ["exchange 1: unplug 0.2"]
        with opened_again(port) as bus:
            getattr(motorbus, family).Servo(bus, 1).position()


def ask_until_lost(servo: Any) -> None:
    """Ask; only a port that is gone is told, and that by the second question."""
    with suppress(NoReply):
        servo.position()
    servo.position()


def opened_again(port: str) -> Any:
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return motorbus.open(port)
        except MotorbusError:
            assert time.monotonic() < end, f"{port} did not come back"


def test_what_happens_is_said_on_stderr_and_at_the_end_how_to_have_it_again(tmp_path: Path) -> None:
    noise = tmp_path / "noise"
    noise.write_text("seed 7\n100%: duplicate  # and still it works\n")
    command = [sys.executable, "-m", "motorbus", "simulate", "feetech", "--link", str(tmp_path / "arm")]
    with subprocess.Popen(
        [*command, "--faults", str(noise)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("ready")
        descriptor = os.open(tmp_path / "arm", os.O_RDWR | os.O_NOCTTY)
        os.write(descriptor, bytes.fromhex("FFFF010201FB"))
        got = b""
        while len(got) < 12:
            got += os.read(descriptor, 64)
        os.close(descriptor)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert got == bytes.fromhex("FFFF010200FC") * 2
    lines = err.splitlines()
    assert lines[0] == "faults: seed 7"
    assert lines[1].endswith(" s  fault: exchange 1: duplicate")
    assert lines[2] == "faults: 1 happened, by the seed 7; the same again: --faults 'seed 7; 100%: duplicate'"
    assert process.returncode == 0


# A CAN bus that others have.


@pytest.mark.parametrize("bus", ["socketcan/can0", "slcan/dev/nothing"])
def test_faults_are_refused_on_a_can_bus_that_may_have_real_devices(
    bus: str, run: Run, tmp_path: Path
) -> None:
    flags = ["--can", bus, "--link", str(tmp_path / "can"), "--control", str(tmp_path / "control")]
    said = run("simulate", "kst", "--ids", "0x25", *flags, "--faults", "100%: echo")
    assert said.code == Exit.USAGE
    assert f"can://{bus}: faults are refused on a CAN bus that may have real devices" in said.err
    for word in ("vcan0", "--link", "--tcp"):
        assert word in said.err
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []  # nothing was opened or made


def test_an_order_for_faults_is_refused_on_such_a_bus_and_it_goes_on(tmp_path: Path) -> None:
    """The bus is another simulation behind an adapter: what is behind one, nobody can know."""
    with (
        Control() as control,
        Simulated("kst", ids="0x26", link=tmp_path / "adapter", tcp="0") as real,
        Simulated("kst", ids="0x25", can=f"slcan{tmp_path / 'adapter'}", control=control.path),
        motorbus.open(real.buses[1]) as bus,
    ):
        said = control.order("faults 100%: echo")
        assert said.startswith(f"error: can://slcan{tmp_path / 'adapter'}: faults are refused")
        assert control.order("faults off") == "ok"
        assert control.facts()["script"] == ""
        assert motorbus.kst.Servo(bus, 0x25).ping()
        assert motorbus.kst.Servo(bus, 0x26).ping()


# A stepper, whose line has one device and no check sum.
