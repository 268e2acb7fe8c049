"""Ctrl-C at any moment: raised at a boundary, and the bus can be used at once.

A child gets SIGINT every millisecond. It may see KeyboardInterrupt and nothing else.
"""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import feetech
from tests.conftest import Rounds
from tests.support.processes import LATENCY, LIMIT, Simulator, python, simulator


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    """One servo in another process."""
    with simulator(tmp_path_factory.mktemp("interrupts") / "bus", "feetech", "--ids", "1") as simulated:
        yield simulated


def bombarded(job: str, amount: float, place: object) -> dict[str, Any]:
    """What the child says at its end; see tests/contract/bombarded.py."""
    with python("-m", "tests.contract.bombarded", job, str(amount), str(place)) as child:
        output, errors = child.communicate(timeout=LIMIT + 3 * amount)
    assert child.returncode == 0, errors
    found: dict[str, Any] = json.loads(output)
    return found


def check(found: dict[str, Any], interrupts: int = 100) -> None:
    """Nothing but interrupts, and the first or second read afterwards is right."""
    assert found["interrupts"] > interrupts, found
    assert found["calls"] > 0, found
    assert (found["errors"], found["strange"]) == ({}, []), found
    assert (found["right"], found["tries"] <= 2) == (True, True), found


def test_reads_of_one_bus(running: Simulator, rounds: Rounds) -> None:
    check(bombarded("read", rounds(60, 1), running.address))


def test_a_request_that_was_sent_is_answered_when_the_interrupt_is_raised(
    running: Simulator, rounds: Rounds
) -> None:
    found = bombarded("boundary", rounds(60, 1), running.address)
    check(found)
    assert found["unanswered"] == 0


MACHINE = """
format = 1
[bus.arm]
address = "{arm}"
[bus.can]
address = "{can}"
[axis.a1]
device = "arm#1"
zero = "180 deg"
low = "-90 deg"
high = "90 deg"
max_velocity = "90 deg/s"
max_acceleration = "360 deg/s2"
exit = "leave"
[axis.c1]
device = "can#33"
low = "-50 deg"
high = "50 deg"
max_velocity = "90 deg/s"
max_acceleration = "360 deg/s2"
exit = "leave"
"""


def test_reads_and_moves_on_two_buses(running: Simulator, tmp_path: Path, rounds: Rounds) -> None:
    with simulator(tmp_path / "can", "kst", "--ids", "0x21") as can:
        file = tmp_path / "motorbus.toml"
        file.write_text(MACHINE.format(arm=running.address, can=can.address))
        check(bombarded("machine", rounds(60, 1), file))


def check_one_servo(running: Simulator, *ids: int) -> None:
    """One of these ids answers, its lock is closed, and no change is left unfinished."""
    with motorbus.open(running.address) as bus:
        assert bus.warnings == ()
        found = []
        for node in ids:
            try:
                found.append(feetech.Servo(bus, node).read("id", "lock"))
            except motorbus.NoReply:
                continue
        assert len(found) == 1
        assert found[0]["lock"] == 1


def test_changes_of_an_eeprom_register(running: Simulator, rounds: Rounds) -> None:
    check(bombarded("write", rounds(60, 1), running.address), interrupts=20)
    check_one_servo(running, 1)


def test_changes_of_an_id(tmp_path: Path, rounds: Rounds) -> None:
    total = rounds(60, 1)
    with simulator(tmp_path / "bus", "feetech", "--ids", "1") as simulated:
        found = bombarded("rename", total, simulated.address.replace(LATENCY, ",latency=0.02"))
        assert found == {"right": True, "interrupts": total, "errors": []}
        check_one_servo(simulated, 1, 2)


def test_a_bus_closed_in_another_thread_leaves_no_handler() -> None:
    """Python changes handlers in the main thread only: the first signal after it is already the default one."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    with motorbus.simulate("feetech", clock="real") as sim:
        bus = motorbus.open(sim.url)
        assert [signal.getsignal(number) for number in numbers] != before
        closing = threading.Thread(target=bus.close)
        closing.start()
        closing.join(LIMIT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert [signal.getsignal(number) for number in numbers] == before
        motorbus.open(sim.url).close()
        assert [signal.getsignal(number) for number in numbers] == before
