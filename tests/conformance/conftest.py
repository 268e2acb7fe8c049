"""Runs each test once for every family or subject it suits, and each test of vectors once for every vector.

Of subjects there are also `shared`, on whose line are several devices, and `writer`, whose devices are written by name.

A test asks by name: `family`, where no device matters; `subject`, a family with simulated devices of one kind, of which
it may have several. And some subjects: `lockable`, whose EEPROM has a lock; `mover`, whose devices move; `limp`, whose
devices can be let go; `leader`, whose devices can be led in a loop, and `keeping_leader`, which also has settings that
are kept; `reporter`, whose devices say something unasked; `plain_one`, with rows that just keep a value. Or a family
together with one of its vectors: `VECTORS`.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.core.family import Family
from tests.support.subjects import FAMILIES, SUBJECTS, Line, Vector, line_of, tables_of, vectors
from tests.support.world import has_torque_switch, kept, leads, locks, moves, plain, reports


def _is_reply(vector: Vector) -> bool:
    return vector.valid and vector.direction == "status"


def _is_request(vector: Vector) -> bool:
    return vector.direction == "instruction"


VECTORS: dict[str, Callable[[Vector, Line], bool]] = {
    "vector": lambda vector, line: True,
    "reply": lambda vector, line: _is_reply(vector),
    "checked_reply": lambda vector, line: _is_reply(vector) and line.checksum,
    "request_": lambda vector, line: _is_request(vector),
    "bad": lambda vector, line: not vector.valid and (line.checksum or vector.direction == "status"),
}
"""Which vectors a test gets that asks by this name.

Without a checksum in replies a bad request may begin like a good reply, and no receiver can know better.
"""
SUITS: dict[str, Callable[[Family], object]] = {
    "lockable": locks,
    "mover": moves,
    "reporter": reports,
    "leader": leads,
    "keeping_leader": lambda subject: leads(subject) and any(kept(table) for table in tables_of(subject)),
    "limp": has_torque_switch,
    "plain_one": lambda subject: any(plain(table) for table in tables_of(subject)),
    "shared": lambda subject: line_of(subject).devices != 1,
    "writer": lambda subject: line_of(subject).writes,
    "subject": bool,
}
"""Which subjects a test gets that asks by this name."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    for name, wanted in VECTORS.items():
        if name in metafunc.fixturenames:
            metafunc.parametrize(("family", name), _vectors(wanted))
            return
    if "family" in metafunc.fixturenames:
        metafunc.parametrize("family", FAMILIES.values(), ids=FAMILIES)
    for name, suits in SUITS.items():
        if name in metafunc.fixturenames:
            suitable = {key: subject for key, subject in SUBJECTS.items() if suits(subject)}
            metafunc.parametrize(name, suitable.values(), ids=suitable)


def _vectors(wanted: Callable[[Vector, Line], bool]) -> list[object]:
    return [
        pytest.param(family, vector, id=f"{name}-{vector.id}")
        for name, family in FAMILIES.items()
        for vector in vectors(name)
        if wanted(vector, line_of(family))
    ]
