"""Both ways in which a loop learns of bytes: a descriptor, and a thread where there is none."""

from __future__ import annotations

import asyncio
import socket
import threading

import pytest

from motorbus.bus.aio import AsyncBus
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
