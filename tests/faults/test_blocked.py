"""Row L14: a port that takes nothing any more. Every call ends, a stop has its own way out, and later all is well.

In virtual time a link that refuses to the microsecond; on the system a pseudo-terminal and a socket of which nobody
reads the other end until they are full.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest

from motorbus.bus.pump import Bus
from motorbus.bus.stop import ROUND_TIME, ROUNDS
from motorbus.core.operation import Data
from motorbus.errors import Interrupted, LinkError, MotorbusError, NoReply
from motorbus.families.feetech import FAMILY
from motorbus.link.base import Link
from motorbus.link.errors import full
from motorbus.link.serial import SerialLink
from motorbus.link.tcp import TcpLink
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from tests.bus.responder import Responder, position
from tests.bus.script import admit_all
from tests.faults.scenes import IDS, Scene, off
from tests.support.mounts import served

CALLERS = 8


def stopped(there: Scene) -> None:
    """A bus on which something moves, and every device has answered once."""
    off(there)
    for device in there.devices:
        device.ping()


class Refusing:
    """Puts itself before the `write` of a link, and takes nothing while it is `blocked`; `fired` counts."""

    def __init__(self, link: Any) -> None:
        self.blocked = False
        self.fired = 0
        self._write = link.write
        link.write = self

    def __call__(self, data: Data) -> None:
        if self.blocked:
            self.fired += 1
            raise full("memory", 0, 8)
        self._write(data)


@pytest.mark.parametrize("family", IDS)
def test_l14_a_port_that_is_full_fails_calls_soon_and_a_stop_in_its_time(family: str) -> None:
    there = Scene(family)
    stopped(there)
    refusing = Refusing(there.link)
    refusing.blocked = True
    before = there.link.now()
    for _ in range(10):
        with pytest.raises(LinkError, match="takes no more bytes"):
            there.bus.run(there.asked())
    quiet = there.family.quiet_time(there.link.rate)
    assert there.link.now() - before <= 10 * (quiet + 0.005), "no time is lost on what cannot leave"
    assert there.bus.estop().acknowledged == ()
    assert there.link.now() - before <= ROUNDS * (ROUND_TIME + 0.5)
    assert refusing.fired >= 10 + ROUNDS
    refusing.blocked = False
    assert set(there.bus.estop().acknowledged) == set(there.ids)
    there.bus.reset()
    there.settle()
    assert not there.moving()
    there.stir()
    assert there.true(there.bus.run(there.asked()))


@pytest.mark.parametrize("family", IDS)
def test_l14_a_stop_goes_out_as_soon_as_there_is_room(family: str) -> None:
    there = Scene(family)
    stopped(there)
    refusing = Refusing(there.link)
    refusing.blocked = True
    room = there.link.now() + 0.12
    read = there.link.read

    def reading(until: float) -> list[Data]:
        found = read(min(until, room) if there.link.now() < room else until)
        refusing.blocked = there.link.now() < room
        return found

    there.link.read = reading  # type: ignore[method-assign]
    assert there.ids[0] in there.bus.estop().acknowledged
    assert refusing.fired
    there.settle()
    assert not there.moving()


@contextmanager
def terminal() -> Iterator[tuple[Link, PtyMaster]]:
    """A port of which nobody reads the other end."""
    with closing(PtyMaster()) as master:
        link = SerialLink(master.slave_name, rate=1_000_000)
        try:
            yield link, master
        finally:
            link.close()


@contextmanager
def window() -> Iterator[tuple[Link, socket.socket]]:
    """A connection whose other end does not read: soon its window is shut."""
    with closing(socket.socket()) as door:
        door.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        door.bind(("127.0.0.1", 0))
        door.listen(1)
        link = TcpLink(f"socket://127.0.0.1:{door.getsockname()[1]}", rate=1_000_000)
        link._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        end, _ = door.accept()
        with closing(end):
            try:
                yield link, end
            finally:
                link.close()


def fill(link: Link) -> int:
    """Write until it takes no more; how much it took."""
    taken = 0
    while taken < 1 << 24:
        try:
            link.write(bytes(64))
        except LinkError:
            return taken
        taken += 64
    raise AssertionError("it has no end")


@pytest.mark.timeout(120)
@pytest.mark.parametrize("port", [terminal, window], ids=["pseudo-terminal", "socket"])
def test_l14_on_a_real_port_every_call_of_every_thread_ends_and_so_does_a_stop(port: Any) -> None:
    """And nobody is told anything but that it was not sent, or was not answered."""
    failed: list[MotorbusError] = []
    with port() as (link, _):
        bus = Bus(link, FAMILY, interlock=admit_all)
        assert fill(link) > 0, "until it refused"

        def call(node: int) -> None:
            for _ in range(3):
                with pytest.raises((LinkError, NoReply, Interrupted)) as caught:
                    bus.run(position(node))
                failed.append(caught.value)

        callers = [threading.Thread(target=call, args=(1 + who,)) for who in range(CALLERS)]
        for caller in callers:
            caller.start()
        outcome = bus.estop()
        for caller in callers:
            caller.join()
        assert outcome.acknowledged == ()
        with bus.lock:
            pass
        bus.close()
    assert len(failed) == 3 * CALLERS


@pytest.mark.timeout(120)
def test_l14_a_terminal_that_is_read_again_is_right_again() -> None:
    """What had piled up is heard late and answered late; none of it is taken for the answer to what is asked now."""
    with terminal() as (link, master):
        bus = Bus(link, FAMILY, interlock=admit_all)
        fill(link)
        with pytest.raises(LinkError):
            bus.run(position(1))
        with served(Mount(Responder(), master)):
            told: list[int] = []
            while len(told) < 20:
                try:
                    told.append(bus.run(position(1 + len(told))))
                except MotorbusError:
                    assert bus.statistics.of(1).sent < 200
            assert told == list(range(1, 21))
        bus.close()
