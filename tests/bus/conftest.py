"""The engine tests run on the present engine and on the one that replaces it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.bus import adapter


@pytest.fixture(params=[adapter.OldEngine, adapter.NewEngine], ids=["old", "new"])
def implementation(request: pytest.FixtureRequest) -> Iterator[None]:
    """Set the engine that `adapter.Engine` makes."""
    adapter.Engine.implementation = request.param
    yield
    del adapter.Engine.implementation
