"""Every command of the README and of the page on a machine runs as written, on simulated devices.

The ports of a command are replaced by simulated buses of this process with devices of the same ids. A command runs in
this process, except one that ends by a signal. The Python of the README runs in `test_docs`.
"""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
from motorbus.cli import main
from motorbus.cli.exits import Exit

import motorbus
from motorbus.motion.machine import Machine
from motorbus.session import prepare

ROOT = Path(__file__).resolve().parents[2]
MACHINE_PAGE = ROOT / "docs" / "how-to" / "machine.md"


def lines(page: Path) -> list[str]:
    """The commands that a page shows."""
    blocks = re.findall(r"^```console\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    shown = [line for block in blocks for line in block.splitlines() if line.startswith("$ motorbus ")]
    return [line[2:].partition("  #")[0].strip() for line in shown]


LINES = lines(ROOT / "README.md")
PORTS = {
    "feetech": (re.compile(r"feetech:/dev/ttyACM0"), "1-6"),
    "kst": (re.compile(r"kst:can://slcan/dev/ttyACM\d"), "0x25"),
    "stepper": (re.compile(r"stepper:/dev/ttyUSB0"), "1"),
}
NAMED = re.compile(r"^motorbus (pose|park|teach|replay|follow|loop-stats|move shoulder)")
"""Commands that go by names of a machine file."""
FOR_EVER = re.compile(r"^motorbus simulate ")
WITH_HANDS = re.compile(r"^motorbus set-id kst:")
POWER_CYCLE = "at 9 s: power-cycle 37"
"""What its user does when the command asks for it."""
FEED = """format = 1
name = "Feed"
project = 2
[motor]
microsteps = 8
step_angle = "1.8 deg"
turn_distance = 1600
[[step]]
move = "1 turns"
speed = "240 rpm"
start = "200 Hz"
acceleration = "20 Hz"
"""
WAVE = "time (s),shoulder (deg),elbow (deg)\n0,0,0\n1,10,-10\n2,0,0\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder in which the commands are given, with the files that they name."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "feed.toml").write_text(FEED, encoding="utf-8")
    (tmp_path / "wave.csv").write_text(WAVE, encoding="utf-8")
    (tmp_path / "buttons.txt").write_text("0.5 1 on\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def ports(request: pytest.FixtureRequest) -> Iterator[dict[str, str]]:
    """The addresses of simulated buses, by family, of those that the line needs."""
    line: str = request.node.callspec.params["line"]
    with ExitStack() as stack:
        found = {}
        for family, (pattern, ids) in PORTS.items():
            if pattern.search(line) or (
                family == "feetech" and NAMED.search(line) and "readme" in request.node.name
            ):
                faults = POWER_CYCLE if WITH_HANDS.search(line) else ""
                found[family] = stack.enter_context(motorbus.simulate(family, ids=ids, faults=faults)).url
        yield found


def write_machine(folder: Path, address: str) -> None:
    """The machine of the README, by the names that it uses."""
    names = ("base", "shoulder", "elbow", "wrist", "roll", "gripper")
    text = f'format = 1\n[bus.arm]\naddress = "{address}"\n'
    for node, name in enumerate(names, 1):
        text += (
            f'[axis.{name}]\ndevice = "arm#{node}"\nzero = "180 deg"\nlow = "-120 deg"\nhigh = "120 deg"\n'
        )
        text += 'park = "0 deg"\n'
    text += '[group.left]\naxes = ["base", "shoulder"]\n[group.right]\naxes = ["wrist", "roll"]\n'
    text += '[pose.ready]\nshoulder = "-20 deg"\nelbow = "30 deg"\n'
    (folder / "motorbus.toml").write_text(text, encoding="utf-8")


class Ran(NamedTuple):
    """Exit code and output of a command."""

    returncode: int
    stdout: str
    stderr: str


Shell = Callable[..., Ran]


@pytest.fixture
def shell(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """`shell(line, *more)`: run the command in `folder`, with user folders of its own."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder / "config"))

    def run(line: str, *more: str) -> Ran:
        words = [*shlex.split(line)[1:], *more]
        if FOR_EVER.search(line):
            return run_process(words, folder)
        capsys.readouterr()
        return Ran(main(words), *capsys.readouterr())

    return run


def run_process(words: list[str], folder: Path) -> Ran:
    """Run the command in a process of its own; send Ctrl-C after its first line."""
    with subprocess.Popen(
        [sys.executable, "-m", "motorbus", *words],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    return Ran(process.returncode, first + out, err)


def shortened(line: str) -> str:
    """The same for a shorter time, if it gives one, and fewer ids."""
    return re.sub(r"--seconds \d+", "--seconds 1", line).replace("--baud all", "--baud all --ids 1-6")


def test_its_machine_file_describes_a_machine() -> None:
    (text,) = re.findall(
        r"^```toml\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S
    )
    machine = Machine.parse(text, check_address=lambda address: prepare(address, {}))
    assert (list(machine.buses), list(machine.axes)) == (["arm"], ["shoulder"])


def test_there_are_commands_to_run() -> None:
    assert len(LINES) > 25
    assert sum(bool(NAMED.search(line)) for line in LINES) >= 7


def worked(line: str, ports: dict[str, str], folder: Path, shell: Shell) -> Ran:
    """The command on these ports; where a person would have been asked, that person says yes."""
    meant = shortened(line).replace("/tmp/", f"{folder}/")
    for family, address in ports.items():
        meant = PORTS[family][0].sub(address, meant)
    if meant.startswith("motorbus stepper run"):
        assert shell(f"motorbus stepper write feed.toml {ports['stepper']} --yes").returncode == 0
    ran = shell(meant)
    return shell(meant, "--yes") if "nobody agreed" in ran.stderr else ran


def judge(line: str, ran: Ran) -> None:
    """It succeeded; figures of a loop are told too when a host that was held up has lost a reading."""
    held_up = "loop-stats" in line and ran.returncode == Exit.PARTIAL and "readings lost" in ran.stderr
    assert ran.returncode == 0 or held_up, ran.stderr
    assert ran.stdout


@pytest.mark.parametrize("line", LINES)
def test_a_command_of_the_readme_works(line: str, ports: dict[str, str], folder: Path, shell: Shell) -> None:
    if NAMED.search(line):
        write_machine(folder, ports["feetech"])
    judge(line, worked(line, ports, folder, shell))


@pytest.mark.parametrize("line", lines(MACHINE_PAGE))
def test_a_command_of_the_page_on_a_machine_works(
    line: str, ports: dict[str, str], folder: Path, shell: Shell
) -> None:
    (folder / "motorbus.toml").write_bytes((ROOT / "examples" / "motorbus.toml").read_bytes())
    judge(line, worked(line, ports, folder, shell))
