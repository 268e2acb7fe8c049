"""A device on a bus of another family is refused when it is made, before anything is sent."""

from __future__ import annotations

import asyncio

import pytest

from motorbus.core.family import Family
from motorbus.errors import RequestError
from tests.support.subjects import FAMILIES
from tests.support.world import sent, world


@pytest.mark.parametrize("other", list(FAMILIES))
def test_a_device_of_another_family_is_refused(family: Family, other: str) -> None:
    devices = FAMILIES[other].devices

    async def make(bus: object) -> None:
        devices.awaiting(bus, 1)

    with world(family) as there, sent(there.bus) as frames:
        if other == family.name:
            devices.blocking(there.bus, 1)
            asyncio.run(make(there.async_bus()))
            return
        for refused in (lambda: devices.blocking(there.bus, 1), lambda: asyncio.run(make(there.async_bus()))):
            with pytest.raises(
                RequestError, match=rf"bus of {family.name} devices, and this .* {other}(\n|$)"
            ) as caught:
                refused()
            assert "\n" not in caught.value.summary
            assert f"motorbus.{family.name}" in caught.value.advice
    assert frames == []
