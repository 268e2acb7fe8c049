"""A picture of a servo has in each row just what a host reads at that moment."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.families.kst.profiles import PROFILES
from motorbus.families.kst.simulator import simulate


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_it_shows_what_is_read(profile: str) -> None:
    bus = simulate((0x25, 0x26), profile=profile)
    servo = bus.servos[0]
    servo.shaft.go(300, 0.0)
    for at in (0.0, 0.05, 1.0):
        bus.advance(at)
        (node, picture), (other, _) = bus.sight(at)
        assert (node, other) == (0x25, 0x26)
        assert {name: bus.shown(picture, name) for name in servo.profile.table} == dict(servo.memory)


def test_a_row_that_is_not_there_is_refused() -> None:
    bus = simulate((0x25,))
    ((_, picture),) = bus.sight(0.0)
    with pytest.raises(RequestError):
        bus.shown(picture, "present_velocity")
