"""rustypot, unmodified, on a pseudo-terminal whose other end says the stream that is due.

    python -S -P tests/interop/differential/rustypot_decoder.py

Nothing of ours is in this process; lines in and out are those of `sdk_decoder.py`, and "patience" in a line is how long
the library waits for bytes that do not come (s). The other end is a child process, for the library keeps Python to
itself while it waits: it learns by a pipe what to say, and says it when a whole request has come.
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

QUICK = 0.004


def serve(master: int, orders: int, answers: int) -> None:
    """The other end: an order is the stream in hexadecimal, or an empty line that asks what has been heard."""
    heard, stream, said, pending = b"", b"", True, b""
    while True:
        ready, _, _ = select.select([master, orders], [], [])
        if master in ready:
            heard += os.read(master, 65536)
            if not said and _is_whole(heard):
                said = True
                os.write(master, stream)
        if orders in ready:
            data = os.read(orders, 65536)
            if not data:
                return
            *lines, pending = (pending + data).split(b"\n")
            for line in lines:
                os.write(answers, heard.hex().encode() + b"\n")
                if line:
                    heard, said, stream = b"", False, bytes.fromhex(line.decode().strip("."))


def _is_whole(packet: bytes) -> bool:
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

    def tell(self, order: str) -> str:
        """Hand over an order; gives what the child had heard until then, in hexadecimal."""
        os.write(self.orders, order.encode() + b"\n")
        return self.file.readline().strip()


class Decoder:
    """One controller for each patience that is asked for."""

    def __init__(self) -> None:
        self.rustypot: Any = import_module("rustypot")
        self.lines: dict[float, tuple[Line, Any]] = {}

    def decode(self, case: dict[str, Any]) -> dict[str, Any]:
        patience = case.get("patience", QUICK)
        if patience not in self.lines:
            line = Line()
            self.lines[patience] = line, self.rustypot.Sts3215PyController(line.name, 1_000_000, patience)
        line, controller = self.lines[patience]
        termios.tcflush(line.slave, termios.TCIFLUSH)
        line.tell("." + case["stream"])
        try:
            gives = {"ok": getattr(self, case["kind"])(controller, case)}
        except Exception as error:
            gives = {"no": str(error)}
        sent = line.tell("")
        while "ok" in gives and not _is_whole(
            bytes.fromhex(sent)
        ):  # what is not answered may still be on its way
            time.sleep(QUICK)
            sent = line.tell("")
        return {"sent": sent, **gives}

    def ping(self, controller: Any, case: dict[str, Any]) -> int:
        """It says no more than yes or no."""
        if not controller.ping(case["node"]):
            raise LookupError("False")
        return 0

    def read(self, controller: Any, case: dict[str, Any]) -> list[Any]:
        data, alarm = controller.read_raw_data_with_error(case["node"], case["address"], case["count"])
        return [list(data), alarm]

    def write(self, controller: Any, case: dict[str, Any]) -> Any:
        data = list(bytes.fromhex(case["data"]))
        return controller.write_raw_data_with_error(case["node"], case["address"], data)

    def sync_read(self, controller: Any, case: dict[str, Any]) -> dict[str, list[int]]:
        found = controller.sync_read_raw_data(case["nodes"], case["address"], case["count"])
        return {str(node): list(data) for node, data in zip(case["nodes"], found, strict=True)}

    def sync_write(self, controller: Any, case: dict[str, Any]) -> None:
        data, nodes = bytes.fromhex(case["data"]), case["nodes"]
        size = len(data) // len(nodes)
        shares = [list(data[place * size : (place + 1) * size]) for place in range(len(nodes))]
        controller.sync_write_raw_data(nodes, case["address"], shares)


def main() -> None:
    """Answer every line."""
    decoder = Decoder()
    for line in sys.stdin:
        print(json.dumps(decoder.decode(json.loads(line))))


if __name__ == "__main__":
    main()
