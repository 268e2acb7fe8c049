"""Both ways in which a loop learns of bytes: a descriptor, and a thread where there is none."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from typing import Any

import pytest

from motorbus.bus.aio import AsyncBus
from motorbus.bus.turns import Turns
from motorbus.bus.watch import Watch
from motorbus.errors import LinkLost, MotorbusError
from motorbus.families.feetech import FAMILY
from motorbus.link.tcp import TcpLink
from tests.bus.responder import Responder, async_bus, position
from tests.bus.script import admit_all


def reader_threads() -> int:
    return sum(thread.name == "motorbus reader" for thread in threading.enumerate())


def test_without_a_descriptor_one_thread_reads_and_ends_with_the_bus() -> None:
    async def main() -> None:
        bus, _ = async_bus(virtual=False)
        assert bus.link.fileno() is None
        async with bus:
            assert await asyncio.gather(*(bus.run(position(n)) for n in range(1, 9))) == list(range(1, 9))
            assert reader_threads() == 1

    asyncio.run(main())
    for thread in threading.enumerate():
        if thread.name == "motorbus reader":
            thread.join(10)
    assert reader_threads() == 0


def test_with_a_descriptor_the_loop_watches_it_and_there_is_no_thread() -> None:
    responder = Responder()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            client, _ = server.accept()
            with client:
                while data := client.recv(4096):
                    responder.receive(data, 0.0)
                    for _, answer in responder.advance(1.0):
                        assert isinstance(answer, bytes)
                        client.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()

        async def main() -> None:
            link = TcpLink(f"socket://127.0.0.1:{server.getsockname()[1]}", rate=1_000_000)
            async with AsyncBus(link, FAMILY, admit=admit_all) as bus:
                assert await asyncio.gather(*(bus.run(position(n)) for n in range(1, 9))) == list(range(1, 9))
                assert reader_threads() == 0

        asyncio.run(main())
        thread.join(10)
    assert not thread.is_alive()


def test_a_link_that_is_gone_does_not_keep_the_loop_busy() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        async def main() -> int:
            link = TcpLink(f"socket://127.0.0.1:{server.getsockname()[1]}", rate=1_000_000)
            looks = 0
            async with AsyncBus(link, FAMILY, admit=admit_all) as bus:
                take = bus.watch.crank

                def counted() -> None:
                    nonlocal looks
                    looks += 1
                    take()

                bus.watch.crank = counted  # type: ignore[method-assign]
                client, _ = server.accept()
                client.close()
                with pytest.raises(MotorbusError):
                    await bus.run(position(1))
                looks = 0
                await asyncio.sleep(0.2)
                return looks

        assert asyncio.run(main()) <= 2


def test_a_bus_that_is_closed_says_so_and_one_loop_may_follow_another() -> None:
    async def ask(bus: AsyncBus) -> int:
        return await bus.run(position(1))

    bus, _ = async_bus(virtual=False)
    assert asyncio.run(ask(bus)) == 1
    assert asyncio.run(ask(bus)) == 1
    asyncio.run(bus.close())
    with pytest.raises(LinkLost):
        asyncio.run(ask(bus))


@pytest.mark.parametrize("seen_by", ["the loop", "another thread"])
def test_a_descriptor_is_let_go_before_its_number_is_another_files(seen_by: str) -> None:
    class Pulled:
        """A link that was lost; when it is opened anew its old descriptor is closed."""

        def __init__(self) -> None:
            self.ends = socket.socketpair()
            self.watched: list[bool] = []

        def now(self) -> float:
            return time.monotonic()

        def fileno(self) -> int:
            return self.ends[0].fileno()

        def read(self, until: float) -> list[bytes]:
            return []

        def renew(self, losses: int) -> None:
            self.watched.append(asyncio.get_running_loop().remove_reader(self.fileno()))
            raise LinkLost("it is not there")

    async def main() -> None:
        link: Any = Pulled()
        turns = Turns(FAMILY, rate=1_000_000)
        turns.renewal = link
        watch = Watch(link, turns)
        watch.start(asyncio.get_running_loop())
        turns.lost(LinkLost("it was pulled"))
        if seen_by == "the loop":
            watch.crank()
        watch.start(asyncio.get_running_loop())
        assert link.watched
        assert not any(link.watched)
        for end in link.ends:
            end.close()

    asyncio.run(main())
