"""What a controller has stored as a file: every byte comes back, and a file that is damaged is refused."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.program import Program
from motorbus.families.stepper.program.backups import Backup, is_backup
from motorbus.families.stepper.table import Project
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

BOTH = Backup(dumps={2: DUMP_B, 1: DUMP_A}, made="2024-05-06T07:08:09Z", version="motorbus 1.2")
TEXT = BOTH.text()


def test_it_comes_back() -> None:
    assert Backup.parse(TEXT) == BOTH
    assert BOTH.projects == (1, 2)


@settings(max_examples=50, deadline=None)
@given(
    images=st.dictionaries(st.integers(1, 4), st.binary(min_size=220, max_size=220), min_size=1),
    order=st.sampled_from(("little", "big")),
    made=st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Zl", "Zp"))),
)
def test_whatever_it_holds_it_comes_back(images: dict[int, bytes], order: str, made: str) -> None:
    dumps = {number: wire.encode_dump(number, image) for number, image in images.items()}
    said = "".join(letter for letter in made if letter.isprintable())
    whole = Backup(dumps=dumps, order="big" if order == "big" else "little", made=said)
    assert Backup.parse(whole.text()) == whole


def test_a_file_is_told_for_one_though_it_is_damaged() -> None:
    assert is_backup(TEXT)
    assert is_backup(TEXT.replace("sha256", "sum"))
    for other in ("", "format = 1", 'kind = "another"', "[", f"a = {'9' * 5000}", "[" * 5000):
        assert not is_backup(other)


def test_it_can_be_read() -> None:
    assert 'made = "2024-05-06T07:08:09Z"' in TEXT
    assert "FF AA 3E 01 00 00\n01 01 00" in TEXT
    assert '# delay = "1000 ms"' in TEXT
    assert "# no steps: it was cleared" in Backup(dumps={3: wire.encode_dump(3, bytes(220))}).text()
    assert "# no program: " in Backup(dumps={3: wire.encode_dump(3, b"\3\x0b" + bytes(218))}).text()
    assert tomllib.loads(TEXT)["format"] == 1


def test_its_comments_are_programs() -> None:
    comments = [line[2:] for line in TEXT.splitlines() if line.startswith("# ") or line == "#"]
    first = comments.index("format = 1")
    second = comments.index("format = 1", first + 1)
    assert Program.parse("\n".join(comments[first:second])).project == BOTH.project(1)


def test_its_projects_are_those_of_the_dumps() -> None:
    assert BOTH.image(1) == DUMP_A[6:]
    assert BOTH.program(2).dump() == DUMP_B
    assert BOTH.project(2).total_steps == 3
    assert Backup(dumps={3: wire.encode_dump(3, bytes(220))}).project(3) == Project()
    with pytest.raises(RequestError, match="there is no project 3 in this backup"):
        BOTH.program(3)


BAD = {
    "empty": "",
    "no TOML": "format = = 1",
    "another kind": TEXT.replace("stepper backup", "servo backup"),
    "a program": "format = 1\n[motor]\nmicrosteps = 8\n",
    "a format to come": TEXT.replace("format = 1", "format = 2", 1),
    "format true": TEXT.replace("format = 1", "format = true", 1),
    "a key that is none": TEXT.replace("made =", "maid ="),
    "an order that is none": TEXT.replace('"little"', '"middle"'),
    "no projects": TEXT[: TEXT.index("[[project]]")],
    "projects that are a number": TEXT[: TEXT.index("[[project]]")] + "project = 3\n",
    "projects that are numbers": TEXT[: TEXT.index("[[project]]")] + "project = [3]\n",
    "project 5": TEXT.replace("number = 2", "number = 5"),
    "a project twice": TEXT.replace("number = 2", "number = 1").replace("FF AA 3E 02", "FF AA 3E 01"),
    "twice and whole": TEXT + TEXT[TEXT.index("[[project]]") :],
    "another project's dump": TEXT.replace("FF AA 3E 02", "FF AA 3E 03"),
    "a bit": TEXT.replace("E8 03", "E8 02"),
    "a byte too few": TEXT.replace("E8 03 ", "E8 "),
    "no hexadecimal": TEXT.replace("E8 03", "E8 0G"),
    "no sum": TEXT.replace("sha256", "sum"),
    "very long": TEXT + "#" * 1_000_001,
    "deep": "a = " + "[" * 5000,
}


@pytest.mark.parametrize("text", BAD.values(), ids=BAD.keys())
def test_a_damaged_one_is_refused(text: str) -> None:
    with pytest.raises(RequestError):
        Backup.parse(text)


@settings(max_examples=200, deadline=None)
@given(at=st.integers(0, len(TEXT) - 1), other=st.sampled_from("0123456789ABCDEF\n '\"=#"))
def test_a_character_that_has_changed_changes_no_project(at: int, other: str) -> None:
    try:
        found = Backup.parse(TEXT[:at] + other + TEXT[at + 1 :])
    except RequestError:
        return
    for number in found.projects:
        assert found.image(number) == BOTH.image(number)
