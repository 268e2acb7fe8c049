"""Row L12 in real time: simulators that are killed, pulled and started again behind the same name, on real ports."""

from __future__ import annotations

import gc
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import motorbus
from motorbus import families
from motorbus.bus.pump import Bus
from motorbus.cli.simulated import Simulated
from motorbus.core.operation import Operation, Pause
from motorbus.errors import LinkLost, NoReply
from motorbus.link.lock import socket_path
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from tests.conftest import Figures
from tests.support.mounts import served

TRIES = 1_000
"""Looks at a port that is coming back, each behind a pause."""
LOOK = 0.03
"""s of such a pause."""


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, unhurried: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


WAYS: dict[str, Callable[[Path], tuple[str, dict[str, Any]]]] = {
    "tcp": lambda folder: ("feetech", {"tcp": f"127.0.0.1:{free_port()}"}),
    "slcan over tcp": lambda folder: ("kst", {"tcp": f"127.0.0.1:{free_port()}"}),
    "socketcand": lambda folder: ("kst", {"socketcand": f"127.0.0.1:{free_port()}"}),
}


def pause(seconds: float = LOOK) -> Operation[None]:
    yield from Pause(seconds)


def kill(simulated: Simulated, **place: Any) -> None:
    """Kill it, and remove the link that it leaves behind: its number may be another terminal's by now."""
    simulated.process.kill()
    simulated.process.communicate()
    if "link" in place:
        place["link"].unlink(missing_ok=True)


def first(bus: Any) -> Any:
    """The device with the lowest id."""
    node = {"feetech": 1, "kst": 0x21, "stepper": 1}[bus.family.name]
    return bus.family.devices.blocking(bus, node)


def asked(bus: Bus) -> object:
    """What it tells; a machine that is busy may be late with the answer."""
    device = first(bus)
    for _ in range(TRIES):
        try:
            return device.read_input(1) if bus.family.name == "stepper" else device.position()
        except NoReply:
            bus.run(pause())
    raise AssertionError("it does not answer")


def again(bus: Bus) -> object:
    """Ask until it is there."""
    for _ in range(TRIES):
        try:
            return asked(bus)
        except LinkLost:
            bus.run(pause())
    raise AssertionError("it was not opened anew")


OFTEN = ("tcp",)
"""Those that are tried with every commit; each takes two processes."""


@pytest.mark.parametrize(
    "way", [way if way in OFTEN else pytest.param(way, marks=pytest.mark.soak) for way in WAYS]
)
def test_l12_a_simulator_that_is_killed_and_started_again(way: str, tmp_path: Path) -> None:
    family, place = WAYS[way](tmp_path)
    ids = {"kst": "0x21", "feetech": "1-2", "stepper": "1"}[family]
    with Simulated(family, ids=ids, **place) as before, motorbus.open(before.bus) as bus:
        told = asked(bus)
        kill(before, **place)
        for _ in range(3):
            with pytest.raises(LinkLost, match="looked for again"):
                asked(bus)
        with Simulated(family, ids=ids, **place) as after:
            assert after.process.pid != before.process.pid
            assert again(bus) == told
            assert bus.loss_count == 1
            link: Any = bus.link
            assert socket_path(link.lock_name).exists(), "it is to be stopped by other programs there"


# -- often ---------------------------------------------------------------------------------------------------------


def counts() -> tuple[int, int]:
    """Descriptors and threads of this process."""
    gc.collect()
    return len(os.listdir("/proc/self/fd")), threading.active_count()


class Seen(NamedTuple):
    """What was read when the terminal was back, and how much later (s) its loss was told, and it answered again."""

    value: object
    told: float
    back: float


AWAY = 0.005
"""s for which the terminal is away."""


def cycles(bus: Bus, mount: Mount, count: int) -> Iterator[Seen]:
    """Pull the terminal so often; what is seen of each time."""
    for _ in range(count):
        gone = time.monotonic()
        mount.unplug(seconds=AWAY)
        with pytest.raises(LinkLost):
            _until_it_is_gone(bus)
        told = time.monotonic() - gone
        value = again(bus)
        yield Seen(value, told, time.monotonic() - gone - AWAY)


def _until_it_is_gone(bus: Bus) -> None:
    for _ in range(TRIES):
        asked(bus)


def test_l12_a_terminal_pulled_again_and_again_leaves_nothing_behind(
    tmp_path: Path, rounds: Callable[[int], int], figures: Figures
) -> None:
    """How long it took by the clock on the wall is told by the long runs, and judged by nobody."""
    thorough = rounds(20_000) == 20_000
    count = 1_000 if thorough else 20
    master = PtyMaster()
    master.symlink(tmp_path / "bus")
    family = families.load("feetech")
    mount = Mount(family.simulator((1,), ""), master)
    with closing(master), served(mount), motorbus.open(f"feetech:{tmp_path / 'bus'}") as bus:
        told = asked(bus)
        list(cycles(bus, mount, 3))
        before = counts()
        seen = list(cycles(bus, mount, count))
        right = sum(one.value == told for one in seen)
        assert right == count
        assert bus.loss_count == count + 3
        leaked = sum(counts()) - sum(before)
        assert counts() == before
    longest: dict[str, Any] = {
        "longest_told_s": max(one.told for one in seen),
        "longest_until_it_answers_again_s": max(one.back for one in seen),
    }
    figures(
        "L12 a terminal pulled and put back",
        family="feetech",
        cycles=count,
        right=right,
        leaked=leaked,
        **(longest if thorough else {}),
    )
