"""canopen-asyncio, as its documentation shows it: one event loop, several nodes by a task each, over slcan."""

from __future__ import annotations

import asyncio
from importlib import import_module
from typing import Any

from bench.can_loop import BITRATE, POSITION, main

canopen: Any = import_module("canopen_asyncio")  # it is in a folder of its own, where no type checker looks


class CanOpenAsyncio:
    """One network on an event loop of its own; `sleep_after_open` leaves out python-can's wait of two seconds."""

    def __init__(self, port: str, nodes: tuple[int, ...]) -> None:
        self.loop = asyncio.new_event_loop()
        self.loop.run_until_complete(self._open(port, nodes))

    async def _open(self, port: str, nodes: tuple[int, ...]) -> None:
        self.network = canopen.Network(loop=self.loop)
        self.network.connect(interface="slcan", channel=port, bitrate=BITRATE, sleep_after_open=0)
        self.nodes = [await self.network.aadd_node(node, canopen.ObjectDictionary()) for node in nodes]

    def read(self, count: int) -> list[list[int]]:
        """So many positions of each node, raw."""
        return self.loop.run_until_complete(self._read(count))

    async def _read(self, count: int) -> list[list[int]]:
        async def endless(upload: Any) -> list[int]:
            return [int.from_bytes(await upload(POSITION, 0), "little", signed=True) for _ in range(count)]

        return list(await asyncio.gather(*(endless(node.sdo.aupload) for node in self.nodes)))

    def close(self) -> None:
        async def close() -> None:
            self.network.disconnect()

        self.loop.run_until_complete(close())
        self.loop.close()


if __name__ == "__main__":
    main(CanOpenAsyncio)
