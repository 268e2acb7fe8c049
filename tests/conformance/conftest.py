"""Runs each test once for every family, and each test of vectors once for every vector."""

from __future__ import annotations

import pytest

from tests.conformance.subjects import FAMILIES, Vector, vectors
from tests.conformance.world import locks


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "vector" in metafunc.fixturenames:
        metafunc.parametrize(("family", "vector"), _vectors())
    elif "lockable" in metafunc.fixturenames:
        lockable = {name: family for name, family in FAMILIES.items() if locks(family)}
        metafunc.parametrize("lockable", lockable.values(), ids=lockable)
    elif "family" in metafunc.fixturenames:
        metafunc.parametrize("family", FAMILIES.values(), ids=FAMILIES)


def _vectors() -> list[object]:
    return [
        pytest.param(family, vector, id=f"{name}-{vector.id}")
        for name, family in FAMILIES.items()
        for vector in _distinct(vectors(name))
    ]


def _distinct(found: list[Vector]) -> list[Vector]:
    return list({(vector.id, vector.direction): vector for vector in found}.values())
