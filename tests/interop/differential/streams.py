"""FEETECH streams: what our simulators answer, of all six maps, and what may become of that on a line.

What was recorded is taken by the trace of a bus. Mutations are made one by one at every place (`systematic`) and by lot
with a seed (`drawn`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from random import Random
from typing import Final

from motorbus.core import request as core_request
from motorbus.core.request import Expected
from motorbus.families.feetech import FAMILY, protocol
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.simulator import MODELS
from motorbus.families.feetech.traits import TRAITS
from motorbus.link.memory import MemoryLink
from tests.interop.differential.cases import Case, Request
from tests.support.world import make_bus

IDS: Final = (1, 2, 3)
AS_RECORDED: Final = "as recorded"


@cache
def recorded() -> tuple[Case, ...]:
    """Sessions with three simulated servos of each map: what they answered to what."""
    return tuple(case for name in sorted(TABLES) for case in _session(name))


def _session(name: str) -> Iterator[Case]:
    model = next(model for model in sorted(MODELS) if MODELS[model].table.name == name)
    bus = make_bus(
        MemoryLink(FAMILY.simulator(IDS, model), rate=MODELS[model].rate), FAMILY.open(), gate=False
    )
    trace = bus.trace.subscribe()
    for request in _requests(name):
        exchange: core_request.Request[object] = core_request.Request(
            request.packet(), tuple(Expected(node, node, length) for node, length in request.due())
        )
        bus.run(exchange)
        sent, *arrived = trace
        assert sent.data == request.packet()
        yield Case(
            request, b"".join(bytes(one.data) for one in arrived if isinstance(one.data, bytes)), AS_RECORDED
        )


def _requests(name: str) -> Iterator[Request]:
    table, control = TABLES[name], TRAITS[name]
    position, gain = table["present_position"], table["position_p"]
    yield Request("ping", 1)
    yield Request("read", 1, position.address, position.size)
    yield Request("read", 2, 0, 5)
    yield Request("read", 3, position.address, 15)
    yield Request("read", 1, gain.address, 1)
    yield Request("write", 1, gain.address, data=b"\x21")
    yield Request("write", 2, table["goal_velocity"].address, data=b"\xf4\x01")
    yield Request("reg_write", 3, gain.address, data=b"\x22")
    if control.sync_read:
        yield Request("sync_read", protocol.BROADCAST, position.address, 2, nodes=IDS)
        yield Request("sync_read", protocol.BROADCAST, position.address, 8, nodes=IDS[::-1])


# --- what becomes of an answer ----------------------------------------------------------------------------------------

Change = Callable[[Random, Request, bytes], bytes]


def _substituted(random: Random, request: Request, reply: bytes) -> bytes:
    spot = random.randrange(len(reply))
    return reply[:spot] + bytes((reply[spot] ^ random.randrange(1, 256),)) + reply[spot + 1 :]


def _dropped(random: Random, request: Request, reply: bytes) -> bytes:
    spot = random.randrange(len(reply))
    return reply[:spot] + reply[spot + 1 :]


def _inserted(random: Random, request: Request, reply: bytes) -> bytes:
    spot = random.randrange(len(reply) + 1)
    return reply[:spot] + random.randbytes(1) + reply[spot:]


def _doubled(random: Random, request: Request, reply: bytes) -> bytes:
    spot = random.randrange(len(reply))
    return reply[: spot + 1] + reply[spot:]


def _cut(random: Random, request: Request, reply: bytes) -> bytes:
    return reply[: random.randrange(len(reply))]


def _swapped(random: Random, request: Request, reply: bytes) -> bytes:
    spot = random.randrange(len(reply) - 1)
    return reply[:spot] + reply[spot + 1 : spot + 2] + reply[spot : spot + 1] + reply[spot + 2 :]


def _merged(random: Random, request: Request, reply: bytes) -> bytes:
    other = random.choice(recorded()).stream
    return reply + other if random.random() < 0.5 else other + reply


def _half_merged(random: Random, request: Request, reply: bytes) -> bytes:
    return _cut(random, request, reply) + random.choice(recorded()).stream


def _twice(random: Random, request: Request, reply: bytes) -> bytes:
    return reply + reply


def _noise_in_front(random: Random, request: Request, reply: bytes) -> bytes:
    return random.randbytes(random.randrange(1, 9)) + reply


def _header_in_front(random: Random, request: Request, reply: bytes) -> bytes:
    return b"\xff" * random.randrange(1, 5) + reply


def _noise_behind(random: Random, request: Request, reply: bytes) -> bytes:
    return reply + random.randbytes(random.randrange(1, 9))


def _packets(reply: bytes) -> list[bytes]:
    return [data for data, fault in protocol.parser(protocol.MAX_ID).feed(reply) if not fault]


def _remade(reply: bytes, make: Callable[[protocol.Packet], bytes]) -> bytes:
    """Each packet made anew, with a right checksum."""
    return b"".join(make(protocol.decode(one)) for one in _packets(reply))


def _of_another(random: Random, request: Request, reply: bytes) -> bytes:
    return _remade(
        reply, lambda one: protocol.frame((one.id + random.randrange(1, 250)) % 254, one.code, one.parameters)
    )


def _foreign_in_front(random: Random, request: Request, reply: bytes) -> bytes:
    return protocol.frame(random.randrange(4, 254), 0, random.randbytes(random.randrange(4))) + reply


def _longer(random: Random, request: Request, reply: bytes) -> bytes:
    return _remade(reply, lambda one: protocol.frame(one.id, one.code, one.parameters + random.randbytes(1)))


def _shorter(random: Random, request: Request, reply: bytes) -> bytes:
    return _remade(reply, lambda one: protocol.frame(one.id, one.code, one.parameters[:-1]))


def _alarmed(random: Random, request: Request, reply: bytes) -> bytes:
    return _remade(reply, lambda one: protocol.frame(one.id, random.randrange(256), one.parameters))


def _impossible_length(random: Random, request: Request, reply: bytes) -> bytes:
    """A length field of 0 or 1, or above what the SDKs take, and a sum that fits."""
    length = random.choice((0, 1, 247, 255))
    body = bytes((reply[2], length)) + reply[4:-1]
    return protocol.HEADER + body + bytes((protocol.checksum(body),))


def _other_data(random: Random, request: Request, reply: bytes) -> bytes:
    return _remade(reply, lambda one: protocol.frame(one.id, one.code, random.randbytes(len(one.parameters))))


def _echoed(random: Random, request: Request, reply: bytes) -> bytes:
    return request.packet() + reply


def _echo_alone(random: Random, request: Request, reply: bytes) -> bytes:
    return request.packet()


def _out_of_order(random: Random, request: Request, reply: bytes) -> bytes:
    packets = _packets(reply)
    random.shuffle(packets)
    return b"".join(packets)


def _one_missing(random: Random, request: Request, reply: bytes) -> bytes:
    packets = _packets(reply)
    del packets[random.randrange(len(packets))]
    return b"".join(packets)


def _random(random: Random, request: Request, reply: bytes) -> bytes:
    return random.randbytes(random.randrange(24))


CHANGES: Final[dict[str, Change]] = {
    "a byte substituted": _substituted,
    "a byte dropped": _dropped,
    "a byte inserted": _inserted,
    "a byte doubled": _doubled,
    "cut short": _cut,
    "two bytes swapped": _swapped,
    "another answer merged": _merged,
    "cut and another answer merged": _half_merged,
    "the answer twice": _twice,
    "noise in front": _noise_in_front,
    "FF in front": _header_in_front,
    "noise behind": _noise_behind,
    "another id": _of_another,
    "another id in front": _foreign_in_front,
    "a byte more, sum right": _longer,
    "a byte less, sum right": _shorter,
    "any error byte": _alarmed,
    "impossible length, sum right": _impossible_length,
    "any data, sum right": _other_data,
    "echo in front": _echoed,
    "echo alone": _echo_alone,
    "out of order": _out_of_order,
    "one missing": _one_missing,
    "random bytes": _random,
}


def systematic(cases: Sequence[Case]) -> Iterator[Case]:
    """Each answer as it is; every byte dropped, doubled and with a few others in its place; cut at every place."""
    for request, reply, _ in cases:
        yield Case(request, reply, AS_RECORDED)
        for spot, byte in enumerate(reply):
            yield Case(request, reply[:spot], "cut short")
            yield Case(request, reply[:spot] + reply[spot + 1 :], "a byte dropped")
            yield Case(request, reply[: spot + 1] + reply[spot:], "a byte doubled")
            for other in {0x00, 0xFF, byte ^ 1, byte ^ 0x80} - {byte}:
                yield Case(request, reply[:spot] + bytes((other,)) + reply[spot + 1 :], "a byte substituted")


def drawn(seed: int, count: int) -> Iterator[Case]:
    """So many by lot; every fourth is changed twice."""
    random = Random(seed)
    names = list(CHANGES)
    for _ in range(count):
        request, stream, _ = random.choice(recorded())
        chosen = [random.choice(names)]
        if random.random() < 0.25:
            chosen.append(random.choice(names[:10]))
        for name in chosen:
            stream = CHANGES[name](random, request, stream) if len(stream) >= protocol.OVERHEAD else stream
        yield Case(request, stream, ", then ".join(chosen))
