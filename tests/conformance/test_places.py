"""What tells a position tells it to the gate as well: the same angle, without asking anybody anything more."""

from __future__ import annotations

from math import pi
from typing import Any

import pytest

from motorbus.core.family import Family
from motorbus.core.request import Request
from tests.support.world import IDS, World, abilities, world

NODE = IDS[0]


@pytest.mark.parametrize("one", ["position", "state", "stream"])
def test_the_bus_keeps_what_told_a_position_and_how_to_read_it(leader: Family, one: str) -> None:
    with world(leader) as found:
        told = _told(found, one)
        with found.bus.turn:
            request, answer = found.bus.positions[NODE]
        assert callable(request.reports_position)
        place = request.reports_position(answer)[NODE]
        assert place == pytest.approx(told)
        assert abs(place) < 4 * pi


def _told(found: World, one: str) -> float:
    device: Any = found.device(NODE)
    able = abilities(found.family)
    if one != "stream":
        told = found.bus.run(getattr(able, one)(device))
        return float(told.position if one == "state" else told)
    train = found.bus.run(able.stream([device], rate=found.bus.rate))
    (reading,) = train.positions
    assert isinstance(reading, Request)
    return float(found.bus.run(reading).values[NODE])
