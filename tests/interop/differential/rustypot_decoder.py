"""rustypot, unmodified, on a pseudo-terminal whose other end sends the stream of the request.

    python -S -P tests/interop/differential/rustypot_decoder.py TIMEOUT

Nothing of this project is in the process; input and output are those of `sdk_decoder.py`. The other end is a child
process, because the library holds the interpreter lock while it waits. It gets the stream by a pipe, and sends it
when a whole request has arrived.
"""

from __future__ import annotations

import json
import os
import select
import sys
import termios
import time
import tty
from importlib import import_module
from typing import Any


def serve(master: int, orders: int, answers: int) -> None:
    """The other end: an order is "." and a stream in hexadecimal, or an empty line that asks what has arrived."""
    arrived, stream, is_sent, pending = b"", b"", True, b""
    while True:
        ready, _, _ = select.select([master, orders], [], [])
        if master in ready:
            arrived += os.read(master, 65536)
            if not is_sent and is_whole(arrived):
                is_sent = True
                os.write(master, stream)
        if orders in ready:
            data = os.read(orders, 65536)
            if not data:
                return
            *lines, pending = (pending + data).split(b"\n")
            for line in lines:
                os.write(answers, arrived.hex().encode() + b"\n")
                if line:
                    arrived, is_sent, stream = b"", False, bytes.fromhex(line.decode().strip("."))


def is_whole(packet: bytes) -> bool:
    return len(packet) > 3 and len(packet) >= packet[3] + 4


class Line:
    """A pseudo-terminal and the child behind it."""

    def __init__(self) -> None:
        master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.name = os.ttyname(self.slave)
        orders, self.orders = os.pipe()
        self.answers, answers = os.pipe()
        if not os.fork():
            os.close(self.orders)
            serve(master, orders, answers)
            os._exit(0)
        os.close(orders)
        os.close(master)
        self.file = os.fdopen(self.answers)

    def order(self, text: str) -> str:
        """Send an order; returns what had arrived until then, in hexadecimal."""
        os.write(self.orders, text.encode() + b"\n")
        return self.file.readline().strip()


def decode(line: Line, controller: Any, case: dict[str, Any]) -> tuple[str, dict[int, Any]]:
    termios.tcflush(line.slave, termios.TCIFLUSH)
    line.order("." + case["stream"])
    try:
        values = call(controller, **case)
    except Exception:
        return line.order(""), {}
    while not is_whole(bytes.fromhex(sent := line.order(""))):  # a request without a reply is on its way
        time.sleep(0.001)
    return sent, values


def call(
    controller: Any,
    kind: str,
    node: int,
    address: int,
    size: int,
    data: str,
    nodes: list[int],
    stream: str,
) -> dict[int, Any]:
    values = list(bytes.fromhex(data))
    if kind == "ping":  # it says yes or no
        return {node: True} if controller.ping(node) else {}
    if kind == "read":
        return {node: list(controller.read_raw_data(node, address, size))}
    if kind == "write":
        return {node: controller.write_raw_data_with_error(node, address, values)}
    if kind == "sync_read":
        found = controller.sync_read_raw_data(nodes, address, size)
        return {node: list(one) for node, one in zip(nodes, found, strict=True)}
    size = len(values) // len(nodes)
    controller.sync_write_raw_data(
        nodes, address, [values[at : at + size] for at in range(0, len(values), size)]
    )
    return {}


def main() -> None:
    line = Line()
    controller = import_module("rustypot").Sts3215PyController(line.name, 1_000_000, float(sys.argv[1]))
    for text in sys.stdin:
        print(json.dumps(decode(line, controller, json.loads(text))))


if __name__ == "__main__":
    main()
