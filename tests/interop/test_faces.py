"""One list of verbs, blocking and async, over a pseudo-terminal, TCP and memory: the same answers, the same frames."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

import motorbus
from tests.support.processes import Simulated
from tests.support.world import Subscription, TraceRecord

VERBS: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
    ("ping", (), {}),
    ("identify", (), {}),
    ("read", ("present_voltage", "present_temperature", "acceleration"), {}),
    ("write", (), {"led_mask": 5}),
    ("read", ("led_mask",), {}),
    ("enable_torque", (), {}),
    ("position", (), {}),
    ("move", (3.0,), {"wait": False}),
    ("stop", (), {}),
    ("disable_torque", (), {}),
    ("telemetry", (), {}),
    ("position", (), {}),
]
LATENCY = 1.0
"""s that the process of the simulator may wait for a processor."""
SETTLED = {"position", "telemetry"}  # depend on how far it has come meanwhile; compared in kind


def told(verb: str, value: Any) -> object:
    return type(value).__name__ if verb in SETTLED else value


@contextmanager
def reached(by: str, folder: Path) -> Iterator[str]:
    """The address of three new servos behind this kind of link."""
    if by == "memory":
        with motorbus.simulate("feetech", ids="1-3") as simulated:
            yield simulated.url
    else:
        where: dict[str, Any] = {"tcp": "0"} if by == "tcp" else {"link": folder / "arm"}
        with Simulated("feetech", ids="1-3", **where) as served:
            yield served.bus


def sent(watch: Subscription[TraceRecord]) -> list[bytes]:
    assert watch.dropped == 0
    return [
        bytes(record.data) for record in watch if record.direction == "tx" and isinstance(record.data, bytes)
    ]


def blocking(address: str) -> tuple[list[object], list[bytes]]:
    with motorbus.open(address) as bus:
        bus.latency = LATENCY
        watch = bus.trace.subscribe()
        servo = motorbus.feetech.Servo(bus, 2)
        values = [told(verb, getattr(servo, verb)(*args, **named)) for verb, args, named in VERBS]
        return values, sent(watch)


def awaiting(address: str) -> tuple[list[object], list[bytes]]:
    async def main() -> tuple[list[object], list[bytes]]:
        async with motorbus.open_async(address) as bus:
            bus.latency = LATENCY
            watch = bus.trace.subscribe()
            servo = motorbus.feetech.AsyncServo(bus, 2)
            values = [told(verb, await getattr(servo, verb)(*args, **named)) for verb, args, named in VERBS]
            return values, sent(watch)

    return asyncio.run(main())


@pytest.fixture(scope="module")
def reference() -> tuple[list[object], list[bytes]]:
    with motorbus.simulate("feetech", ids="1-3") as simulated:
        return blocking(simulated.url)


@pytest.mark.parametrize("face", [blocking, awaiting], ids=lambda face: face.__name__)
@pytest.mark.parametrize("by", ["memory", "pseudo-terminal", "tcp"])
def test_the_same_verbs_say_and_send_the_same(
    by: str,
    face: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    reference: tuple[list[object], list[bytes]],
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with reached(by, tmp_path) as address:
        values, frames = face(address)
    assert values == reference[0]
    assert kinds(frames) == kinds(reference[1])


def kinds(frames: list[bytes]) -> list[tuple[int, ...]]:
    """Id, instruction and address of each frame: the data may hold a position, which moves.

    On a busy machine a reply may miss its deadline; the probe (READ of the id register) and the repetition that
    follow are no difference between faces or links.
    """
    every = [(frame[2], frame[4], *frame[5:6]) for frame in frames]
    return [kind for kind, _ in groupby(kind for kind in every if kind[1:] != (2, 5))]
