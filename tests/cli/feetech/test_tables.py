"""All that is known of the registers and models is printed, for eyes and for programs, with its source."""

from __future__ import annotations

import pytest

from motorbus.families.feetech.table import MODELS, TABLES
from tests.cli.conftest import Run
from tests.protocol.feetech.typed_rows import IN_DOUBT


def test_one_map_is_shown_with_the_source_of_each_row(run: Run) -> None:
    ran = run("feetech", "registers", "--map", "hls")
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[0] == "hls: HLS servos, firmware 3.40 to 3.59, little-endian"
    rows, remarks = lines[2 : len(TABLES["hls"]) + 2], lines[len(TABLES["hls"]) + 2 :]
    (torque,) = [line for line in rows if " goal_torque " in line]
    for word in ("44", "2", "RAM", "rw", "bit 15", "-2047 to 2047", "0.0065 A", "motion", "HLS memory table"):
        assert word in torque
    assert [line.split()[1] for line in rows] == list(TABLES["hls"])
    (mode,) = [line for line in remarks if line.startswith("33 operating_mode: ")]
    assert "2 constant current" in mode
    assert "other numbers than on STS" in mode


def test_all_maps_are_shown_when_none_is_named(run: Run) -> None:
    out = run("feetech", "registers").out
    titles = [f"{table.name}: {table.title}" for table in TABLES.values()]
    assert [line for line in out.splitlines() if line in titles] == titles
    assert "never copied from another servo" in out


def test_the_database_holds_every_field_of_every_row(run: Run) -> None:
    document = run("feetech", "registers", "--json").document
    assert document["schema"] == "motorbus.feetech.registers/1"
    assert [told["name"] for told in document["maps"]] == list(TABLES)
    for told in document["maps"]:
        table = TABLES[told["name"]]
        assert told["title"] == table.title
        assert [row["name"] for row in told["registers"]] == list(table)
        for row in told["registers"]:
            entry = table[row["name"]]
            assert told["byte_order"] == entry.order
            assert (row["address"], row["size"], row["sign_bit"]) == (
                entry.address,
                entry.size,
                entry.sign_bit,
            )
            assert (row["low"], row["high"], row["default"]) == (entry.low, entry.high, entry.default)
            assert (row["unit"], row["scale"], row["source"]) == (entry.unit, entry.scale, entry.source)
            assert (row["note"], row["protected"]) == (entry.note, entry.protected)
            assert row["conflict"] == entry.conflict
            assert {int(value): word for value, word in row["choices"].items()} == entry.choices
            assert {int(bit): word for bit, word in row["bits"].items()} == entry.bits
            assert row["access"] == entry.access.value
            assert row["storage"] == entry.storage.value
            assert row["coding"] == entry.coding.value
            assert row["effect"] == entry.effect.name.lower()


def test_what_is_in_doubt_is_marked_in_the_table_and_told_below(run: Run) -> None:
    lines = run("feetech", "registers", "--map", "sts").out.splitlines()
    marked = {int(line.split()[0]) for line in lines if line.endswith("in doubt")}
    assert marked == set(IN_DOUBT["sts"])
    told = {int(line.split()[0]) for line in lines if ", in doubt: " in line}
    assert told == marked
    assert "28 protection_current, in doubt: FD: 0 to 1023; V3.6: 0 to 511. Chosen: 0 to 1023" in lines


def test_one_map_for_programs_is_that_map_alone(run: Run) -> None:
    document = run("feetech", "registers", "--map", "SCS2", "--json").document
    assert [told["name"] for told in document["maps"]] == ["scs2"]


@pytest.mark.parametrize("name", ["stz", "common", "777"])
def test_a_map_there_is_not_ends_with_2(name: str, run: Run) -> None:
    ran = run("feetech", "registers", "--map", name)
    assert (ran.code, ran.out) == (2, "")
    assert "one of sts, smbl, smcl, scs, scs2, hls" in ran.err


def test_models_are_listed_with_what_their_number_says(run: Run) -> None:
    ran = run("feetech", "models")
    assert (ran.code, ran.err) == (0, "")
    assert len(ran.out.splitlines()) == len(MODELS) + 1
    (sts,) = [line.split() for line in ran.out.splitlines() if "STS3215" in line]
    assert sts == ["777", "9.3", "STS3215", "sts", "little", "4096", "360°"]
    (scs,) = [line.split() for line in ran.out.splitlines() if "SCS0009" in line]
    assert scs[:7] == ["1284", "5.4", "SCS0009", "scs", "big", "1024", "300°"]


def test_models_for_programs(run: Run) -> None:
    document = run("feetech", "models", "--json").document
    assert document["schema"] == "motorbus.feetech.models/1"
    assert {(one["major"], one["minor"]): one["name"] for one in document["models"]} == {
        number: model.name for number, model in MODELS.items()
    }
    (hls,) = [one for one in document["models"] if one["number"] == 4618]
    assert hls == {
        "number": 4618,
        "major": 10,
        "minor": 18,
        "name": "HLS3950",
        "maps": ["hls"],
        "byte_order": "little",
        "resolution": 4096,
        "arc": 360.0,
        "note": "feetech-cli met this number on an HLS3960M",
    }
