"""A file is read whole, as TOML, of a format that is known; for all else there is one message."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.program.source import LONGEST, check_format, read, toml


def test_a_file_is_read_and_one_that_cannot_be_says_why(tmp_path: Path) -> None:
    file = tmp_path / "some.toml"
    file.write_text("format = 1\n", encoding="utf-8")
    assert toml(read(str(file)), "TOML") == {"format": 1}
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(RequestError, match="is no text"):
        read(str(file))
    with pytest.raises(RequestError, match="cannot be read: no such file"):
        read(str(tmp_path / "nowhere.toml"))


@pytest.mark.parametrize("text", ["format =", "a = " + "9" * 5000, "a = " + "[" * 5000, "#" * (LONGEST + 1)])
def test_what_is_no_toml_is_refused_in_one_message(text: str) -> None:
    with pytest.raises(RequestError, match="the file"):
        toml(text, "TOML")


@pytest.mark.parametrize(
    ("data", "advice"), [({}, "write that first"), ({"format": 2}, "newer"), ({"format": True}, "newer")]
)
def test_the_format_is_asked_for(data: dict[str, object], advice: str) -> None:
    check_format({"format": 1})
    with pytest.raises(RequestError, match="format") as refused:
        check_format(data)
    assert advice in refused.value.advice
