"""The responder answers as asked: after the turnaround, with what contenders expect, and only for who is there."""

from __future__ import annotations

import os
from select import select
from time import monotonic

import pytest

from bench import memory
from bench.responder import Responder, build, responder
from bench.workloads import IDS, block

TURNAROUND = 0.004
TRIES = 10


def asked(wire: Responder, request: bytes, due: int, patience: float = 10.0) -> bytes:
    """What comes back of so many bytes."""
    return b"".join(looks(wire, request, due, patience))


def looks(wire: Responder, request: bytes, due: int, patience: float = 10.0) -> list[bytes]:
    """The same by what each look has found."""
    port = os.open(wire.port, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(port, request)
        came: list[bytes] = []
        while sum(map(len, came)) < due and select((port,), (), (), patience)[0]:
            came.append(os.read(port, 4096))
        return came
    finally:
        os.close(port)


def test_it_shows_the_block_that_the_rule_says() -> None:
    request = memory.packet(254, memory.SYNC_READ, bytes((memory.POSITION, 15, *IDS)))
    expected = b"".join(memory.packet(node, 0, block(node, 0)) for node in IDS)
    with responder(build()) as wire:
        assert asked(wire, request, len(expected)) == expected
    assert wire.books["servos"]["6"] == [1, 0, 0]


def test_no_answer_begins_before_the_turnaround() -> None:
    request = memory.packet(1, memory.READ, bytes((memory.POSITION, 2)))
    with responder(build(), 1_000_000, TURNAROUND) as wire:
        began = monotonic()
        answer = asked(wire, request, 8)
        took = monotonic() - began
    assert answer == memory.packet(1, 0, block(1, 0)[:2])
    assert took >= TURNAROUND + (len(request) + len(answer)) * 10e-6


def test_only_every_so_manieth_servo_is_there() -> None:
    requests = b"".join(memory.packet(node, memory.PING) for node in (19, 20, 21, 40))
    with responder(build(), every=20) as wire:
        assert asked(wire, requests, 12) == memory.packet(20, 0) + memory.packet(40, 0)


def test_an_answer_is_handed_over_whole_or_packet_by_packet_as_it_has_passed() -> None:
    request = memory.packet(254, memory.SYNC_READ, bytes((memory.POSITION, 2, *IDS)))
    expected = [memory.packet(node, 0, block(node, 0)[:2]) for node in IDS]
    slow = 2000  # bit/s: 40 ms for each packet
    with responder(build(), slow) as wire:
        assert looks(wire, request, 8 * len(IDS)) == [b"".join(expected)]
    for _ in range(TRIES):
        with responder(build(), slow, pieces=True) as wire:
            came = looks(wire, request, 8 * len(IDS))
        assert b"".join(came) == b"".join(expected)
        assert all(len(one) % 8 == 0 for one in came)
        if len(came) > 1:
            return
    pytest.fail("it came whole each time, or this process never had a processor in the meantime")
