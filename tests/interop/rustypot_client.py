"""rustypot, unmodified, told what to do by lines on standard input.

Runs in a process of its own with nothing of ours in it. Each line is a request in JSON, `["read", 1, 56, 2]`; each
answer is one line `{"value": …}`, or `{"error": …}` with what rustypot said. Bytes travel as lists of numbers.
"""

from __future__ import annotations

import json
import sys

import rustypot  # type: ignore[import-not-found]


class Client:
    """The calls of its STS3215 controller under names that both clients share; angles are its own radians."""

    def __init__(self, port: str) -> None:
        self.controller = rustypot.Sts3215PyController(port, 1_000_000, 3.0)

    def ping(self, node: int) -> bool:
        return bool(self.controller.ping(node))

    def scan(self, nodes: list[int]) -> list[list[int]]:
        return [[node, model] for node, model in self.controller.scan(nodes).items()]

    def read(self, node: int, address: int, count: int) -> list[int]:
        return list(self.controller.read_raw_data(node, address, count))

    def write(self, node: int, address: int, data: list[int]) -> None:
        self.controller.write_raw_data(node, address, data)

    def sync_read(self, nodes: list[int], address: int, count: int) -> list[list[int]]:
        return [list(data) for data in self.controller.sync_read_raw_data(nodes, address, count)]

    def sync_write(self, nodes: list[int], address: int, data: list[list[int]]) -> None:
        self.controller.sync_write_raw_data(nodes, address, data)

    def positions(self, nodes: list[int]) -> list[float]:
        return [float(angle) for angle in self.controller.sync_read_present_position(nodes)]

    def read_register(self, node: int, name: str) -> int:
        return int(self.controller.read_register(node, name))

    def write_register(self, node: int, name: str, value: int) -> None:
        self.controller.write_register(node, name, value)


def main() -> None:
    """Carry out one request a line until standard input ends."""
    client = Client(sys.argv[1])
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        try:
            answer = {"value": getattr(client, name)(*arguments)}
        except Exception as error:
            answer = {"error": repr(error)}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
