"""python-canopen, as its documentation shows it, on a bus over slcan; several nodes by a thread each.

Its `upload` is the cheapest call it has: raw bytes, without a dictionary of objects.
"""

from __future__ import annotations

from importlib import import_module
from threading import Thread
from typing import Any

from bench.can_loop import BITRATE, POSITION, main

canopen: Any = import_module("canopen")  # it is in a folder of its own, where no type checker looks


class CanOpen:
    """One network; `sleep_after_open` is python-can's own option to leave out its wait of two seconds."""

    def __init__(self, port: str, nodes: tuple[int, ...]) -> None:
        self.network = canopen.Network()
        self.network.connect(interface="slcan", channel=port, bitrate=BITRATE, sleep_after_open=0)
        self.nodes = [self.network.add_node(node, canopen.ObjectDictionary()) for node in nodes]

    def read(self, count: int) -> list[list[int]]:
        """So many positions of each node, raw."""
        values: list[list[int]] = [[] for _ in self.nodes]

        def endless(place: int) -> None:
            upload, keep = self.nodes[place].sdo.upload, values[place].append
            for _ in range(count):
                keep(int.from_bytes(upload(POSITION, 0), "little", signed=True))

        if len(self.nodes) == 1:
            endless(0)
        else:
            threads = [Thread(target=endless, args=(place,)) for place in range(len(self.nodes))]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        return values

    def close(self) -> None:
        self.network.disconnect()


if __name__ == "__main__":
    main(CanOpen)
