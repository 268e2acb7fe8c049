"""What a family declares of its devices is true of its devices, as far as a simulated one can show it."""

from __future__ import annotations

import pytest

from motorbus.core.family import Family
from motorbus.core.guarantees import Guarantees, Level
from tests.support.subjects import FAMILIES
from tests.support.world import abilities, world

DECLARED = {name: family for name, family in FAMILIES.items() if family.safety is not None}


@pytest.fixture(params=DECLARED)
def declared(request: pytest.FixtureRequest) -> Family:
    """Each family that says what its devices give."""
    return DECLARED[request.param]


def assurance(family: Family) -> Guarantees:
    found = family.safety
    assert found is not None
    return found


def test_those_that_are_built_in_say_it() -> None:
    assert len(DECLARED) >= 3


def test_every_sentence_is_one_and_no_watchdog_is_claimed(declared: Family) -> None:
    for about, point in assurance(declared).points().items():
        assert point.text.strip(), about
        assert not point.text.endswith("."), about
    assert assurance(declared).watchdog.given is Level.NO


def test_what_is_claimed_of_its_devices_is_what_an_axis_can_do(declared: Family) -> None:
    said, able = assurance(declared), abilities(declared)
    assert (said.measured.given is Level.YES) == ("position" in able)
    assert (said.torque.given is Level.YES) == ("disable_torque" in able)
    assert (said.limits.given is not Level.NO) == ("limits" in able)
    assert (said.restart.given is not Level.NO) == ("health" in able)
    assert (said.strain.given is not Level.NO) == ("health" in able)
    assert said.led == ("stream" in able)


def test_each_emergency_stop_is_declared_and_promises_what_it_says(declared: Family) -> None:
    said = assurance(declared)
    policies = declared.link.stops or ("",)
    assert tuple(said.estops) == policies
    assert said.estops[policies[0]].text == declared.open().stop({1: None}).promise


def test_the_stop_promises_what_it_says(declared: Family) -> None:
    with world(declared) as there:
        device = there.device(there.ids[0])
        able = abilities(declared)
        if "enable_torque" in able:
            device.enable_torque()
        assert device.stop().value == assurance(declared).stop.text
