"""What the tests of the command line share: a command run in this process, and buses for it to work on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus.cli import main
from motorbus.cli.simulated import Simulated
from motorbus.simulation.named import Simulation


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
def served(tmp_path: Path, state_folder: Path) -> Iterator[Simulated]:
    """Three simulated servos in a process of their own on a pseudo-terminal; `served.bus` is their bus."""
    with Simulated("feetech", ids="1-3", link=tmp_path / "bus") as simulated:
        yield simulated
