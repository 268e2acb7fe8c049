"""The emergency stop goes through: idle, in mid-exchange, with a hung event loop, from another process."""

from __future__ import annotations

import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from motorbus.bus.blocking import Bus
from motorbus.bus.stop_socket import STOP_TIMEOUT, request_estop
from motorbus.core.request import Effect, Request
from motorbus.core.steps import SetBitrate
from motorbus.errors import LinkError, LinkLost, PortNotFound
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, memory_bus, position, write
from tests.bus.script import ADMIT_ALL, Check

TORQUE = 40


def torque_offs(responder: Responder) -> list[int]:
    """The ids to which torque-off was sent, in order."""
    return [p.id for p in responder.heard if p.parameters[:2] == bytes([TORQUE, 0])]


def known(bus: Bus, *nodes: int) -> None:
    for node in nodes:
        bus.run(position(node))


def test_a_stop_after_close_says_at_once_that_nothing_was_sent() -> None:
    for virtual in (True, False):
        bus, responder = memory_bus(virtual=virtual)
        known(bus, 1)
        bus.close()
        with pytest.raises(LinkLost, match="no stop was sent"):
            bus.estop()
        assert torque_offs(responder) == []


@pytest.mark.parametrize("turn_is_free", [True, False])
def test_the_interlock_learns_of_every_stop_from_any_thread(turn_is_free: bool) -> None:
    check = Check(lambda request: None)
    bus, _ = memory_bus(virtual=False)
    bus.interlock = check
    known(bus, 1)
    with ThreadPoolExecutor(1) as pool:
        if not turn_is_free:
            bus.turn.acquire()
        outcome = pool.submit(bus.estop)
        while not check.stops:
            time.sleep(0.001)
        bus.turn.release()
        assert outcome.result().acknowledged == (1,)
    assert set(check.stops) == {(), (1,)}
    bus.close()


def test_a_stop_of_many_silent_nodes_ends_in_time_and_says_what_was_sent() -> None:
    bus, responder = memory_bus(virtual=True)
    known(bus, *range(1, 21))
    bus.latency, responder.dead = 0.05, set(range(1, 21))
    begun = bus.now()
    outcome = bus.estop()
    assert bus.now() - begun < STOP_TIMEOUT - 1
    assert (outcome.silent, outcome.acknowledged) == (tuple(range(1, 21)), ())
    assert "torque off" in outcome.promise


def test_a_stop_is_sent_at_the_rate_of_the_last_prepared_reply() -> None:
    bus, responder = memory_bus()
    read = position(1)
    kept = Request(
        read.wire, read.expected, read.decode, repeatable=True, decode_exact=lambda data, at: data[5]
    )
    for rate in (1_000_000, 500_000):
        bus.run(SetBitrate(rate))
        for _ in range(3):
            assert bus.run(kept) == 1
    bus.estop()
    assert (bus.rate, responder.rate) == (500_000, 500_000)


def test_a_port_that_is_full_for_a_while_does_not_lose_the_stop() -> None:
    bus, responder = memory_bus()
    known(bus, 1)
    link: Any = bus.link
    write_, until = link.write, link.now() + 0.1

    def full(data: Any) -> None:
        if link.now() < until:
            raise LinkError("full")
        write_(data)

    link.write = full
    assert bus.estop().acknowledged == (1,)
    assert 1 in torque_offs(responder)


@pytest.mark.parametrize("turn_is_free", [True, False])
def test_a_stop_that_the_driver_fails_is_raised_and_leaves_the_bus_usable(
    turn_is_free: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, _ = memory_bus(virtual=False)
    known(bus, 1)

    def fail(nodes: Any) -> Any:
        raise RuntimeError("of the driver")

    monkeypatch.setattr(bus.driver, "stop", fail)
    with ThreadPoolExecutor(2) as pool:
        if not turn_is_free:
            bus.turn.acquire()
        begun = time.monotonic()
        with pytest.raises(RuntimeError, match="of the driver"):
            pool.submit(bus.estop).result()
        assert time.monotonic() - begun < STOP_TIMEOUT
        bus.turn.release()
        assert pool.submit(bus.run, position(1)).result(STOP_TIMEOUT) == 1
    assert bus.latched
    bus.close()


def test_the_stop_thread_sleeps_from_the_first_torque_command_on_and_ends_with_the_bus() -> None:
    bus, _ = memory_bus(virtual=False)

    def threads() -> list[str]:
        return [thread.name for thread in threading.enumerate() if thread.name == "motorbus stop"]

    known(bus, 1)
    assert threads() == []
    bus.run(write(1, TORQUE, 0, Effect.TORQUE))
    assert threads() == ["motorbus stop"]
    bus.close()
    assert threads() == []


def served(path: Path) -> tuple[Bus, Responder]:
    responder = Responder()
    bus = Bus(MemoryLink(responder, virtual=False), FAMILY.open(), interlock=ADMIT_ALL, stop_socket=path)
    known(bus, 1)
    bus.run(write(1, TORQUE, 1, Effect.TORQUE))
    return bus, responder


@pytest.mark.parametrize("garbage", [b"", b"\n", b".", b"hello!", b"\xff" * 4096])
def test_what_is_not_a_request_stops_nothing(tmp_path: Path, garbage: bytes) -> None:
    path = tmp_path / "stop"
    bus, responder = served(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client:
        client.sendto(garbage, str(path))
    assert torque_offs(responder) == []
    assert request_estop(path).acknowledged == (1,), "and the stop still works"
    bus.close()


def test_where_nobody_serves_the_request_says_so(tmp_path: Path) -> None:
    with pytest.raises(PortNotFound, match="no motorbus process"):
        request_estop(tmp_path / "nobody")


def test_a_lost_link_does_not_hang_the_stop() -> None:
    bus, _ = memory_bus(virtual=False)
    known(bus, 1)
    bus.run(write(1, TORQUE, 0, Effect.TORQUE))
    link: Any = bus.link
    link.unplug()
    outcome = bus.estop()
    assert outcome.silent == (1,)
    with pytest.raises(LinkError):
        bus.run(position(1))
    bus.close()


def test_garbage_on_the_line_does_not_hold_the_stop() -> None:
    bus, responder = memory_bus()
    known(bus, 1, 2)

    def babble(to: float) -> list[tuple[float, Any]]:
        return [(to, b"\xff\xaa" * 50), *Responder.advance(responder, to)]

    responder.advance = babble  # type: ignore[method-assign]
    responder.due = lambda: bus.link.now() + 0.001  # type: ignore[method-assign]
    outcome = bus.estop()
    assert torque_offs(responder)[0] == 254
    assert set(outcome.acknowledged) | set(outcome.silent) == {1, 2}


def test_many_triggers_are_one_stop_and_return_at_once(tmp_path: Path) -> None:
    bus, responder = served(tmp_path / "stop")
    responder.dead = {1}
    begun = time.monotonic()
    for _ in range(40):
        bus.trigger_estop()
    assert time.monotonic() - begun < 0.2
    while bus.engine.stopping or not bus.latched:
        time.sleep(0.01)
    assert time.monotonic() - begun < 2 * STOP_TIMEOUT
    bus.close()
