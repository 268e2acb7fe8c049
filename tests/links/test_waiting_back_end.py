"""A back end of python-can whose recv(0) waits for its serial port, on a bus that is never quiet."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import motorbus
from motorbus import kst

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def address() -> Iterator[str]:
    command = [sys.executable, "-m", "tests.links.seeed", "0.05"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as peer:
        assert peer.stdout is not None
        yield f"kst:can://seeedstudio{peer.stdout.readline().strip()}"
        peer.kill()


def test_f2_a_read_hands_over_what_is_there(address: str) -> None:
    with motorbus.open(address) as bus:
        assert [warning for warning in bus.warnings if "seeedstudio waits up to 100 ms" in warning]
        assert bus.latency >= 0.1
        servo = kst.Servo(bus, 1)
        times = []
        for _ in range(5):
            begin = time.monotonic()
            assert servo.position() == pytest.approx(0.1745, abs=1e-3)
            times.append(time.monotonic() - begin)
        assert min(times) < 0.3
        begin = time.monotonic()
        (found,) = bus.run(bus.driver.scan((1, 2, 3)))
        assert time.monotonic() - begin < 10.0
        assert found.identity is not None
        assert (found.node, found.identity.firmware) == (1, "1.00")
        assert found.identity.model.startswith("KST")
