"""Where two decoders differ, and why: each difference of a FEETECH stream gets the name of its class, or none.

A class is told by the bytes of the stream and by what the request asked for. So a difference that is new, in theirs or
in ours, has no name, and the test fails. Answers of groups are compared servo by servo.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from motorbus.families.feetech import protocol
from tests.interop.differential.cases import Case, Outcome
from tests.interop.differential.outside import NEW, OLD, RUST, Decoder

UNEXPLAINED: Final = "unexplained"
SDK_MOST_ERROR: Final = 0x7F


class Packet(NamedTuple):
    """Bytes that are a whole status packet with a right sum, wherever they begin."""

    at: int
    node: int
    error: int
    data: list[int]
    end: int


def packets(stream: bytes) -> list[Packet]:
    """All there are, those inside others too."""
    found = []
    for at in range(len(stream) - protocol.OVERHEAD + 1):
        end = at + stream[at + 3] + 4
        packet = stream[at:end]
        whole = packet[:2] == protocol.HEADER and packet[3] > 1 and len(packet) == end - at
        if whole and packet[2] <= protocol.MAX_ID and protocol.is_valid(packet):
            found.append(Packet(at, packet[2], packet[4], list(packet[5:-1]), end))
    return found


def classes(decoder: Decoder, case: Case, ours: Outcome, theirs: Outcome) -> set[str]:
    """The names of all differences between the two; empty where they agree."""
    mine, others = _by_node(decoder, case, ours), _by_node(decoder, case, theirs)
    return {
        _class(decoder, case, node, mine, others, ours.why)
        for node in mine.keys() | others.keys()
        if mine.get(node) != others.get(node)
    }


def _by_node(decoder: Decoder, case: Case, outcome: Outcome) -> dict[int, Any]:
    """What each servo is taken to have said. rustypot's ping tells that there is an answer, and no more."""
    if not outcome.taken:
        return {}
    if case.request.kind == "sync_read":
        return {int(node): data for node, data in outcome.value.items()}
    plain = decoder is RUST and case.request.kind == "ping"
    return {case.request.node: True if plain else outcome.value}


def _class(
    decoder: Decoder, case: Case, node: int, mine: Mapping[int, Any], others: Mapping[int, Any], why: str
) -> str:
    if node not in mine:
        names: Iterator[str] = _taken(decoder, case, node, others[node], why)
    elif node not in others:
        names = _left(decoder, case, node, mine[node], others)
    else:  # they take the echo for the answer
        names = iter(["echo"] if case.stream.startswith(case.request.packet()) else [])
    return next(names, UNEXPLAINED)


# --- they take what we do not -------------------------------------------------------------------------------


def _taken(decoder: Decoder, case: Case, node: int, value: Any, why: str) -> Iterator[str]:
    request, stream = case.request, case.stream
    size = dict(request.due())[node] - protocol.OVERHEAD
    said = [one for one in packets(stream) if one.node == node]
    if request.packet() in stream:
        yield "echo"
    if any(len(one.data) == size and _is(case, one, value, decoder) for one in said) and _has_more(case):
        yield "more-than-the-answer"
    if any(len(one.data) != size and _begins(case, one, value, stream) for one in said):
        yield "other-length"


def _has_more(case: Case) -> bool:
    """Is there anything beside one answer, at most, of each servo that was asked?"""
    there = {(one.node, one.end - one.at) for one in packets(case.stream)}
    return len(case.stream) > sum(due[1] for due in case.request.due() if due in there)


def _is(case: Case, packet: Packet, value: Any, decoder: Decoder) -> bool:
    """Is this the value that the packet says?"""
    if value is True:
        return True
    kind = case.request.kind
    if kind == "sync_read":
        return bool(packet.data == value)
    return bool(value == ([packet.data, packet.error] if kind == "read" else packet.error))


def _begins(case: Case, packet: Packet, value: Any, stream: bytes) -> bool:
    """Is the value made of this packet, whatever its length: cut, or with its sum taken for data?"""
    if case.request.kind not in ("read", "sync_read"):
        return value is True or bool(value == packet.error)
    data = value[0] if case.request.kind == "read" else value
    behind = list(stream[packet.at + 5 : packet.end])
    return bool(data == behind[: len(data)])


# --- we take what they do not -------------------------------------------------------------------------------


def _left(decoder: Decoder, case: Case, node: int, value: Any, others: Mapping[int, Any]) -> Iterator[str]:
    stream = case.stream
    size = dict(case.request.due())[node] - protocol.OVERHEAD
    said = [
        one
        for one in packets(stream)
        if one.node == node and len(one.data) == size and _is(case, one, value, decoder)
    ]
    if not said:
        return
    if stream.startswith(case.request.packet()):
        yield "echo"
    if decoder is not RUST and said[0].error > SDK_MOST_ERROR:
        yield "error-above-0x7f"
    if case.request.kind == "sync_read":
        yield from _left_in_group(decoder, case, node, others, said[0])
    elif said[0].at and (decoder is RUST or protocol.HEADER in stream[: said[0].at + 1]):
        yield "something-in-front" if decoder is RUST else "false-beginning"


def _left_in_group(
    decoder: Decoder, case: Case, node: int, others: Mapping[int, Any], said: Packet
) -> Iterator[str]:
    """Of several servos: who loses one servo for what became of another."""
    due, nodes = sum(length for _, length in case.request.due()), case.request.nodes
    if decoder is RUST and not others:
        yield "all-or-none"
    earlier = nodes[: nodes.index(node)]
    if decoder is OLD and any(one not in others for one in earlier):
        yield "first-silent"
    if decoder is OLD and any(one.at > said.at for one in packets(case.stream) if one.node in earlier):
        yield "out-of-order"
    if decoder is NEW and said.end > due:
        yield "counted-bytes"
    if protocol.HEADER in case.stream[: said.at + 1]:
        yield "false-beginning"
