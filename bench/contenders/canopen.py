"""python-canopen over slcan, by its cheapest call: raw bytes without an object dictionary; a thread for each node."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any

from bench.measure import Contender, main
from bench.workloads import BITRATE, NODES

canopen: Any = import_module("canopen")


class CanOpen(Contender):
    """One network; `sleep_after_open` is python-can's option to leave out its wait of two seconds."""

    family = "kst"

    def __init__(self, port: str) -> None:
        network = canopen.Network()
        network.connect(interface="slcan", channel=port, bitrate=BITRATE, sleep_after_open=0)
        self.nodes = [network.add_node(node, canopen.ObjectDictionary()) for node in NODES]
        self.threads = ThreadPoolExecutor(len(NODES))

    def read(self) -> int:
        return _read(self.nodes[0])

    def read_group(self) -> list[int]:
        return list(self.threads.map(_read, self.nodes))


def _read(node: Any) -> int:
    return int.from_bytes(node.sdo.upload(0x6002, 0), "little", signed=True)


if __name__ == "__main__":
    main(CanOpen)
