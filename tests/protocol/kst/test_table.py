"""The object dictionaries row by row, what sets the profiles apart, and every angle against exact arithmetic."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from math import degrees, inf, nan, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.register import Access, Coding, Register, Storage
from motorbus.core.request import Effect
from motorbus.core.units import parse
from motorbus.errors import RequestError
from motorbus.families.kst.profiles import (
    BIT_RATES,
    DEFAULT_NODE,
    DEFAULT_RATE,
    PROFILES,
    RATES,
    REVERSED,
    SAVE,
    TABLES,
    Profile,
    current,
    temperature,
    to_raw,
    version_text,
)

R, W, RW = Access.READ, Access.WRITE, Access.READ_WRITE
WORD = 0xFFFFFFFF

# name: index, sub-index, bytes, signed, access, lowest, highest, shipped
MANUAL: dict[str, tuple[int, int, int, bool, Access, int, int, int | None]] = {
    "firmware_version": (0x100A, 0, 4, False, R, 0, WORD, None),
    "store": (0x1010, 1, 4, False, W, 0, WORD, None),
    "node_id": (0x3000, 0, 1, False, RW, 1, 127, 0x25),
    "bit_rate_code": (0x3001, 0, 1, False, W, 0, 7, 5),
    "present_position": (0x6002, 0, 2, True, R, -900, 900, None),
    "goal_position": (0x6003, 0, 2, True, RW, -900, 900, None),
}
EXTENDED = {
    **MANUAL,
    "present_position": (0x6002, 0, 2, True, R, -1000, 1000, None),
    "goal_position": (0x6003, 0, 2, True, RW, -1000, 1000, None),
    "software_version": (0x100B, 0, 4, False, R, 0, WORD, None),
    "report_interval": (0x2200, 0, 1, False, W, 1, 255, None),
    "mid_point": (0x3009, 0, 4, False, W, 0, 1, None),
    "negative_limit": (0x300A, 0, 2, True, RW, -1000, 0, None),
    "positive_limit": (0x300B, 0, 2, True, RW, 0, 1000, None),
    "function_enable": (0x300F, 0, 1, False, RW, 0, 255, None),
    "status": (0x6005, 0, 4, False, R, 0, WORD, None),
}
XQPOWER = {
    **MANUAL,
    "present_position": (0x6002, 0, 2, True, R, -800, 800, None),
    "goal_position": (0x6003, 0, 2, True, RW, -800, 800, None),
    "report_interval": (0x2200, 0, 1, False, W, 10, 255, None),
    "mid_point": EXTENDED["mid_point"],
    "status": EXTENDED["status"],
}
OBJECTS = {"kst": MANUAL, "kst-ext": EXTENDED, "kingmax": EXTENDED, "xqpower": XQPOWER}
EFFECTS = {
    Effect.MOTION: "goal_position",
    Effect.IDENTITY: "node_id bit_rate_code",
    Effect.PERSISTENT: "store mid_point negative_limit positive_limit function_enable",
}
PROTECTED = "firmware_version software_version store node_id bit_rate_code mid_point function_enable"
MANUALS_POSITIONS = {
    "-90": b"\x7c\xfc",
    "-10.9": b"\x93\xff",
    "-0.8": b"\xf8\xff",
    "0": b"\x00\x00",
    "0.8": b"\x08\x00",
    "10.9": b"\x6d\x00",
    "90": b"\x84\x03",
}

every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))
with_status = pytest.mark.parametrize("name", ["kst-ext", "kingmax", "xqpower"])


def rows() -> Iterator[Register]:
    for table in TABLES.values():
        yield from table.values()


# --- the rows -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OBJECTS)
def test_a_table_has_these_rows_and_no_others(name: str) -> None:
    told = {
        row.name: (
            row.address,
            row.subindex,
            row.size,
            row.coding is Coding.TWOS_COMPLEMENT,
            row.access,
            row.low,
            row.high,
            row.default,
        )
        for row in TABLES[name].values()
    }
    assert told == OBJECTS[name]


def test_the_manual_comes_first_and_has_nothing_of_the_others() -> None:
    assert list(PROFILES) == list(TABLES) == list(OBJECTS)
    assert all(row.source.startswith("KST CAN protocol manual") for row in TABLES["kst"].values())
    assert "driver" not in "".join(row.source for row in TABLES["kst"].values())


def test_rows_stand_in_the_order_of_their_addresses() -> None:
    for table in TABLES.values():
        places = [(row.address, row.subindex or 0) for row in table.values()]
        assert places == sorted(places)


def test_effects_and_protection_are_those_of_the_worst_a_write_can_do() -> None:
    effects = {name: effect for effect, names in EFFECTS.items() for name in names.split()}
    for row in rows():
        assert row.effect is effects.get(row.name, Effect.NONE), row.name
        assert row.protected == (row.name in PROTECTED.split()), row.name
        assert row.storage is not Storage.RAM or row.effect in {Effect.NONE, Effect.MOTION}, row.name


def test_what_is_an_angle_is_in_radians_by_the_scale_of_its_maker() -> None:
    for profile in PROFILES.values():
        angles = [row for row in profile.table.values() if row.unit == "rad"]
        assert {row.coding for row in angles} == {Coding.TWOS_COMPLEMENT}
        assert [row.scale for row in angles] == [pi / 180 / profile.counts_per_degree] * len(angles)


def test_every_row_says_where_it_is_from_in_plain_words() -> None:
    for row in rows():
        assert len(row.source) > 20
        assert not any(f"[{letter}]" in row.source + row.note + row.conflict for letter in "SFDGKXRCMP")


def test_where_sources_disagree_the_row_says_so() -> None:
    disputed = {
        "kst": {"firmware_version", "store", "present_position"},
        "kst-ext": {"firmware_version", "store", "present_position", "software_version", "status"},
        "kingmax": {"firmware_version", "store", "present_position", "software_version", "status"},
        "xqpower": {"firmware_version", "store", "present_position", "mid_point"},
    }
    found = {name: {row.name for row in one.table.values() if row.conflict} for name, one in PROFILES.items()}
    assert found == disputed
    assert all("Chosen: " in row.conflict for row in rows() if row.conflict)


def test_the_bit_rates_are_those_of_the_manual() -> None:
    kilobits = [20, 50, 100, 125, 250, 500, 800, 1000]
    assert dict(BIT_RATES) == {code: rate * 1000 for code, rate in enumerate(kilobits)}
    assert tuple(BIT_RATES.values()) == RATES
    assert BIT_RATES[5] == DEFAULT_RATE == 500_000
    assert TABLES["kst"]["bit_rate_code"].choices[6] == "800000 bit/s"


def test_what_saves_spells_save() -> None:
    for table in TABLES.values():
        assert table["store"].encode(SAVE) == b"save"
        assert table["store"].choices == {SAVE: "save"}
    assert TABLES["kst-ext"]["function_enable"].bits == {REVERSED: "reversed"} == {5: "reversed"}


# --- the profiles -------------------------------------------------------------------------------------------


def test_what_sets_the_profiles_apart() -> None:
    told = {
        p.name: (p.counts_per_degree, p.limit, p.current_scale, p.nmt, p.report_forms)
        for p in PROFILES.values()
    }
    assert told == {
        "kst": (10, 900, 0.01, "none", ()),
        "kst-ext": (10, 1000, 0.01, "vendor", ("sdo",)),
        "kingmax": (10, 1000, 0.01, "vendor", ("sdo",)),
        "xqpower": (18, 800, 0.001, "standard", ("sdo", "pdo")),
    }
    mid_points = [(profile.mid_point_value, profile.mid_point_wait) for profile in PROFILES.values()]
    assert mid_points == [(0, 0.15), (0, 0.15), (0, 0.15), (1, 0.5)]
    assert {profile.flash_wait for profile in PROFILES.values()} == {0.15}
    assert [profile.vendor for profile in PROFILES.values()] == ["KST", "KST", "Kingmax", "XQPOWER"]


@every_profile
def test_a_profile_points_at_rows_of_its_own_table(profile: Profile) -> None:
    table = profile.table
    assert TABLES[profile.name] is table
    assert (profile.name, profile.title) == (table.name, table.title)
    assert profile.status_row is table.at(0x6005, 0)
    names = [name for name in ("firmware_version", "software_version") if name in table]
    assert [row.name for row in profile.version_rows] == names
    assert all(row is table[row.name] for row in profile.version_rows)
    for name in ("present_position", "goal_position"):
        assert (table[name].low, table[name].high) == (-profile.limit, profile.limit)
    assert table["node_id"].default == DEFAULT_NODE == 0x25


@every_profile
def test_a_profile_says_where_it_is_from_and_what_is_disputed(profile: Profile) -> None:
    assert len(profile.source) > 20
    assert len(profile.conflicts) > 20


# --- angles -------------------------------------------------------------------------------------------------


def nearest(counts: Fraction) -> int:
    """Half a count goes away from zero."""
    away = int(abs(counts) + Fraction(1, 2))
    return away if counts > 0 else -away


def test_the_positions_of_the_manual() -> None:
    profile = PROFILES["kst"]
    row = profile.table["goal_position"]
    for angle, data in MANUALS_POSITIONS.items():
        raw = to_raw(profile, parse(f"{angle}deg", "position"))
        assert row.encode(raw) == data
        assert row.decode(data) == raw


@every_profile
def test_every_count_and_everything_between_comes_out_as_in_exact_arithmetic(profile: Profile) -> None:
    """All raw values and all halves and quarters between, in radians made in three ways."""
    parts = 4 * profile.counts_per_degree
    for quarter in range(-4 * profile.limit - 1, 4 * profile.limit + 2):
        angle = float(Fraction(quarter, parts))
        expected = nearest(Fraction(quarter, 4))
        ways = {
            to_raw(profile, radians(angle)),
            to_raw(profile, parse(f"{angle!r}deg", "position")),
            to_raw(profile, parse(f"{radians(angle)!r} rad", "position")),
        }
        assert ways == {expected}, angle


@every_profile
def test_half_a_count_beyond_the_end_is_refused(profile: Profile) -> None:
    for half in (2 * profile.limit + 1, 2 * profile.limit + 2, 100 * profile.limit):
        for sign in (1, -1):
            with pytest.raises(RequestError, match=r"goal_position: .* is out of range"):
                to_raw(profile, radians(float(Fraction(sign * half, 2 * profile.counts_per_degree))))


@every_profile
def test_a_raw_value_in_radians_is_itself_again(profile: Profile) -> None:
    row = profile.table["goal_position"]
    for raw in range(row.low, row.high + 1):
        assert to_raw(profile, row.to_value(raw)) == raw


@pytest.mark.parametrize(
    ("angle", "raw"),
    [
        ("10.85", 109),
        ("-10.85", -109),
        ("0.05", 1),
        ("-0.05", -1),
        ("0.0499", 0),
        ("-0", 0),
        ("89.95", 900),
        ("90.0499", 900),
    ],
)
def test_decimal_halves(angle: str, raw: int) -> None:
    assert to_raw(PROFILES["kst"], parse(f"{angle}deg", "position")) == raw


def test_the_same_angle_is_another_count_for_another_maker() -> None:
    assert {p.name: to_raw(p, radians(40)) for p in PROFILES.values()} == {
        "kst": 400,
        "kst-ext": 400,
        "kingmax": 400,
        "xqpower": 720,
    }


@pytest.mark.parametrize("angle", [nan, inf, -inf, 1e308, -1e308])
@every_profile
def test_what_is_no_finite_angle_is_refused(profile: Profile, angle: float) -> None:
    with pytest.raises(RequestError, match="goal_position: .* is (not a finite angle|out of range)"):
        to_raw(profile, angle)


@pytest.mark.parametrize("angle", [200.0, -200.0, 1e9, 1e200])
@every_profile
def test_what_is_far_out_is_refused_in_degrees(profile: Profile, angle: float) -> None:
    with pytest.raises(RequestError, match="out of range") as caught:
        to_raw(profile, radians(angle))
    assert f"raw {-profile.limit} to {profile.limit}" in caught.value.expected


def test_a_travel_limit_has_bounds_of_its_own() -> None:
    profile = PROFILES["kst-ext"]
    assert to_raw(profile, radians(-45.25), "negative_limit") == -453
    assert to_raw(profile, radians(45.25), "positive_limit") == 453
    with pytest.raises(RequestError, match="negative_limit: 1° is out of range -100° to 0°"):
        to_raw(profile, radians(1), "negative_limit")


@given(st.floats(-pi / 2, pi / 2))
def test_it_is_the_same_to_either_side_and_never_far_off(angle: float) -> None:
    profile = PROFILES["kst"]
    raw = to_raw(profile, angle)
    assert to_raw(profile, -angle) == -raw
    assert abs(raw - 10 * degrees(angle)) <= 0.5 + 1e-6


# --- words --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"V1.2", "V1.2"),
        (b"1.0\0", "1.0"),
        (b"2 \0\0", "2"),
        (b" 3.1", "3.1"),
        (b"A\0\0B", "41 00 00 42"),
        (b"\0\0\0\0", "00 00 00 00"),
        (b"    ", "20 20 20 20"),
        (b"\x01\x02\xff\xfe", "01 02 FF FE"),
        (b"V1\n2", "56 31 0A 32"),
        ("é12".encode("latin-1") + b"\0", "E9 31 32 00"),
    ],
)
def test_a_version_is_text_where_it_is_text(data: bytes, said: str) -> None:
    assert version_text(data) == said


def test_a_version_in_segments_may_be_long() -> None:
    assert version_text(b"KST servo 2.10\0") == "KST servo 2.10"
    assert version_text(b"") == ""


# --- status -------------------------------------------------------------------------------------------------


@with_status
@pytest.mark.parametrize(
    ("data", "counts", "celsius"),
    [
        (b"\x00\x00\x00\x00", 0, 0),
        (b"\x39\x01\x28\x00", 313, 40),
        (b"\xff\xff\x7f\xff", 65535, 127),
        (b"\x01\x80\x80\x00", 32769, -128),
        (b"\x00\x00\xff\x55", 0, -1),
    ],
)
def test_a_status_is_a_current_and_a_temperature(name: str, data: bytes, counts: int, celsius: int) -> None:
    profile = PROFILES[name]
    raw = profile.table["status"].decode(data)
    assert current(profile, raw) == pytest.approx(counts * {"xqpower": 0.001}.get(name, 0.01), rel=1e-12)
    assert temperature(raw) == celsius
