"""The emergency stop from another shell: of a program that loops, of one that hangs, of a bus that nobody holds."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.bus import stop_socket
from motorbus.cli import estop
from motorbus.core.request import Data
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench, Run
from tests.support.processes import LATENCY, Simulated

LOOPING = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    servos = [motorbus.feetech.Servo(bus, node) for node in (1, 2, 3)]
    for servo in servos:
        servo.enable_torque()
    print("looping", flush=True)
    try:
        while True:
            for servo in servos:
                servo.move(servo.position() + 0.01, wait=False)
    except motorbus.Interrupted as error:
        print(error.summary, flush=True)
"""
HANGING = """
import asyncio, sys, motorbus
async def main():
    async with motorbus.open_async(sys.argv[1]) as bus:
        for node in (1, 2, 3):
            await motorbus.feetech.AsyncServo(bus, node).enable_torque()
        print("hanging", flush=True)
        sys.stdin.read()  # the event loop stands still
asyncio.run(main())
"""
WATCHING = """
import sys, motorbus
with motorbus.open(sys.argv[1]) as bus:
    print("watching", flush=True)
    sys.stdin.read()
"""
OPENING = """
import sys, motorbus
from motorbus.bus.stop import EmergencyStop
start = EmergencyStop.start
def late(self):
    print("locked", flush=True)
    sys.stdin.readline()
    start(self)
EmergencyStop.start = late
with motorbus.open(sys.argv[1]) as bus:
    sys.stdin.read()
"""
FOREIGN = """
import os, sys
descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
print("holding", flush=True)
sys.stdin.read()
"""

LATCHED = re.compile(rf"emergency stop latched by process {os.getpid()} \(.+\) at \d\d:\d\d:\d\d")
"""What a process says that was stopped from this one."""

pytestmark = pytest.mark.usefixtures("state_folder")


@contextmanager
def program(code: str, argument: str) -> Iterator[subprocess.Popen[str]]:
    """Another program, from its first line of output on; it ends when its stdin does."""
    command = [sys.executable, "-c", code, argument]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        try:
            yield process
        finally:
            process.communicate(timeout=30)


def torque(bus: str) -> list[float]:
    with motorbus.open(bus) as opening:
        return [
            motorbus.feetech.Servo(opening, node).read("torque_enable")["torque_enable"] for node in (1, 2, 3)
        ]


def test_a_program_that_loops_is_stopped(served: Simulated, run: Run) -> None:
    with program(LOOPING, served.bus) as process:
        ran = run("estop", served.bus, "--json")
        assert process.stdout is not None
        assert LATCHED.search(process.stdout.readline())
    assert ran.code == 0
    (stop,) = ran.document["buses"]
    assert stop["acknowledged"] == [1, 2, 3]
    assert str(process.pid) in stop["by"]
    assert torque(served.bus) == [0, 0, 0]


def test_a_program_whose_event_loop_hangs_is_stopped(served: Simulated, run: Run) -> None:
    with program(HANGING, served.bus) as process:
        ran = run("estop", served.bus, "--json")
        assert process.poll() is None
    assert ran.code == 0
    assert ran.document["buses"][0]["acknowledged"] == [1, 2, 3]
    assert torque(served.bus) == [0, 0, 0]


def test_a_move_that_is_stopped_says_so(served: Simulated, run: Run) -> None:
    command = [
        sys.executable,
        "-m",
        "motorbus",
        "move",
        f"{served.bus}#1=90deg",
        "--velocity",
        "0.1",
        "-vv",
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "tx FF FF 01 0A 03 29" not in process.stderr.readline():
            assert process.poll() is None
        assert run("estop", served.bus).code == 0
        _, told = process.communicate(timeout=30)
    assert process.returncode == 10
    assert LATCHED.search(told)


def test_devices_that_are_named_confirm_it(served: Simulated, run: Run) -> None:
    ran = run("estop", f"{served.bus}#1+9", "--json")
    assert ran.code == 6
    (stop,) = ran.document["buses"]
    assert (stop["acknowledged"], stop["silent"], stop["by"]) == ([1], [9], "this process")


class LosesOne(PerfectLine):
    """Loses the first reply of device 2."""

    lost = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE and isinstance(data, bytes) and data[2] == 2 and not self.lost:
            self.lost = True
            return []
        return super().carry(sender, data, at)


def test_a_named_device_whose_acknowledgement_is_lost_is_stopped_again(run: Run, arm: Simulation) -> None:
    arm.line = line = LosesOne()
    (stop,) = run("estop", f"{arm.url}#1-3", "--json").document["buses"]
    assert line.lost
    assert (stop["acknowledged"], stop["silent"]) == ([1, 2, 3], [])


def test_a_stop_that_nobody_acknowledged_promises_nothing(run: Run) -> None:
    ran = run("estop", "feetech:sim,ids=2-6#8+9", "--json")
    assert ran.code == 5
    (stop,) = ran.document["buses"]
    assert (stop["outcome"], stop["acknowledged"], stop["promise"]) == ("acknowledged by nobody", [], "")
    assert stop["silent"] == [8, 9]
    assert json.loads(ran.err)["error"] == "NoReply"


def test_who_can_acknowledge_is_said_where_nobody_was_named(run: Run) -> None:
    ran = run("estop", "feetech:sim,ids=1-6")
    assert ran.code == 6
    assert "acknowledged by #1\n" in ran.out
    assert "only devices that are named" in ran.out
    assert "others not asked, broadcast sent" in ran.out + ran.err
    assert "silent" not in ran.out
    ran = run("estop", "feetech:sim,ids=1-6#1-6")
    assert ran.code == 0
    assert "only devices" not in ran.out


@pytest.mark.parametrize(("device", "asked", "code"), [("#1", [1], 6), ("", [1, 2, 3], 0)])
def test_devices_of_the_machine_file_that_were_not_asked_are_counted(
    device: str, asked: list[int], code: int, bench: Bench, run: Run
) -> None:
    ran = run("estop", f"{bench.simulations['arm'].url}{device}", "--json")
    (stop,) = ran.document["buses"]
    assert (ran.code, stop["acknowledged"]) == (code, asked)
    assert stop["not_asked"] == [node for node in (1, 2, 3) if node not in asked]
    if code:
        assert "2 not asked, broadcast sent" in ran.err


def test_a_foreign_program_is_named(served: Simulated, run: Run) -> None:
    port = served.bus.partition(":")[2]
    with program(FOREIGN, port) as process:
        ran = run("estop", served.bus)
    assert ran.code == 4
    assert str(process.pid) in ran.err


@pytest.mark.parametrize("everything", [False, True], ids=["bare", "--all"])
def test_without_a_bus_real_ports_and_the_machine_file_are_stopped_and_the_others_named(
    everything: bool, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, patient: None
) -> None:
    def serving(name: str) -> Simulated:
        way: dict[str, Any] = {"tcp": "0"} if name == "tcp" else {"link": tmp_path / name}
        return Simulated("feetech", ids="1", **way)

    with ExitStack() as stack:
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "foreign"))
        real = stack.enter_context(
            serving("real")
        )  # its simulator is unknown here, so the port counts as real
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
        of_file, link, socket = (stack.enter_context(serving(name)) for name in ("file", "link", "tcp"))
        here(f'format = 1\n[bus.arm]\naddress = "{of_file.bus}"\n', tmp_path, monkeypatch)
        buses = [one.bus for one in (real, of_file, link, socket)]
        holders = [stack.enter_context(program(WATCHING, bus + LATENCY)) for bus in buses]
        ran = run("estop", *["--all"] * everything, "--json")
        text = run("estop", *["--all"] * everything)
    stopped = {one["by"].split()[1] for one in ran.document["buses"] if one["acknowledged"]}
    left = {one["by"].split()[1] for one in ran.document["not_stopped"]}
    assert stopped == {str(one.pid) for one in (holders if everything else holders[:2])}
    assert left == {str(one.pid) for one in ([] if everything else holders[2:])}
    assert text.out.count("not stopped: simulated") == len(left)
    assert text.out.count("`--all` stops it too") == len(left)


def test_a_process_that_is_still_opening_the_port_is_stopped_once_it_offers_that(
    served: Simulated, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = stop_socket.request_estop
    monkeypatch.setattr(estop, "OPENING", 30.0)
    with program(OPENING, served.bus) as process:

        def first_in_vain(path: Path) -> stop_socket.StopOutcome:
            try:
                return request(path)
            except motorbus.PortNotFound:
                assert process.stdin is not None
                process.stdin.write("\n")
                process.stdin.flush()
                raise

        monkeypatch.setattr(stop_socket, "request_estop", first_in_vain)
        ran = run("estop", served.bus, "--json")
    (one,) = ran.document["buses"]
    assert (ran.code, one["acknowledged"]) == (0, [1])
    assert f"process {process.pid}" in one["by"]


def test_where_only_simulated_buses_are_open_nothing_is_stopped_and_all_is_the_hint(
    served: Simulated, run: Run
) -> None:
    with program(WATCHING, served.bus) as process:
        ran = run("estop")
    assert (ran.code, ran.out) == (2, "")
    assert f"held by process {process.pid}" in ran.err
    assert "`motorbus estop --all`" in ran.err


def test_without_a_bus_there_must_be_one(run: Run) -> None:
    ran = run("estop")
    assert ran.code == 2
    assert "no motorbus process" in ran.err


def test_without_a_name_the_machine_is_stopped(bench: Bench, run: Run) -> None:
    assert run("hold", "a1").code == 0
    stops = run("estop", "--json").document["buses"]
    assert [one["acknowledged"] for one in stops] == [[1, 2, 3], [37], [1]]
    assert run("read", "a1", "torque_enable", "--json").document["registers"][0]["raw"] == 0


def here(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine file that counts."""
    monkeypatch.chdir(folder)
    (folder / "motorbus.toml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize("words", ["estop", "estop arm"])
def test_a_machine_file_with_an_error_prevents_the_stop_of_no_open_bus(
    words: str, served: Simulated, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here("no machine", tmp_path, monkeypatch)
    with program(HANGING, served.bus):
        ran = run(*words.split(), "--all", "--json")
    assert ran.code == 6
    assert set(ran.document["buses"][0]["acknowledged"]) == {1, 2, 3}
    assert "the file is no TOML" in ran.err
    assert torque(served.bus) == [0, 0, 0]


def test_an_option_that_does_not_fit_one_bus_stops_the_others(bench: Bench, run: Run) -> None:
    ran = run("estop", "--baud", "1M", "--json")
    assert ran.code == 6
    arm, can, stage = ran.document["buses"]
    assert arm["acknowledged"] == [1, 2, 3]
    assert "unknown option 'baud'" in can["error"]
    assert stage["error"] == "", "it was tried after the other"


def test_a_bus_without_an_axis_is_stopped_with_the_machine(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8")
    bench.file.write_text(
        text[: text.index("[axis.a1]")] + text[text.index("[axis.lift]") :], encoding="utf-8"
    )
    bench.file.write_text(bench.file.read_text(encoding="utf-8").partition("[group.")[0], encoding="utf-8")
    assert run("torque", "on", f"{bench.simulations['arm'].url}#1").code == 0
    ran = run("estop", "--json")
    assert [one["outcome"].partition(" by ")[0] for one in ran.document["buses"]] == ["acknowledged"] * 3
    assert bench.simulations["arm"][1].memory["torque_enable"] == 0


def test_who_was_named_on_a_silent_bus_is_asked_before_everybody_else(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8").replace('"can#0x25"', '"can#0x26"')
    bench.file.write_text(text, encoding="utf-8")
    ran = run("estop", "can", "--json")
    assert ran.code == 6
    (stop,) = ran.document["buses"]
    assert (stop["acknowledged"], stop["silent"]) == ([37], [38])


def test_ports_that_are_gone_end_it_as_they_end_a_stop(bench: Bench, run: Run) -> None:
    text = bench.file.read_text(encoding="utf-8")
    text = re.sub(r'(address = "(\w+):)[^"]*"', r'\1/dev/gone-\2"', text)
    bench.file.write_text(text.replace(":/dev/gone-kst", ":can://slcan/dev/gone"), encoding="utf-8")
    stopped = run("stop")
    for words in (("estop",), ("estop", "arm")):
        ran = run(*words)
        assert ran.code == stopped.code == 3
        assert "cut the power by hand" in ran.err


def test_a_suspended_process_is_named_and_the_supply_is_what_is_left(
    served: Simulated, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_socket, "request_estop", partial(stop_socket.request_estop, timeout=0.2))
    with program(WATCHING, served.bus) as process:
        process.send_signal(signal.SIGSTOP)
        try:
            one, every = run("estop", served.bus), run("estop", "--all")
        finally:
            process.send_signal(signal.SIGCONT)
    for ran in (one, every):
        assert ran.code == 5
        assert f"process {process.pid}" in ran.err
        assert "cut the supply now" in ran.err


@pytest.mark.parametrize("command", ["estop", "stop"])
def test_who_is_not_read_any_more_ends_with_the_code_of_that(command: str) -> None:
    """A pipe whose reader has gone before the first word."""
    reading, writing = os.pipe()
    os.close(reading)
    words = [sys.executable, "-m", "motorbus", command, "feetech:sim,ids=1-3#1-3"]
    ended = subprocess.run(words, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (10, "")
