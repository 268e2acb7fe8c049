"""Simulated devices for any program: on a terminal or a socket, under control, and tidy when they end."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.support.processes import Simulated

PING, PONG = bytes.fromhex("FFFF0102 01FB"), bytes.fromhex("FFFF0102 00FC")


@pytest.mark.parametrize("number", [signal.SIGTERM])
def test_it_ends_cleanly_and_takes_its_files_with_it(number: signal.Signals, tmp_path: Path) -> None:
    link, control = tmp_path / "bus", tmp_path / "control"
    with Simulated("feetech", ids="1-2", link=link, control=str(control)) as simulated:
        assert link.is_symlink()
        assert stat.S_IMODE(control.stat().st_mode) == 0o600
        simulated.process.send_signal(number)
        out, err = simulated.process.communicate(timeout=30)
        assert (simulated.process.returncode, out, err) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_any_program_can_open_the_terminal(tmp_path: Path) -> None:
    with Simulated("feetech", link=tmp_path / "bus"):
        descriptor = os.open(tmp_path / "bus", os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(descriptor, PING)
            answer = b""
            while len(answer) < len(PONG):
                answer += os.read(descriptor, 64)
            assert answer == PONG
        finally:
            os.close(descriptor)


def test_without_a_link_the_terminal_is_named() -> None:
    with Simulated("feetech") as simulated, motorbus.open(simulated.bus) as bus:
        assert simulated.bus.startswith("feetech:/dev/")
        assert motorbus.feetech.Servo(bus, 1).ping()


@pytest.mark.parametrize("endpoint", [":0"])
def test_a_socket_is_for_this_machine_unless_said_otherwise(endpoint: str) -> None:
    with Simulated("feetech", ids="1", tcp=endpoint) as simulated:
        _, _, host, port = simulated.bus.replace("//", "").split(":")
        assert host == "127.0.0.1"
        with socket.create_connection((host, int(port)), timeout=30) as client:
            client.sendall(PING)
            assert client.recv(64) == PONG


def test_it_is_poked_while_it_runs(tmp_path: Path) -> None:
    control = tmp_path / "control"
    with (
        Simulated("feetech", ids="1-2", link=tmp_path / "bus", control=str(control)) as simulated,
        motorbus.open(simulated.bus) as bus,
        socket.socket(socket.AF_UNIX) as client,
    ):
        client.settimeout(30)
        client.connect(str(control))
        lines = client.makefile("rw")

        def order(text: str) -> str:
            lines.write(f"{text}\n")
            lines.flush()
            return lines.readline().strip()

        assert len(json.loads(order("status"))["nodes"]) == 2
        assert motorbus.feetech.Servo(bus, 2).ping()
        assert order("unplug 2") == "ok"
        assert not motorbus.feetech.Servo(bus, 2).ping()


def test_a_switch_changes_how_they_behave(tmp_path: Path, run: Run) -> None:
    with Simulated("feetech", ids="1-3", link=tmp_path / "bus", switch="broadcast_ping=in_turn") as simulated:
        found = run("ping", simulated.bus, "--broadcast", "--json").document["devices"]
    assert [one["id"] for one in found] == [1, 2, 3]


def test_a_ready_line_for_people(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "motorbus", "simulate", "feetech", "--ids", "1-6"]
    with subprocess.Popen(
        [*command, "--link", str(tmp_path / "bus")], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        process.terminate()
    assert line == f"ready: feetech:{tmp_path / 'bus'}  (simulated: 6 feetech devices, ids 1-6)\n"
    assert process.returncode == 0


def test_devices_that_ship_with_another_rate_are_opened_by_the_address_of_the_ready_line(run: Run) -> None:
    with Simulated("feetech", ids="3", model="sm85blhv", tcp="0") as simulated:
        assert simulated.bus.endswith(",baud=115200")
        assert run("ping", f"{simulated.bus}#3", "--json").document["devices"][0]["answers"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["nobody"], 2),
        (["feetech", "--model", "abacus"], 2),
        (["feetech", "--ids", "254"], 2),
        (["feetech", "--ids", "x"], 2),
        (["feetech", "--switch", "gravity=off"], 2),
        (["feetech", "--switch", "gravity"], 2),
        (["feetech", "--gravity", "off"], 2),
        (["feetech", "--gravity"], 2),
        (["feetech", "--can", "virtual/x"], 2),
        (["feetech", "--bitrate", "500000"], 2),
        (["feetech", "--baud", "-1"], 2),
        (["kst", "--baud", "500000"], 2),
        (["kst", "--bitrate", "123456"], 2),
        (["kst", "--bitrate", "300k"], 2),
        (["kst", "--bitrate", "fast"], 2),
        (["kst", "--ids", "0"], 2),
        (["kst", "--profile", "abacus"], 2),
        (["kst", "--out-of-range", "explode"], 2),
        (["kst", "--can", "nowhere/x"], 2),
        (["feetech", "--tcp", "0", "--link", "bus"], 2),
        (["feetech", "--tcp", "somewhere"], 2),
        (["feetech", "--link", "/no/such/folder/bus"], 1),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else str(value),
)
def test_what_cannot_be_served(words: list[str], code: int, run: Run) -> None:
    ran = run("simulate", *words)
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")


def test_a_port_that_is_taken_is_busy(run: Run) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert run("simulate", "feetech", "--tcp", str(taken.getsockname()[1])).code == 4


def test_a_link_that_is_somebody_elses_stays(tmp_path: Path, run: Run) -> None:
    (tmp_path / "bus").write_text("precious")
    assert run("simulate", "feetech", "--link", str(tmp_path / "bus")).code == 2
    assert (tmp_path / "bus").read_text() == "precious"


# CAN.

READ = b"t62584002600000000000"
POSITION = b"t5A584B02600000000000\r"


def asked(descriptor: int, text: bytes, count: int) -> bytes:
    """What comes back to these words, so many bytes of it."""
    os.write(descriptor, text)
    answer = b""
    while len(answer) < count:
        answer += os.read(descriptor, 256)
    return answer


def slcan(descriptor: int) -> bytes:
    """Open the adapter and read the position of node 37."""
    asked(descriptor, b"C\rS6\rO\r", 3)
    return asked(descriptor, READ + b"\r", 24).removeprefix(b"z\r")


def test_a_can_bus_is_served_in_every_way_at_once(tmp_path: Path) -> None:
    link = tmp_path / "can"
    with Simulated("kst", ids="0x25,0x26", link=link, tcp="0") as simulated:
        assert simulated.ready["ids"] == [0x25, 0x26]
        one, other = simulated.buses
        assert simulated.bus == one == f"kst:can://slcan{link}"
        terminal = os.open(link, os.O_RDWR | os.O_NOCTTY)
        try:
            assert slcan(terminal) == POSITION
        finally:
            os.close(terminal)
        host, _, port = other.removeprefix("kst:can://slcan/socket://").rpartition(":")
        with socket.create_connection((host, int(port))) as client:
            assert slcan(client.fileno()) == POSITION


def test_without_a_way_a_can_bus_is_on_a_terminal() -> None:
    with Simulated("kst", ids="37") as simulated:
        assert simulated.buses == [simulated.bus]
        path = simulated.bus.removeprefix("kst:can://slcan")
        assert path.startswith("/dev/")
        terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
        try:
            assert slcan(terminal) == POSITION
        finally:
            os.close(terminal)


def test_a_relative_link_is_named_in_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Simulated("kst", ids="37", link=Path("can")) as simulated:
        assert simulated.bus == f"kst:can://slcan{tmp_path / 'can'}"


def test_switches_are_flags_and_settings_belong_to_the_address(tmp_path: Path) -> None:
    with Simulated(
        "kst",
        ids="37",
        link=tmp_path / "can",
        tcp="0",
        profile="kst-ext",
        out_of_range="clamp",
        bitrate="500000",
    ) as simulated:
        assert simulated.bus == f"kst:can://slcan{tmp_path / 'can'},profile=kst-ext,bitrate=500000"
        assert simulated.buses[1].endswith(",profile=kst-ext,bitrate=500000")
        terminal = os.open(tmp_path / "can", os.O_RDWR | os.O_NOCTTY)
        try:
            assert slcan(terminal) == POSITION
            refused = asked(terminal, b"t62582203600000700000\r", 24).removeprefix(b"z\r")
            assert refused == b"t5A586003600000000000\r", "it takes a position that is out of range"
        finally:
            os.close(terminal)


def test_a_bus_of_python_can_may_be_joined() -> None:
    with Simulated("kst", ids="37", can="virtual/here", profile="kingmax") as simulated:
        assert simulated.buses == ["kst:can://virtual/here,profile=kingmax"]
    assert simulated.process.returncode == 0


def test_an_unknown_flag_is_told_what_it_may_have_meant(run: Run) -> None:
    ran = run("simulate", "kst", "--profil", "kst-ext")
    assert (ran.code, ran.out) == (2, "")
    assert "profile" in ran.err
