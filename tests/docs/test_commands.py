"""Every command line of README and docs runs as written, on simulated devices.

A port is replaced by a simulated bus of this process, in virtual time. `test_tutorials` runs the tutorials.
"""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from io import StringIO
from pathlib import Path

import pytest

import motorbus
from motorbus.cli import main
from tests.cli.shell import PROGRAM, Ran
from tests.docs.pages import PAGES, ROOT, TUTORIALS, Command, blocks, missing, shown

BY_HAND = re.compile("motorbus setup( calibrate| replace| --)")  # tests/setup moves the arm
SHOWN = [
    one for page in PAGES if page not in TUTORIALS for text in blocks(page, "console") for one in shown(text)
]
COMMANDS = sorted({one for one in SHOWN if one.line.startswith("motorbus ") and not BY_HAND.match(one.line)})
PORT = re.compile(r"(feetech|kst|stepper):(?!sim\b)([^\s#,]+)")
IDS = {"feetech": "1-7", "kst": "0x25", "stepper": "1"}
WITHOUT_MACHINE = re.compile(r"motorbus (decode|demo|recover|scan|setup|simulate|stepper check)")
GROUPS = '\n[group.left]\naxes = ["base", "shoulder"]\n[group.right]\naxes = ["wrist", "roll"]\n'
WAVE = "time (s),shoulder (deg),elbow (deg)\n0,0,0\n1,10,-10\n2,0,0\n"
PING = bytes.fromhex("FF FF 01 02 01 FB")
TRACE = """date Mon Nov 30 12:00:00 2026
base hex  timestamps absolute
internal events logged
Begin Triggerblock Mon Nov 30 12:00:00.0 2026
 0.100000 1  625             Rx   d 8 22 03 60 00 84 03 00 00
End TriggerBlock
"""


Shell = Callable[[str], Ran]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with the files that the pages name."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "feed.toml").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / "traceback.txt").write_text("There is no status packet!", encoding="utf-8")
    (tmp_path / "wave.csv").write_text(WAVE, encoding="utf-8")
    (tmp_path / "line.bin").write_bytes(PING)
    (tmp_path / "dump.txt").write_text(PING.hex(" "), encoding="utf-8")
    (tmp_path / "trace.asc").write_text(TRACE, encoding="utf-8")
    monkeypatch.setattr("sys.stdin", StringIO("\n" * 20))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for name in ("MOTORBUS_MACHINE", "MOTORBUS_BUS"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.fixture
def shell(folder: Path, capsys: pytest.CaptureFixture[str]) -> Shell:
    """Run a line in `folder`; it says `--yes` where it is asked for consent."""

    def run(line: str) -> Ran:
        words = shlex.split(line)[1:]
        if words[0] in ("simulate", "web"):
            return interrupted(words)
        capsys.readouterr()
        ran = Ran(main(words), *capsys.readouterr())
        if ran.code == 8 and "--yes" in ran.err:
            ran = Ran(main([*words, "--yes"]), *capsys.readouterr())
        return ran

    return run


@pytest.fixture
def buses() -> dict[str, str]:
    """The address of the simulated bus in the place of each port."""
    return {}


@pytest.fixture
def open_bus(buses: dict[str, str]) -> Iterator[Callable[[re.Match[str]], str]]:
    """Replace a port by a simulated bus; the same port by the same bus."""
    with ExitStack() as stack:

        def simulate(match: re.Match[str]) -> str:
            family = match[1]
            if match[0] not in buses:
                faults = "at 9 s: power-cycle 37" if "set-id" in match.string and family == "kst" else ""
                ids = "1" if re.search("set-(id|baud)", match.string) and family == "feetech" else IDS[family]
                if "#7" in match.string:
                    ids = "7"
                sim = stack.enter_context(motorbus.simulate(family, ids=ids, faults=faults))
                buses[match[0]] = sim.url
            return buses[match[0]]

        yield simulate


def interrupted(words: list[str]) -> Ran:
    """Run the command in a process; send Ctrl-C after its first line."""
    with subprocess.Popen(
        [sys.executable, "-m", "motorbus", *words],
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


def finite(line: str) -> str:
    """The same line with an end: fewer ids, one sample."""
    line = re.sub(r"--for \d+s", "--for 1s", line).replace("--rates all", "--rates all --ids 1,0x25")
    line = line.replace("--port /", "--port feetech:/")
    if line.startswith("motorbus web"):
        line = re.sub(r"--port \d+", "", line) + " --port 0"
    if line.startswith("motorbus monitor") and not re.search("--(count|for)", line):
        line += " --count 1" if "--listen" not in line else " --for 1s"
    return line


def test_there_are_commands_to_run() -> None:
    assert len(COMMANDS) > 90


@pytest.mark.parametrize("command", COMMANDS, ids=lambda one: one.line)
def test_a_command_runs(
    command: Command,
    folder: Path,
    shell: Shell,
    buses: dict[str, str],
    open_bus: Callable[[re.Match[str]], str],
) -> None:
    line = command.line
    if not re.search(r"(feetech|kst|stepper):", line) and not WITHOUT_MACHINE.match(line):
        text = (ROOT / "examples" / "motorbus.toml").read_text(encoding="utf-8")
        (folder / "motorbus.toml").write_text(text + GROUPS, encoding="utf-8")
    meant = finite(line)
    if "simulate" not in line:  # the page runs in a process of its own
        meant = PORT.sub(r"\1:sim,ids=1-6" if "motorbus web" in line else open_bus, meant)
    if " teach " in meant:
        (folder / "wave.csv").unlink()
    meant = meant.replace("/tmp/", f"{folder}/")
    if meant.startswith("motorbus stepper run") and not meant.startswith("motorbus stepper run stepper:sim "):
        address = shlex.split(meant)[3]
        assert shell(f"motorbus stepper write feed.toml {address}").code == 0
    if meant.startswith("motorbus setup import"):
        assert shell(meant.replace("import", "export")).code == 0
    if meant.startswith("motorbus restore"):
        assert shell(f"motorbus backup {shlex.split(meant)[3]} {shlex.split(meant)[2]}").code == 0
    ran = shell(meant)
    assert ran.code == 0, ran.err
    assert ran.out or "--listen" in meant  # no other program talks on the bus
    out = (ran.out + ran.err).replace(f"{folder}/", "/tmp/")
    for port, address in buses.items():
        out = out.replace(address, port)
    assert missing(command.output, out) == []
