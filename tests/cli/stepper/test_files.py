"""Programs from files of any kind, and what is said of those that are none."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.cli.stepper.files import loaded, reading
from motorbus.errors import RequestError
from tests.cli.stepper.conftest import EXAMPLE
from tests.families.stepper.vectors import DUMP_B


def test_a_program_or_a_dump_by_its_suffix(tmp_path: Path) -> None:
    assert loaded(Path(EXAMPLE)).name == "Pick and place"
    for name, data in (("b.bin", DUMP_B), ("b.hex", DUMP_B.hex(" ").encode()), ("b", DUMP_B[6:])):
        path = tmp_path / name
        path.write_bytes(data)
        assert loaded(path).dump() == DUMP_B
        assert loaded(path).name == "b"


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.bin", DUMP_B[:100], "100 bytes, 226 are due"),
        ("a.bin", DUMP_B[:36] + b"\x09" + DUMP_B[37:], "step 1, output: 9"),
        ("a.bin", bytes(1 << 21), "2097152 bytes"),
        ("a.toml", b"\xff\xfe", "is no text"),
        ("a.TOML", b"format = 9", "format: 9 is not known"),
    ],
)
def test_what_is_none_is_refused_with_its_name(tmp_path: Path, name: str, data: bytes, says: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(RequestError, match=says) as caught:
        loaded(path)
    assert name in caught.value.summary


def test_readings_are_switches_by_their_names() -> None:
    assert reading({"seg-loop": "extra", "ramp_tick_ms": "10"}).ramp_tick_ms == 10
    with pytest.raises(RequestError, match="there is no --turnaround"):
        reading({"turnaround": "1"})  # of the line, and not of a run
