"""python-canopen, unmodified, driven by lines on standard input.

    python -S tests/interop/canopen_client.py CHANNEL BITRATE EDS NODE

Nothing of this project is in the process; CHANNEL is a port with slcan, EDS the path of a file. Each line is a
request in JSON, each answer one line, `{"value": …}` or `{"error": …}`; an abort is the value {"abort": CODE}. The
requests:

    ["read", NAME]                     raw value (a number, or text) of the object with this name in the EDS
    ["write", NAME, VALUE]             raw value, sent with its size
    ["read_phys", NAME], ["write_phys", NAME, VALUE]   the same in the unit of the EDS (degrees)
    ["upload", INDEX, SUBINDEX]        bytes as hexadecimal text, without a dictionary
    ["scan"]                           numbers of the nodes that its scanner finds
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from typing import Any

canopen: Any = import_module("canopen")  # so that types are checked alike whether it is installed or not
SCAN = 0.5  # s
TIMEOUT = 10.0  # s; its own 0.3 s may be short on a busy machine


class Client:
    """One node by its dictionary, on a network of its own."""

    def __init__(self, channel: str, bitrate: str, eds: str, node: str) -> None:
        self.network = canopen.Network()
        self.network.connect(interface="slcan", channel=channel, bitrate=int(bitrate), sleep_after_open=0)
        self.node = self.network.add_node(int(node, 0), eds)
        self.node.sdo.RESPONSE_TIMEOUT = TIMEOUT

    def read(self, name: str) -> Any:
        return self._variable(name).raw

    def write(self, name: str, value: Any) -> None:
        self._variable(name).raw = value

    def read_phys(self, name: str) -> Any:
        return self._variable(name).phys

    def write_phys(self, name: str, value: Any) -> None:
        self._variable(name).phys = value

    def upload(self, index: int, subindex: int) -> str:
        return bytes(self.node.sdo.upload(index, subindex)).hex()

    def scan(self) -> list[int]:
        self.network.scanner.reset()
        self.network.scanner.search()
        time.sleep(SCAN)
        return sorted(self.network.scanner.nodes)

    def close(self) -> None:
        self.network.disconnect()

    def _variable(self, name: str) -> Any:
        """Its own look-up by name does not reach into arrays."""
        for item in self.node.object_dictionary.values():
            simple = isinstance(item, canopen.objectdictionary.ODVariable)
            if simple and item.name == name:
                return self.node.sdo[item.index]
            if not simple and name in item:
                return self.node.sdo[item.index][name]
        raise KeyError(name)


def main() -> None:
    client = Client(*sys.argv[1:])
    try:
        for line in sys.stdin:
            name, *arguments = json.loads(line)
            try:
                answer = {"value": getattr(client, name)(*arguments)}
            except canopen.SdoAbortedError as abort:
                answer = {"value": {"abort": abort.code}}
            except Exception as error:
                answer = {"error": repr(error)}
            print(json.dumps(answer), flush=True)
    finally:
        client.close()


if __name__ == "__main__":
    main()
