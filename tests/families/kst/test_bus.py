"""The family as a bus sees it: settings, capabilities, addresses, arguments that are refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.family import Identity
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.kst import FAMILY, KstDriver, Servo
from motorbus.families.kst.profiles import PROFILES, RATES
from tests.families.kst.bench import Bench


def test_family_has_its_settings_and_refuses_others() -> None:
    assert (FAMILY.link.kind, FAMILY.link.rate, FAMILY.link.rates) == ("frames", 500_000, RATES)
    names = [option.name for option in FAMILY.link.settings]
    assert names == ["profile", "id_format", "sized", "nmt"]
    for name in names:
        with pytest.raises(RequestError, match=f"{name}=x"):
            FAMILY.open(**{name: "x"})
    with pytest.raises(RequestError, match="no setting 'profil'"):
        FAMILY.open(profil="kst")


def test_each_bus_has_settings_and_state_of_its_own() -> None:
    one, other = KstDriver(FAMILY, profile="xqpower"), KstDriver(FAMILY, profile="xqpower")
    assert one.settings.profile.name == "xqpower"
    assert one.settings.state is not other.settings.state
    assert FAMILY.simulator((4,), profile="kingmax").nodes[4].status()["profile"] == "kingmax"
    with pytest.raises(RequestError, match="sts3215"):
        FAMILY.simulator((1,), "sts3215")
    with pytest.raises(RequestError, match="contradict"):
        FAMILY.simulator((1,), "kst", profile="xqpower")


@pytest.mark.parametrize("profile", PROFILES)
def test_capabilities_belong_to_the_profile(profile: str) -> None:
    with Bench(profile=profile) as bench:
        axis = FAMILY.open().axis(bench.servo().identify())
    assert axis.names == FAMILY.open().axis(Identity(1, "", "", profile)).names
    assert {"state", "position", "move", "stop", "limits", "stream"} <= axis.names
    assert {"enable_torque", "cap_torque"}.isdisjoint(axis.names)
    assert not FAMILY.open().axis(Identity(1, "", "", "")).names
    assert not any(hasattr(Servo, name) for name in ("enable_torque", "disable_torque"))


IMPOSSIBLE: dict[str, Callable[[Any], object]] = {
    "id 0": lambda servo: servo.set_node_id(0),
    "a rate": lambda servo: servo.set_bit_rate(123_456),
    "200°": lambda servo: servo.move(math.radians(200)),
    "NaN": lambda servo: servo.move(math.nan),
    "a word": lambda servo: servo.move("90deg"),
    "no tolerance": lambda servo: servo.move(0.1, tolerance=0),
    "no time": lambda servo: servo.move(0.1, timeout=math.nan),
    "goal by name": lambda servo: servo.write(goal_position=2.0),
    "nothing to provision": lambda servo: servo.provision(),
    "provision to 0": lambda servo: servo.provision(new_id=0),
    "no time to wait": lambda servo: servo.provision(new_id=9, timeout=0),
    "endless timeout": lambda servo: servo.provision(new_id=9, timeout=math.inf),
    "a timeout with a unit": lambda servo: servo.provision(new_id=9, timeout="120s"),
    "current": lambda servo: servo.current(),
    "mid point": lambda servo: servo.set_mid_point(),
}


@pytest.mark.parametrize("call", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_impossible_call_is_refused_and_sends_nothing(call: Callable[[Servo], object]) -> None:
    """A second line of the error has the reason or the remedy."""
    with Bench() as bench:
        with pytest.raises((RequestError, LimitExceeded)) as raised:
            call(bench.servo())
        assert bench.sent() == []
        assert len(str(raised.value).splitlines()) > 1


def test_missing_feature_names_profiles_that_have_it() -> None:
    with Bench() as bench, pytest.raises(RequestError, match="kst-ext or kingmax") as raised:
        bench.servo().reversed()
    assert "profile" in raised.value.summary
