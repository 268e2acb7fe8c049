"""Other FEETECH libraries and motorbus get the same streams: who takes one takes the same value from it.

Two SDKs and rustypot run in processes of their own. The requests have to be the same bytes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import pytest

from motorbus.core.request import Expected, Response
from motorbus.core.request import Request as CoreRequest
from motorbus.families.feetech import FAMILY, protocol
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.simulator import MODELS
from motorbus.families.feetech.traits import TRAITS
from motorbus.link.memory import MemoryLink
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, folders
from tests.support.world import Tries, make_bus

HERE: Final = Path(__file__).resolve().parent
SCRIPTS: Final = {
    OLD_SDK: ("sdk_decoder.py", "old"),
    NEW_SDK: ("sdk_decoder.py", "new"),
    RUSTYPOT: ("rustypot_decoder.py",),
}
KINDS: Final = ("ping", "read", "write", "reg_write", "sync_read", "sync_write", "action")
NO_CALL: Final = {RUSTYPOT: ("reg_write", "action")}
QUICK: Final = 0.004  # s that rustypot waits for bytes which may not come
LONG: Final = 2.0  # s for bytes that come
SDK_LONGEST: Final = 250  # bytes of a request
SEED: Final = 20
IDS: Final = (1, 2, 3)


class Request(NamedTuple):
    """A FEETECH request: `kind` is one of `KINDS`."""

    kind: str
    node: int = 1
    address: int = 0
    size: int = 0
    data: bytes = b""
    nodes: tuple[int, ...] = ()

    def packet(self) -> bytes:
        if self.kind in ("ping", "action"):
            return (protocol.ping if self.kind == "ping" else protocol.action)(self.node)
        if self.kind == "read":
            return protocol.read(self.node, self.address, self.size)
        if self.kind == "sync_read":
            return protocol.sync_read(self.address, self.size, self.nodes)
        if self.kind == "sync_write":
            size = len(self.data) // len(self.nodes)
            shares = [self.data[at : at + size] for at in range(0, len(self.data), size)]
            return protocol.sync_write(self.address, list(zip(self.nodes, shares, strict=True)))
        encode = protocol.write if self.kind == "write" else protocol.reg_write
        return encode(self.node, self.address, self.data)

    def due(self) -> dict[int, int]:
        """Length of the reply of each node."""
        if self.kind == "sync_read":
            return dict.fromkeys(self.nodes, self.size + protocol.OVERHEAD)
        return {self.node: protocol.OVERHEAD + (self.size if self.kind == "read" else 0)}

    def exchange(self) -> CoreRequest[Response]:
        return CoreRequest(
            self.packet(), tuple(Expected(node, node, size) for node, size in self.due().items())
        )


class Case(NamedTuple):
    """A request, and the bytes that come back in one piece."""

    request: Request
    stream: bytes


Values = dict[int, Any]
"""What each node is taken to have answered: data of a read, else the error byte; True for a ping of rustypot."""


# -- streams -------------------------------------------------------------------------------------------------------


@cache
def recorded() -> tuple[Case, ...]:
    """What three simulated servos of each register map answer."""
    return tuple(case for name in sorted(TABLES) for case in _session(name))


def _session(name: str) -> Iterator[Case]:
    model = next(model for model in sorted(MODELS) if MODELS[model].table.name == name)
    link = MemoryLink(FAMILY.simulator(IDS, model), rate=MODELS[model].rate)
    bus = make_bus(link, FAMILY.open(), gate=False)
    trace = bus.trace.subscribe()
    position, gain = TABLES[name]["present_position"], TABLES[name]["position_p"]
    requests = [
        Request("ping", 1),
        Request("read", 1, position.address, position.size),
        Request("read", 3, position.address, 15),
        Request("read", 1, gain.address, 1),
        Request("write", 1, gain.address, data=b"\x21"),
        Request("reg_write", 3, gain.address, data=b"\x22"),
    ]
    if TRAITS[name].sync_read:
        requests.append(Request("sync_read", protocol.BROADCAST, position.address, 2, nodes=IDS))
        requests.append(Request("sync_read", protocol.BROADCAST, position.address, 8, nodes=IDS[::-1]))
    for request in requests:
        bus.run(request.exchange())
        sent, *arrived = trace
        assert sent.data == request.packet()
        yield Case(request, b"".join(bytes(one.data) for one in arrived if isinstance(one.data, bytes)))


def _damage(random: Random, request: Request, reply: bytes) -> bytes:
    """The reply changed as a line, an echo or another servo may change it."""
    at = random.randrange(len(reply))
    head, tail = reply[:at], reply[at:]
    packet = protocol.decode(_packets(reply)[0])
    return random.choice(
        (
            head,
            head + tail[1:],
            head + tail[:1] + tail,
            head + random.randbytes(1) + tail[1:],
            head + random.randbytes(1) + tail,
            random.randbytes(at) + reply,
            b"\xff" * random.randrange(1, 5) + reply,
            reply + random.randbytes(at),
            reply + reply,
            head + random.choice(recorded()).stream,
            random.choice(recorded()).stream + reply,
            request.packet() + reply,
            request.packet(),
            protocol.frame((packet.id + 1) % 254, packet.code, packet.parameters),
            protocol.frame(random.randrange(4, 254), 0, b"\x01") + reply,
            protocol.frame(packet.id, packet.code, packet.parameters + b"\x01"),
            protocol.frame(packet.id, packet.code, packet.parameters[:-1]),
            protocol.frame(packet.id, random.randrange(256), packet.parameters),
            b"".join(_packets(reply)[::-1]),
            b"".join(_packets(reply)[1:]),
        )
    )


def _packets(reply: bytes) -> list[bytes]:
    return [data for data, fault in protocol.parser(protocol.MAX_ID).feed(reply) if not fault]


def damaged(seed: int, count: int) -> list[Case]:
    random = Random(seed)
    chosen = [random.choice(recorded()) for _ in range(count)]
    return [Case(request, _damage(random, request, stream)) for request, stream in chosen]


def requests(seed: int, count: int) -> Iterator[Case]:
    """Random requests, each with the reply of a servo, so that no library waits."""
    random = Random(seed)
    for _ in range(count):
        kind = random.choice(KINDS)
        node, address, size = random.randrange(254), random.randrange(200), random.randrange(1, 17)
        if random.random() < 0.1:
            address, size = 0, random.randrange(230, 253)
        nodes = tuple(random.sample(range(254), random.randrange(1, 13))) if kind.startswith("sync") else ()
        if nodes or kind == "action":
            node = protocol.BROADCAST
        data = b""
        if kind.endswith("write"):
            data = random.randbytes(min(size, 8) * len(nodes) if nodes else size)
        request = Request(kind, node, address, size, data, nodes)
        replies = [
            protocol.frame(node, 0, bytes(size - protocol.OVERHEAD)) for node, size in request.due().items()
        ]
        yield Case(request, b"" if kind in ("sync_write", "action") else b"".join(replies))


# -- decoders ------------------------------------------------------------------------------------------------------


def ours(case: Case) -> Values:
    """By the receiver of the family and the rules of the bus; the first try only, as other libraries have one."""
    response, _ = Tries(FAMILY, 1_000_000).answered(case.request.exchange(), [case.stream])
    replies = [] if response is None else [protocol.decode(reply.data) for reply in response.replies]
    has_data = case.request.kind in ("read", "sync_read")
    return {reply.id: list(reply.parameters) if has_data else reply.code for reply in replies}


def theirs(library: Library, cases: Sequence[Case], timeout: float = LONG) -> list[tuple[bytes, Values]]:
    """What the library sends for each case, and what it takes."""
    lines = [
        json.dumps({**request._asdict(), "data": request.data.hex(), "stream": stream.hex()})
        for request, stream in cases
    ]
    script, *arguments = SCRIPTS[library]
    done = subprocess.run(
        [sys.executable, "-S", "-P", str(HERE / "differential" / script), *arguments, str(timeout)],
        input="\n".join(lines) + "\n",
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": folders(library)},
        check=False,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert (done.returncode, len(answers)) == (0, len(cases)), done.stderr[-2000:]
    return [
        (bytes.fromhex(sent), {int(node): value for node, value in values.items()})
        for sent, values in answers
    ]


def supported(library: Library, cases: Sequence[Case]) -> list[Case]:
    return [case for case in cases if case.request.kind not in NO_CALL.get(library, ())]


def agree(case: Case, mine: Any, other: Any) -> bool:
    """rustypot's ping gives True. A library may take the echo of its own request for the answer."""
    return other is True or mine == other or case.stream.startswith(case.request.packet())


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("library", SCRIPTS, ids=lambda library: library.name)
def test_libraries_take_the_same_values(library: Library, rounds: Callable[..., int]) -> None:
    clean = supported(library, recorded())
    for case, (sent, values) in zip(clean, theirs(library, clean), strict=True):
        assert sent == case.request.packet()
        expected = ours(case)
        assert set(values) == set(expected) == set(case.request.due())
        assert all(agree(case, expected[node], values[node]) for node in values), case
    cases = supported(library, damaged(SEED, rounds(20_000, 1_000)))
    both = 0
    for case, (_, values) in zip(cases, theirs(library, cases, QUICK), strict=True):
        expected = ours(case)
        for node in values.keys() & expected.keys():
            both += 1
            assert agree(case, expected[node], values[node]), case
    assert both > 100


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("library", SCRIPTS, ids=lambda library: library.name)
def test_the_same_request_is_the_same_bytes(library: Library) -> None:
    cases = supported(library, list(requests(SEED, 1_000)))
    for case, (sent, _) in zip(cases, theirs(library, cases), strict=True):
        packet = case.request.packet()
        if library is RUSTYPOT or len(packet) <= SDK_LONGEST:
            assert sent == packet
        else:
            assert sent in (b"", packet)  # the SDKs refuse; the length byte allows 259 bytes


def test_what_is_taken_is_a_whole_packet_of_the_length_that_is_due(rounds: Callable[..., int]) -> None:
    """By another way of finding packets than the one that is tested."""
    taken = 0
    for case in damaged(SEED + 1, rounds(10_000)):
        for node, value in ours(case).items():
            taken += 1
            length = case.request.due()[node]
            packets = [case.stream[at : at + length] for at in range(len(case.stream) - length + 1)]
            head = protocol.HEADER + bytes((node, length - 4))
            good = [one for one in packets if one.startswith(head) and sum(one[2:]) & 0xFF == 0xFF]
            data = case.request.kind in ("read", "sync_read")
            assert value in [list(one[5:-1]) if data else one[4] for one in good], case
    assert taken > 100
