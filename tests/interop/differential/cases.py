"""What is put before every decoder: a request, the bytes that come back, and how these were made.

An outcome is what a decoder makes of that: a value as plain data, or why there is none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from motorbus.families.feetech import protocol


class Request(NamedTuple):
    """A FEETECH request: `kind` is ping, read, write, reg_write, sync_read, sync_write or action."""

    kind: str
    node: int = 1
    address: int = 0
    size: int = 0
    data: bytes = b""
    nodes: tuple[int, ...] = ()

    def packet(self) -> bytes:
        """As we send it."""
        if self.kind == "ping":
            return protocol.ping(self.node)
        if self.kind == "action":
            return protocol.action(self.node)
        if self.kind == "read":
            return protocol.read(self.node, self.address, self.size)
        if self.kind == "sync_read":
            return protocol.sync_read(self.address, self.size, self.nodes)
        if self.kind == "sync_write":
            size = len(self.data) // len(self.nodes)
            shares = [self.data[place * size : (place + 1) * size] for place in range(len(self.nodes))]
            return protocol.sync_write(self.address, list(zip(self.nodes, shares, strict=True)))
        made = protocol.write if self.kind == "write" else protocol.reg_write
        return made(self.node, self.address, self.data)

    def due(self) -> tuple[tuple[int, int], ...]:
        """Node and length of each reply."""
        if self.kind == "sync_read":
            return tuple((node, self.size + protocol.OVERHEAD) for node in self.nodes)
        return ((self.node, protocol.OVERHEAD + (self.size if self.kind == "read" else 0)),)


class Case(NamedTuple):
    """A request, what comes back in one piece, and what was done to that."""

    request: Request
    stream: bytes
    change: str

    def line(self) -> dict[str, Any]:
        """As the decoders of others take it."""
        request = self.request
        return {
            "kind": request.kind,
            "node": request.node,
            "address": request.address,
            "count": request.size,
            "data": request.data.hex(),
            "nodes": list(request.nodes),
            "stream": self.stream.hex(),
        }


class Outcome(NamedTuple):
    """`value` when it was taken for an answer, else `why` there is none."""

    value: Any
    why: str = ""

    @property
    def taken(self) -> bool:
        return not self.why
