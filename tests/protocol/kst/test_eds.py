"""The EDS files we write: byte for byte where a file is kept beside this test, by the rules of CiA 306 for the rest.

That other people's software reads them is tested with it, in tests/interop.
"""

from __future__ import annotations

from configparser import RawConfigParser
from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.families.kst.eds import eds
from motorbus.families.kst.profiles import PROFILES, Profile

HERE = Path(__file__).resolve().parent
LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
HEAD = ["FileInfo", "DeviceInfo", "DummyUsage", "Comments"]
LONGEST_LINE = 255

every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))
with_and_without = pytest.mark.parametrize("with_mandatory", [False, True], ids=["plain", "mandatory"])


def parsed(text: str) -> RawConfigParser:
    """Strict: a section or a key that comes twice is an error."""
    parser = RawConfigParser()
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(text)
    return parser


def listed(parser: RawConfigParser, title: str) -> list[int]:
    """The indices in one of the lists, which must be numbered from 1 without a gap."""
    keys = dict(parser[title])
    count = int(keys.pop("SupportedObjects"))
    assert list(keys) == [str(number) for number in range(1, count + 1)]
    return [int(index, 16) for index in keys.values()]


@pytest.mark.parametrize(
    ("name", "with_mandatory", "file"),
    [("kst", False, "kst.eds"), ("xqpower", True, "xqpower_mandatory.eds")],
)
def test_it_is_this_file_byte_for_byte(name: str, with_mandatory: bool, file: str) -> None:
    text = eds(PROFILES[name], with_mandatory=with_mandatory)
    assert text.encode("ascii") == (HERE / file).read_bytes()


@with_and_without
@every_profile
def test_the_sections_come_in_order_and_each_list_before_its_objects(
    profile: Profile, with_mandatory: bool
) -> None:
    parser = parsed(eds(profile, with_mandatory=with_mandatory))
    sections = parser.sections()
    assert sections[:4] == HEAD
    assert [title for title in sections if title in LISTS] == list(LISTS)
    place: list[str] = []
    for title in LISTS:
        place.append(title)
        for index in listed(parser, title):
            place.append(f"{index:04X}")
            subs = int(parser[f"{index:04X}"].get("SubNumber", "0"))
            place += [f"{index:04X}sub{subindex}" for subindex in range(subs)]
    assert sections[4:] == place


@with_and_without
@every_profile
def test_every_object_is_in_the_list_of_its_range(profile: Profile, with_mandatory: bool) -> None:
    parser = parsed(eds(profile, with_mandatory=with_mandatory))
    mandatory, optional, makers = (listed(parser, title) for title in LISTS)
    indices = {row.address for row in profile.table.values()}
    assert mandatory == ([0x1000, 0x1001, 0x1018] if with_mandatory else [])
    assert optional == sorted(index for index in indices if not 0x2000 <= index <= 0x5FFF)
    assert makers == sorted(index for index in indices if 0x2000 <= index <= 0x5FFF)


@with_and_without
@every_profile
def test_every_object_has_the_keys_it_must_have(profile: Profile, with_mandatory: bool) -> None:
    parser = parsed(eds(profile, with_mandatory=with_mandatory))
    names = []
    for title in parser.sections()[4:]:
        keys = parser[title]
        if title in LISTS:
            continue
        names.append(keys["ParameterName"])
        if keys["ObjectType"] == "0x7":
            assert {"DataType", "AccessType", "PDOMapping"} <= set(keys)
            assert keys["AccessType"] in {"ro", "wo", "rw", "const"}
        else:
            assert set(keys) == {"ParameterName", "ObjectType", "SubNumber"}
            assert keys["ObjectType"] == {"1010": "0x8", "1018": "0x9"}[title]
    assert set(profile.table) <= set(names)


@with_and_without
@every_profile
def test_limits_and_defaults_are_decimal_and_in_order(profile: Profile, with_mandatory: bool) -> None:
    parser = parsed(eds(profile, with_mandatory=with_mandatory))
    for title in parser.sections()[4:]:
        keys = parser[title]
        for name in ("LowLimit", "HighLimit", "DefaultValue"):
            if name in keys:
                assert keys[name] == str(int(keys[name], 10))
        assert ("LowLimit" in keys) == ("HighLimit" in keys)
        if "LowLimit" in keys:
            assert int(keys["LowLimit"]) < int(keys["HighLimit"])


@with_and_without
@every_profile
def test_it_is_ascii_in_lines_of_bearable_length(profile: Profile, with_mandatory: bool) -> None:
    text = eds(profile, with_mandatory=with_mandatory)
    assert text.isascii()
    assert text.endswith("\n")
    assert ";" not in text
    assert max(map(len, text.splitlines())) <= LONGEST_LINE


@every_profile
def test_the_comments_are_counted_and_say_what_cannot_be_declared(profile: Profile) -> None:
    comments = dict(parsed(eds(profile))["Comments"])
    assert int(comments.pop("Lines")) == len(comments)
    assert list(comments) == [f"Line{number}" for number in range(1, len(comments) + 1)]
    said = " ".join(comments.values())
    assert "Also at 100 kbit/s, for which CiA 306 has no BaudRate key." in said
    assert all(f"{row.name}: " in said for row in profile.table.values() if row.note or row.conflict)
    assert said.count("Chosen: ") == sum("Chosen: " in row.conflict for row in profile.table.values())


def test_the_rates_are_declared() -> None:
    device = parsed(eds(PROFILES["kst"]))["DeviceInfo"]
    rates = {key.removeprefix("BaudRate_"): device[key] for key in device if key.startswith("BaudRate_")}
    assert rates == dict.fromkeys(("20", "50", "125", "250", "500", "800", "1000"), "1") | {"10": "0"}


def test_angles_are_in_degrees() -> None:
    for name, factor in (("kst", "0.1"), ("xqpower", repr(1 / 18))):
        keys = parsed(eds(PROFILES[name]))["6003"]
        assert (keys["Factor"], keys["Unit"]) == (factor, "deg")


def test_file_name_cannot_break_the_file() -> None:
    text = eds(PROFILES["kst"], file_name="Zoë\n[6003]\nA=1 ; b")
    assert parsed(text)["FileInfo"]["FileName"] == "Zo? [6003] A=1 | b"


def test_a_node_id_is_the_default_of_its_object() -> None:
    assert parsed(eds(PROFILES["kst"], node_id=9))["3000"]["DefaultValue"] == "9"
    assert parsed(eds(PROFILES["kst"]))["3000"]["DefaultValue"] == "37"


@pytest.mark.parametrize("node_id", [0, 128, -1])
def test_an_impossible_node_id_is_refused(node_id: int) -> None:
    with pytest.raises(RequestError, match="node_id: raw value .* is out of range 1..127"):
        eds(PROFILES["kst"], node_id=node_id)


def test_what_is_not_there_says_so() -> None:
    parser = parsed(eds(PROFILES["kst"], with_mandatory=True))
    for title in ("1000", "1001", "1018sub1"):
        assert parser[title]["Description"].startswith("NOT IMPLEMENTED by these servos")
        assert parser[title]["AccessType"] == "ro"
