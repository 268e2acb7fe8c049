"""Effects and protection of objects, profiles, and angles against exact arithmetic.

The rows themselves are on the reference page, which a check compares with the code.
"""

from __future__ import annotations

from fractions import Fraction
from math import inf, nan, pi, radians

import pytest

from motorbus.core.register import Storage
from motorbus.core.request import Effect
from motorbus.core.units import parse
from motorbus.errors import RequestError
from motorbus.families.kst.profiles import (
    DEFAULT_NODE,
    DEFAULT_RATE,
    PROFILES,
    RATES,
    REVERSED,
    SAVE,
    TABLES,
    Profile,
    bit_rate_code,
    current,
    temperature,
    to_raw,
    version_text,
)

EFFECTS = {
    "goal_position": Effect.MOTION,
    **dict.fromkeys(("node_id", "bit_rate_code"), Effect.IDENTITY),
    **dict.fromkeys(
        ("store", "mid_point", "negative_limit", "positive_limit", "function_enable"), Effect.PERSISTENT
    ),
}
PROTECTED = "firmware_version software_version store node_id bit_rate_code mid_point function_enable"

every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))


@every_profile
def test_rows_have_effect_protection_scale_and_source(profile: Profile) -> None:
    for row in profile.table.values():
        assert row.effect is EFFECTS.get(row.name, Effect.NONE), row.name
        assert row.protected == (row.name in PROTECTED.split()), row.name
        assert row.storage is not Storage.RAM or row.effect in {Effect.NONE, Effect.MOTION}, row.name
        if row.unit == "rad":
            assert row.scale == pi / 180 / profile.counts_per_degree
        assert len(row.source) > 20
        assert profile.name != "kst" or row.source.startswith("KST CAN protocol manual")
        assert not row.conflict or "Chosen: " in row.conflict


def test_bit_rates_and_values_with_names_are_those_of_the_manual() -> None:
    kilobits = [20, 50, 100, 125, 250, 500, 800, 1000]
    assert list(RATES) == [1000 * rate for rate in kilobits]
    assert [bit_rate_code(rate) for rate in RATES] == list(range(8))
    assert (RATES[5], DEFAULT_NODE) == (DEFAULT_RATE, 0x25) == (500_000, 37)
    for rate in (0, 10_000, 5, True):
        with pytest.raises(RequestError, match="no rate"):
            bit_rate_code(rate)
    for table in TABLES.values():
        assert table["bit_rate_code"].choices[6] == "800000 bit/s"
        assert table["store"].choices == {SAVE: "save"}
        assert table["store"].encode(SAVE) == b"save"
    assert TABLES["kst-ext"]["function_enable"].bits == {REVERSED: "reversed"} == {5: "reversed"}


def test_profiles_have_the_values_of_their_sources() -> None:
    found = {
        one.name: (one.counts_per_degree, one.limit, one.current_scale, one.nmt, one.mid_point_value)
        for one in PROFILES.values()
    }
    assert found == {
        "kst": (10, 900, 0.01, "none", 0),
        "kst-ext": (10, 1000, 0.01, "vendor", 0),
        "kingmax": (10, 1000, 0.01, "vendor", 0),
        "xqpower": (18, 800, 0.001, "standard", 1),
    }
    assert {name: one.table for name, one in PROFILES.items()} == TABLES


@pytest.mark.parametrize("name", ["kst-ext", "xqpower"])
def test_angle_is_rounded_as_in_exact_arithmetic(name: str) -> None:
    """All raw values of each scale, all halves and quarters between, in radians made in three ways."""
    profile = PROFILES[name]
    row = profile.table["goal_position"]
    for quarter in range(-4 * profile.limit - 1, 4 * profile.limit + 2):
        angle = float(Fraction(quarter, 4 * profile.counts_per_degree))
        nearest = int(abs(Fraction(quarter, 4)) + Fraction(1, 2)) * (1 if quarter > 0 else -1)
        raws = {
            to_raw(profile, radians(angle)),
            to_raw(profile, parse(f"{angle!r}deg", "position")),
            to_raw(profile, parse(f"{radians(angle)!r} rad", "position")),
        }
        assert raws == {nearest}, angle
        assert to_raw(profile, row.to_value(nearest)) == nearest


@every_profile
def test_angle_outside_the_range_is_refused(profile: Profile) -> None:
    half = float(Fraction(2 * profile.limit + 1, 2 * profile.counts_per_degree))
    for angle in (half, -half, 200.0, -200.0, 1e9, 1e200):
        with pytest.raises(RequestError, match=r"goal_position: .* is out of range") as raised:
            to_raw(profile, radians(angle))
        assert f"raw {-profile.limit} to {profile.limit}" in raised.value.expected
    for angle in (nan, inf, -inf, 1e308, -1e308):
        with pytest.raises(RequestError, match=r"goal_position: .* is (not a finite angle|out of range)"):
            to_raw(profile, angle)


VERSIONS = {
    b"V1.2": "V1.2",
    b"1.0\0": "1.0",
    b"KST servo 2.10\0": "KST servo 2.10",
    b"A\0\0B": "41 00 00 42",
    b"\0\0\0\0": "00 00 00 00",
    b"    ": "20 20 20 20",
    b"V1\n2": "56 31 0A 32",
    b"\xe912\0": "E9 31 32 00",
    b"": "",
}


def test_version_is_text_or_hexadecimal() -> None:
    assert {data: version_text(data) for data in VERSIONS} == VERSIONS


@pytest.mark.parametrize(
    ("data", "counts", "celsius"),
    [("00000000", 0, 0), ("39012800", 313, 40), ("ffff7fff", 65535, 127), ("01808055", 32769, -128)],
)
def test_status_holds_current_and_temperature(data: str, counts: int, celsius: int) -> None:
    for name, scale in (("kst-ext", 0.01), ("kingmax", 0.01), ("xqpower", 0.001)):
        raw = PROFILES[name].table["status"].decode(bytes.fromhex(data))
        assert current(PROFILES[name], raw) == pytest.approx(counts * scale, rel=1e-12)
        assert temperature(raw) == celsius
