"""python-canopen, unmodified, loads the EDS files we write and finds in them what our rows say.

It was written by people who know nothing of these servos, so what it understands any CANopen tool may understand.
"""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import pytest

from motorbus.core.register import Access, Coding, Register
from motorbus.families.kst.eds import eds
from motorbus.families.kst.profiles import PROFILES, RATES, Profile
from tests.interop.canopen_peer import LIBRARY, describe

TYPES = {(1, False): 0x05, (2, False): 0x06, (4, False): 0x07, (1, True): 0x02, (2, True): 0x03}
VISIBLE_STRING = 0x09
ACCESS = {Access.READ: "ro", Access.WRITE: "wo", Access.READ_WRITE: "rw"}
VERSIONS = {"firmware_version", "software_version"}
NOT_THERE = {"device_type": (0x1000, 0), "error_register": (0x1001, 0), "vendor_id": (0x1018, 1)}


@pytest.fixture(scope="module")
def understood(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """All that the library says: by profile, and by profile followed by a plus where all that is mandatory is in."""
    folder = tmp_path_factory.mktemp("eds")
    files = {}
    for name, profile in PROFILES.items():
        for mark in ("", "+"):
            files[name + mark] = folder / f"{name}{mark}.eds"
            files[name + mark].write_text(eds(profile, with_mandatory=bool(mark)), encoding="ascii")
    answer = describe(*files.values())
    answer["files"] = {name: answer["files"][str(path)] for name, path in files.items()}
    return answer


every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))


def expected(profile: Profile, row: Register) -> dict[str, Any]:
    """What an object has to be, but for its description; a factor is left to a nearer look."""
    letters = row.name in VERSIONS
    signed = row.coding is Coding.TWOS_COMPLEMENT
    whole = not signed and (row.low, row.high) == (0, 256**row.size - 1)
    low, high = (None, None) if letters or whole else (row.low, row.high)
    return {
        "index": row.address,
        "subindex": row.subindex,
        "type": VISIBLE_STRING if letters else TYPES[row.size, signed],
        "access": "const" if letters else ACCESS[row.access],
        "low": low,
        "high": high,
        "default": row.default,
        "unit": "deg" if row.unit == "rad" else row.unit,
        "mappable": False,
    }


def test_it_is_the_library_that_was_asked_for_and_it_is_alone(understood: dict[str, Any]) -> None:
    assert understood["version"] == "2.4.1"
    assert Path(understood["file"]).is_relative_to(LIBRARY)
    assert understood["motorbus"] is False


@every_profile
def test_it_finds_every_row_as_it_is(profile: Profile, understood: dict[str, Any]) -> None:
    objects = understood["files"][profile.name]["objects"]
    assert set(objects) == {*profile.table, "highest_sub_index"}
    for row in profile.table.values():
        told = objects[row.name]
        assert {key: told[key] for key in expected(profile, row)} == expected(profile, row), row.name
        assert row.source.replace(";", " |") in told["description"]


@every_profile
def test_it_finds_the_scale_of_every_row(profile: Profile, understood: dict[str, Any]) -> None:
    objects = understood["files"][profile.name]["objects"]
    for row in profile.table.values():
        factor = objects[row.name]["factor"]
        if row.unit == "rad":
            assert factor == 1 / profile.counts_per_degree
            assert factor * pi / 180 == pytest.approx(row.scale, rel=1e-15)
        else:
            assert factor == row.scale


@every_profile
def test_it_finds_the_maker_and_the_bit_rates(profile: Profile, understood: dict[str, Any]) -> None:
    told = understood["files"][profile.name]
    assert (told["vendor"], told["product"]) == (profile.vendor, profile.title)
    assert told["bit_rates"] == [rate for rate in RATES if rate != 100_000]
    assert told["lss"] is False
    assert any("100 kbit/s" in line for line in told["comments"])


@every_profile
def test_what_stores_is_an_array(profile: Profile, understood: dict[str, Any]) -> None:
    told = understood["files"][profile.name]
    assert told["kinds"].pop("4112") == "ODArray"  # 0x1010
    assert set(told["kinds"].values()) == {"ODVariable"}
    told["kinds"]["4112"] = "ODArray"
    count = told["objects"]["highest_sub_index"]
    assert (count["index"], count["subindex"], count["default"], count["access"]) == (0x1010, 0, 1, "const")


@every_profile
def test_what_is_mandatory_can_be_had_and_says_that_it_is_not_there(
    profile: Profile, understood: dict[str, Any]
) -> None:
    plain, full = (understood["files"][profile.name + mark] for mark in ("", "+"))
    added = {name: told for name, told in full["objects"].items() if name not in plain["objects"]}
    assert {name: (told["index"], told["subindex"]) for name, told in added.items()} == NOT_THERE
    for told in added.values():
        assert (told["access"], told["default"]) == ("ro", 0)
        assert told["description"].startswith("NOT IMPLEMENTED")
    assert full["kinds"]["4120"] == "ODRecord"  # 0x1018
    assert any("NOT IMPLEMENTED" in line for line in full["comments"])
