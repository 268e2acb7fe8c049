"""What the tests of the command line share: a command run in this process, and buses for it to work on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus.cli import main
from motorbus.cli.machine import VARIABLE
from motorbus.core.request import Data
from motorbus.link import usb_adapters
from motorbus.motion.machine import Machine
from motorbus.simulation.named import Simulation
from tests.support.machines import machine
from tests.support.processes import Simulated


class Ran(NamedTuple):
    """What a command did: its exit code, and what it wrote."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """The one JSON document on stdout."""
        return json.loads(self.out)

    @property
    def records(self) -> list[Any]:
        """The JSON Lines on stdout."""
        return [json.loads(line) for line in self.out.splitlines()]


Run = Callable[..., Ran]


@pytest.fixture(autouse=True)
def no_file_of_the_user(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """No machine file of whoever runs the tests counts. The folder where one would be looked for."""
    monkeypatch.delenv(VARIABLE, raising=False)
    with TemporaryDirectory() as folder:
        monkeypatch.setenv("XDG_CONFIG_HOME", folder)
        yield Path(folder) / "motorbus"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """`run("scan", bus)` in this process; what it wrote comes back with its exit code."""

    def run(*words: str) -> Ran:
        capsys.readouterr()
        code = main(words)
        return Ran(code, *capsys.readouterr())

    return run


@pytest.fixture
def arm() -> Iterator[Simulation]:
    """Three simulated servos in this process, in virtual time; `arm.url` is their bus."""
    with motorbus.simulate("feetech", ids="1-3") as simulation:
        yield simulation


@pytest.fixture
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Locks and sockets of this test alone."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever answers in a process of its own may be kept waiting for a processor by all the other tests."""
    monkeypatch.setattr(usb_adapters, "TERMINAL_LATENCY", 0.02)


@pytest.fixture
def served(tmp_path: Path, state_folder: Path, patient: None) -> Iterator[Simulated]:
    """Three simulated servos in a process of their own on a pseudo-terminal; `served.bus` is their bus."""
    with Simulated("feetech", ids="1-3", link=tmp_path / "bus") as simulated:
        yield simulated


class Bench(NamedTuple):
    """A machine in this process, in virtual time, whose file is in the present folder: axes a1 to a3, c1 and lift."""

    machine: Machine
    simulations: dict[str, Simulation]
    file: Path

    def describe(self, extra: str) -> None:
        """Append to the file."""
        self.file.write_text(self.file.read_text(encoding="utf-8") + extra, encoding="utf-8")

    def at_request(self, monkeypatch: pytest.MonkeyPatch, acts: Mapping[int, Callable[[], object]]) -> None:
        """Just before the bus arm hears its requests of these numbers, from 1 on, these things happen."""
        arm = self.simulations["arm"].simulator
        receive, numbers = arm.receive, count(1)

        def overheard(data: Data, at: float) -> None:
            acts.get(next(numbers), lambda: None)()
            receive(data, at)

        monkeypatch.setattr(arm, "receive", overheard)


POSES = """
[pose.ready]
a1 = "10 deg"
c1 = "-5 deg"

[pose.whole]
a1 = "20 deg"
lift = "15 mm"
"""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """See `Bench`; parking goes to 30 degrees with a1 and to 2 mm with the lift, whose home switch is there."""
    axes = {"a1": {"park": "30 deg"}, "lift": {"park": "2 mm"}}
    wired = {"stage": {"home_switch": "wired"}}
    with machine(arm="1-3", can="0x25", lift=True, axes=axes, options=wired, extra=POSES) as (made, sims):
        monkeypatch.chdir(tmp_path)
        file = tmp_path / "motorbus.toml"
        text = made.text().replace("[pose.ready]", "[pose.ready]  # before work")
        file.write_text(f"# The bench.\n{text}", encoding="utf-8")
        yield Bench(made, sims, file)
