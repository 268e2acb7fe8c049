"""python-canopen, unmodified, told what to do by lines on standard input.

    python -S tests/interop/canopen_client.py INTERFACE CHANNEL KWARGS EDS NODE

INTERFACE and CHANNEL are python-can's, KWARGS a JSON object of further arguments of its bus, EDS the path of a file,
NODE a number. The path for modules is that of `canopen_peer.environment()`; nothing of ours is in this process, and
`canopen_peer.Canopen` is the other end. Each line is a request in JSON, each answer one line: `{"value": …}`, or
`{"error": …, "kind": …}` with what the library raised (kind "SdoAbortedError" also has "code"). The requests:

    ["read", NAME]                     raw value (a number, or text) of the object with this name in the EDS
    ["write", NAME, VALUE]             raw value, sent with its size as this library always does; gives null
    ["read_phys", NAME], ["write_phys", NAME, VALUE]   the same in the unit of the EDS (degrees)
    ["upload", INDEX, SUBINDEX]        bytes as hexadecimal text, by no dictionary
    ["download", INDEX, SUBINDEX, HEX]
    ["repeat", NAME, COUNT]            read so often: {"seconds": …, "failed": …, "values": different ones, sorted}
    ["timeout", SECONDS]               how long it waits for a reply from now on (its own default is 0.3 s)
    ["scan"]                           its own scanner: numbers of the nodes that answered
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from typing import Any

canopen: Any = import_module("canopen")  # so that types are checked alike whether it is installed or not
SCAN = 0.5  # s


class Client:
    """One node by its dictionary, on a network of its own."""

    def __init__(self, interface: str, channel: str, kwargs: str, eds: str, node: str) -> None:
        self.network = canopen.Network()
        self.network.connect(interface=interface, channel=channel, **json.loads(kwargs))
        self.node = self.network.add_node(int(node, 0), eds)

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

    def download(self, index: int, subindex: int, data: str) -> None:
        self.node.sdo.download(index, subindex, bytes.fromhex(data))

    def repeat(self, name: str, count: int) -> dict[str, Any]:
        variable, failed, values = self._variable(name), 0, set()
        start = time.perf_counter()
        for _ in range(count):
            try:
                values.add(variable.raw)
            except Exception:  # whatever it raises is a reading that failed
                failed += 1
        return {"seconds": time.perf_counter() - start, "failed": failed, "values": sorted(values)}

    def timeout(self, seconds: float) -> None:
        self.node.sdo.RESPONSE_TIMEOUT = seconds

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


def answered(client: Client, request: list[Any]) -> dict[str, Any]:
    """The answer to one request."""
    name, *arguments = request
    try:
        return {"value": getattr(client, name)(*arguments)}
    except Exception as error:  # told to the test as it is
        told = {"error": str(error), "kind": type(error).__name__}
        return {**told, "code": error.code} if isinstance(error, canopen.SdoAbortedError) else told


def main() -> None:
    """Carry out one request a line until standard input ends."""
    client = Client(*sys.argv[1:])
    try:
        for line in sys.stdin:
            print(json.dumps(answered(client, json.loads(line))), flush=True)
    finally:
        client.close()


if __name__ == "__main__":
    main()
