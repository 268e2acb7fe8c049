"""EDS files: two byte for byte, all by the rules of CiA 306. tests/interop reads them with python-canopen."""

from __future__ import annotations

from configparser import RawConfigParser
from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.families.kst.eds import eds
from motorbus.families.kst.profiles import PROFILES, Profile

HERE = Path(__file__).parent
LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")

every_sheet = pytest.mark.parametrize(
    ("profile", "with_mandatory"),
    [(profile, mandatory) for profile in PROFILES.values() for mandatory in (False, True)],
    ids=lambda value: value.name if isinstance(value, Profile) else "mandatory" if value else "plain",
)


def parse(text: str) -> RawConfigParser:
    """The sections. A section or key that occurs twice is an error."""
    parser = RawConfigParser()
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(text)
    return parser


def indices(parser: RawConfigParser, title: str) -> list[int]:
    """The indices in one of the lists, which are numbered from 1."""
    keys = dict(parser[title])
    count = int(keys.pop("SupportedObjects"))
    assert list(keys) == [str(number) for number in range(1, count + 1)]
    return [int(index, 16) for index in keys.values()]


@pytest.mark.parametrize(
    ("name", "with_mandatory", "file"),
    [("kst", False, "kst.eds"), ("xqpower", True, "xqpower_mandatory.eds")],
)
def test_sheet_is_this_file_byte_for_byte(name: str, with_mandatory: bool, file: str) -> None:
    text = eds(PROFILES[name], with_mandatory=with_mandatory)
    assert text.encode("ascii") == (HERE / file).read_bytes()


@every_sheet
def test_objects_are_in_their_list_with_their_keys(profile: Profile, with_mandatory: bool) -> None:
    text = eds(profile, with_mandatory=with_mandatory)
    assert text.isascii()
    assert ";" not in text
    assert max(map(len, text.splitlines())) <= 255
    parser = parse(text)
    mandatory, optional, vendor = (indices(parser, title) for title in LISTS)
    rows = {row.address for row in profile.table.values()}
    assert mandatory == ([0x1000, 0x1001, 0x1018] if with_mandatory else [])
    assert optional == sorted(index for index in rows if not 0x2000 <= index < 0x6000)
    assert vendor == sorted(index for index in rows if 0x2000 <= index < 0x6000)
    objects = [parser[title] for title in parser.sections()[4:] if title not in LISTS]
    assert set(profile.table) <= {keys["ParameterName"] for keys in objects}
    for keys in objects:
        if keys["ObjectType"] != "0x7":
            assert set(keys) == {"ParameterName", "ObjectType", "SubNumber"}
            assert keys["ObjectType"] == {"1010": "0x8", "1018": "0x9"}[keys.name]
            continue
        assert {"DataType", "AccessType", "PDOMapping"} <= set(keys)
        assert keys["AccessType"] in {"ro", "wo", "rw", "const"}
        numbers = [keys[name] for name in ("LowLimit", "HighLimit", "DefaultValue") if name in keys]
        assert numbers == [str(int(number, 10)) for number in numbers]
        assert ("LowLimit" in keys) == ("HighLimit" in keys)
        assert "LowLimit" not in keys or int(keys["LowLimit"]) < int(keys["HighLimit"])


def test_file_name_cannot_break_the_sheet() -> None:
    head = parse(eds(PROFILES["kst"], file_name="Zoë\n[6003]\nA=1 ; b"))["FileInfo"]
    assert head["FileName"] == "Zo? [6003] A=1 | b"


def test_node_id_is_the_default_of_its_object() -> None:
    assert parse(eds(PROFILES["kst"], node_id=9))["3000"]["DefaultValue"] == "9"
    assert parse(eds(PROFILES["kst"]))["3000"]["DefaultValue"] == "37"
    for node_id in (0, 128, -1):
        with pytest.raises(RequestError, match=r"node_id: raw value .* is out of range 1..127"):
            eds(PROFILES["kst"], node_id=node_id)
