"""The same request, made by us and by others: the bytes must be the same, or the difference must have a name."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Final

from motorbus.families.feetech import protocol
from tests.interop.differential.cases import Case, Request
from tests.interop.differential.judging import UNEXPLAINED
from tests.interop.differential.outside import Decoder

SDK_LONGEST: Final = 250


def requests(seed: int, count: int) -> Iterator[Case]:
    """FEETECH requests by lot, each answered as a servo would, so that nobody has to wait."""
    random = Random(seed)
    for _ in range(count):
        request = _request(random)
        yield Case(request, _answer(request), "a request")


def _request(random: Random) -> Request:
    kind = random.choice(("ping", "read", "write", "reg_write", "sync_read", "sync_write", "action"))
    node, address, size = random.randrange(254), random.randrange(200), random.randrange(1, 17)
    if random.random() < 0.1:
        address, size = 0, random.randrange(230, 253)
    nodes = tuple(random.sample(range(254), random.randrange(1, 13)))
    if kind == "read":
        return Request(kind, node, address, size)
    if kind in ("write", "reg_write"):
        return Request(kind, node, address, data=random.randbytes(size))
    if kind == "sync_read":
        return Request(kind, protocol.BROADCAST, address, size, nodes=nodes)
    if kind == "sync_write":
        size = min(size, 8)
        return Request(
            kind, protocol.BROADCAST, address, data=random.randbytes(size * len(nodes)), nodes=nodes
        )
    return Request(kind, protocol.BROADCAST if kind == "action" else node)


def _answer(request: Request) -> bytes:
    """What a servo would say; no packet has more than 259 bytes."""
    if request.kind in ("sync_write", "action"):
        return b""
    return b"".join(
        protocol.frame(node, 0, bytes(length - protocol.OVERHEAD)) for node, length in request.due()
    )


def classes(decoder: Decoder, case: Case, sent: str) -> set[str]:
    """Why these are not our bytes; empty where they are."""
    ours = case.request.packet()
    if bytes.fromhex(sent) == ours:
        return set()
    if not sent and len(ours) > SDK_LONGEST:
        return {"frame-of-250"}
    return {UNEXPLAINED}
